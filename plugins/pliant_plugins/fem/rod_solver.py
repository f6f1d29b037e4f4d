"""States of one module in the rod frame, whichever code solves them: what is remembered, controlled and reported."""

from __future__ import annotations

import time
from abc import abstractmethod
from collections import deque
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.fem import Held, ModuleSolver, StateNotConvergedError
from pliant.records.design import Array
from pliant.records.fem import FemState, ModuleProblem
from pliant_plugins.fem.newton import DivergedError, SingularMatrixError

OVERLAP = 1e-4  # of the span: material this far beyond a mirror plane is self-contact


class RodSolver(ModuleSolver):
    """Goes from state to state with a backend's `Newton`, whose last equilibria are kept factorised.

    A start among these costs nothing. Convolutions that meet are reported, not resolved: there is no contact in the
    model.
    """

    remembered: ClassVar[int] = 8
    newton: Any  # of the backend: `at(x, actuation)` and `advance(equilibrium, target)`

    def __init__(self, problem: ModuleProblem) -> None:
        self.problem = problem
        self._known: deque[Any] = deque(maxlen=self.remembered)

    def rest(self) -> FemState:
        """The undeformed state with its slopes."""
        begun = time.perf_counter()
        return self._state(self._at(self._undeformed(), 0.0), (), begun)

    def free(self, actuation: float, start: FemState) -> FemState:
        """Equilibrium at `actuation` (Pa or N) without external effort.

        From a constrained start the external effort is released along with the change of actuation.
        """
        return self._solve(actuation, {}, start)

    def constrained(self, actuation: float, held: Held, start: FemState) -> FemState:
        """Equilibrium at `actuation` (Pa or N) with some of the module's coordinates held, rad or m."""
        named = held if isinstance(held, Mapping) else {self.problem.main_axis: held}
        for axis in named:
            if axis not in self.problem.axes:
                known = ", ".join(self.problem.axes)
                raise UserError(f"the held axis '{axis}' is none of this module's: {known}.")
        return self._solve(actuation, {axis: float(value) for axis, value in named.items()}, start)

    def _solve(self, actuation: float, held: Mapping[str, float], start: FemState) -> FemState:
        begun = time.perf_counter()
        try:
            here = self._at(start.solution, start.actuation)
            equilibrium = self.newton.advance(here, self._target(actuation, held))
        except (DivergedError, SingularMatrixError) as error:
            unit = "N" if self.problem.actuation == "tendon_force_n" else "Pa"
            before = dict(zip(self.problem.axes, start.deformation, strict=True))
            raise StateNotConvergedError(
                f"no {'constrained' if held else 'free'} equilibrium at {actuation:.6g} {unit}{self._named(held)} "
                f"from the state at {start.actuation:.6g} {unit}{self._named(before)}: {error}."
            ) from error
        self._known.append(equilibrium)
        return self._state(equilibrium, tuple(held), begun)

    def _named(self, held: Mapping[str, float]) -> str:
        unit = "m" if self.problem.joint == "prismatic" else "rad"
        values = ", ".join(f"{axis} = {value:.4g} {unit}" for axis, value in held.items())
        return f" and {values}" if held else ""

    def _at(self, x: Array, actuation: float) -> Any:
        """The equilibrium at x, factorised anew unless it is remembered."""
        count = len(self._undeformed())
        if x.shape != (count,):
            raise UserError(
                f"the start state has {x.size} unknowns, this module {count}: it belongs to another mesh, order or "
                "backend."
            )
        for known in self._known:
            if known.point.actuation == actuation and np.array_equal(known.point.x, x):
                return known
        equilibrium = self.newton.at(np.array(x), actuation)
        self._known.append(equilibrium)
        return equilibrium

    def _overlaps(self, x: Array) -> bool:
        """Whether skin nodes crossed a mirror plane that neighbouring convolutions share, or rigid parts meet."""
        problem = self.problem
        if problem.contact_range is not None:
            low, high = problem.contact_range
            if not low <= self._coordinates(x)[problem.axes.index(problem.main_axis)] <= high:
                return True
        strain = self._frame(x)[1]
        s = self._section(x)[np.unique(problem.mesh.skin), 0]
        beyond = {"start": -s.min(), "end": s.max() - (1 + strain) * problem.span_m}
        return any(beyond[plane] > OVERLAP * problem.span_m for plane in problem.contact_planes)

    @abstractmethod
    def _undeformed(self) -> Array:
        """x at rest."""

    @abstractmethod
    def _target(self, actuation: float, held: Mapping[str, float]) -> Any:
        """What `Newton.advance` goes to; `held` coordinates of the module by axis, rad or m."""

    @abstractmethod
    def _state(self, equilibrium: Any, held: tuple[str, ...], begun: float) -> FemState:
        """Piece to module; `begun` is the clock's time at which the state was asked for."""

    @abstractmethod
    def _coordinates(self, x: Array) -> Array:
        """u of the module by axis, (k,)."""

    @abstractmethod
    def _frame(self, x: Array) -> tuple[Array, float]:
        """Θ (3,) of the piece and e."""

    @abstractmethod
    def _section(self, x: Array) -> Array:
        """Section coordinates (n, 3) of the mesh's nodes: s₁ and y, z."""
