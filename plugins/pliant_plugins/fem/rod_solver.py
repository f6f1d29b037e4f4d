"""States of one module in the rod frame, independent of the FEM code: caching, control and reports."""

from __future__ import annotations

import time
from abc import abstractmethod
from collections import deque
from collections.abc import Mapping
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.fem import Held, ModuleSolver, StateNotConvergedError
from pliant.mechanics.rotations import exp_map, left_jacobian
from pliant.records.actuation import Levels, actuation_kind
from pliant.records.design import Array
from pliant.records.fem import SELF_CONTACT, TOUCHING, FemState, ModuleProblem
from pliant_plugins.fem.iteration import DivergedError, SingularMatrixError
from pliant_plugins.fem.newton import Control, FemEquilibrium, Newton
from pliant_plugins.fem.predictor import Anchor, expected

OVERLAP = 1e-4  # of the span: material this far beyond a mirror plane is self-contact
# Of a solver with contact: no contact, walls in equilibrium contact, walls with too deep a penetration.
Touch = Literal["free", "solved", "deep"]


class RodSolver(ModuleSolver):
    """A solver that continues from state to state with `Newton` and caches the last factorised equilibria.

    A start among these costs nothing. Convolutions that meet are reported, not resolved, unless the code has contact
    (`_touching`).
    """

    remembered: ClassVar[int] = 8
    most_anchors: ClassVar[int] = 64

    def __init__(
        self, problem: ModuleProblem, newton: Newton, places: tuple[int, ...], scales: tuple[float, ...]
    ) -> None:
        """Set up a solver for the module's coordinates u = scale · q, of the globals q at `places`, axis by axis."""
        self.problem, self.newton = problem, newton
        self._places, self._scales = places, np.array(scales)
        self._known: deque[FemEquilibrium] = deque(maxlen=self.remembered)
        self._learnt: deque[tuple[Array, FemState | Anchor]] = deque(maxlen=self.most_anchors)

    def rest(self) -> FemState:
        """Return the undeformed state with its slopes."""
        begun = time.perf_counter()
        return self._state(self._at(self._undeformed(), self._unactuated), (), begun)

    @property
    def _unactuated(self) -> Levels:
        m = len(self.problem.actuations)
        return 0.0 if m == 1 else np.zeros(m)

    def free(self, actuation: Levels, start: FemState) -> FemState:
        """Solve for equilibrium at `actuation` (Pa or N) without external effort.

        From a constrained start the external effort is released along with the change of actuation.
        """
        return self._solve(actuation, {}, start)

    def constrained(self, actuation: Levels, held: Held, start: FemState) -> FemState:
        """Solve for equilibrium at `actuation` (Pa or N) with prescribed coordinates, rad or m."""
        named = held if isinstance(held, Mapping) else {self.problem.main_axis: held}
        for axis in named:
            if axis not in self.problem.axes:
                known = ", ".join(self.problem.axes)
                raise UserError(f"the held axis '{axis}' is none of this module's: {known}.")
        return self._solve(actuation, {axis: float(value) for axis, value in named.items()}, start)

    def learn(self, state: FemState) -> None:
        """Add a converged state; the states added predict the next ones, in their order."""
        if state.solution.shape == self._undeformed().shape:
            known = self._remembered(state.solution, state.actuation)
            G = self.newton.system.count
            z = np.append(state.actuation, state.solution[-G:][list(self._places)])
            self._learnt.append((z, state if known is None else self._anchor(known)))

    def _anchor(self, known: FemEquilibrium) -> Anchor:
        return Anchor.from_equilibrium(self.newton.system, known, self._places)

    def _expected(self, target: Control) -> Array | None:
        """Predict x at a control from learned states; those of other processes are factorised on demand."""

        def anchor(i: int) -> Anchor:
            z, one = self._learnt[i]
            if isinstance(one, FemState):
                one = self._anchor(self._at(one.solution, one.actuation))
                self._learnt[i] = z, one
            return one

        try:
            return expected(np.array([z for z, _ in self._learnt]), anchor, target, self._places)
        except (DivergedError, SingularMatrixError, np.linalg.LinAlgError):
            return None

    def _solve(self, actuation: Levels, held: Mapping[str, float], start: FemState) -> FemState:
        begun = time.perf_counter()
        actuation = self._as_levels(actuation)
        try:
            self._check(start.solution)
            G = self.newton.system.count
            mask, goal = np.zeros(G, bool), np.zeros(G)
            for axis, place, scale in zip(self.problem.axes, self._places, self._scales, strict=True):
                if axis in held:
                    mask[place], goal[place] = True, held[axis] / scale
            target = Control(actuation, mask, goal, np.zeros(G))
            expected = self._expected(target)
            found = None if expected is None else self.newton.at_once(target, expected)
            equilibrium = found or self.newton.advance(self._at(start.solution, start.actuation), target)
        except (DivergedError, SingularMatrixError) as error:
            before = dict(zip(self.problem.axes, start.deformation, strict=True))
            raise StateNotConvergedError(
                f"no {'constrained' if held else 'free'} equilibrium at {self._driven(actuation)}{self._named(held)} "
                f"from the state at {self._driven(start.actuation)}{self._named(before)}: {error}."
            ) from error
        self._known.append(equilibrium)
        return self._state(equilibrium, tuple(held), begun)

    def _as_levels(self, actuation: Levels) -> Levels:
        """Return a number, or (m,) floats. Raises `UserError` for a wrong number of values."""
        names = self.problem.actuations
        given = 1 if np.ndim(actuation) == 0 else len(actuation)
        if given != len(names):
            chambers = "input is" if given == 1 else "inputs are"
            raise UserError(
                f"{given} {chambers} given, and the module has {len(names)}: {self.problem.actuation}."
            )
        return actuation if len(names) == 1 else np.array(actuation, float)

    def _driven(self, actuation: Levels) -> str:
        """Return "12000 Pa", of several "12000 Pa, 0 Pa"."""
        values = zip(self.problem.actuations, np.atleast_1d(actuation).tolist(), strict=True)
        return ", ".join(f"{value:.6g} {actuation_kind(name).unit}" for name, value in values)

    def _named(self, held: Mapping[str, float]) -> str:
        unit = "m" if self.problem.joint == "prismatic" else "rad"
        values = ", ".join(f"{axis} = {value:.4g} {unit}" for axis, value in held.items())
        return f" and {values}" if held else ""

    def _check(self, x: Array) -> None:
        """Raise `UserError` for the unknowns of another module."""
        count = len(self._undeformed())
        if x.shape != (count,):
            raise UserError(
                f"the start state has {x.size} unknowns, this module {count}: it belongs to another mesh, order or "
                "backend."
            )

    def _at(self, x: Array, actuation: Levels) -> FemEquilibrium:
        """Return the equilibrium at x, factorised again unless it is cached."""
        self._check(x)
        equilibrium = self._remembered(x, actuation)
        if equilibrium is None:
            equilibrium = self.newton.at(np.array(x), actuation)
            self._known.append(equilibrium)
        return equilibrium

    def _remembered(self, x: Array, actuation: Levels) -> FemEquilibrium | None:
        for known in self._known:
            if np.array_equal(known.point.actuation, actuation) and np.array_equal(known.point.x, x):
                return known
        return None

    def _status(self, x: Array) -> str:
        """Return the contact status of walls and rigid parts at x."""
        problem, touching = self.problem, self._touching(x)
        if problem.contact_range is not None and (touching is None or not problem.stops):
            low, high = problem.contact_range
            if not low <= self._coordinates(x)[problem.axes.index(problem.main_axis)] <= high:
                return SELF_CONTACT
        if touching is None:
            return SELF_CONTACT if self._overlaps(x) else "ok"
        return {"free": "ok", "solved": TOUCHING, "deep": SELF_CONTACT}[touching]

    def _touching(self, x: Array) -> Touch | None:
        """Return the contact state of walls; None in a code that does not solve contact."""
        return None

    def _overlaps(self, x: Array) -> bool:
        """Return whether skin nodes crossed a mirror plane that neighbouring convolutions share."""
        problem = self.problem
        strain = self._frame(x)[1]
        s = self._section(x)[np.unique(problem.mesh.skin), 0]
        beyond = {"start": -s.min(), "end": s.max() - (1 + strain) * problem.span_m}
        return any(beyond[plane] > OVERLAP * problem.span_m for plane in problem.contact_planes)

    def _state(self, equilibrium: FemEquilibrium, held: tuple[str, ...], begun: float) -> FemState:
        """Convert piece to module: u = c q, Π_module = E Π_piece, hence τ = −(E/c) ∂Π_piece/∂q.

        `begun` is the clock's time of the request.
        """
        point, energy, scales = equilibrium.point, self.problem.energy_scale, self._scales
        by_actuation, by_axes = equilibrium.reduced.slopes(self._places)
        efforts = -point.residual[-self.newton.system.count :]
        return FemState(
            actuation=point.actuation,
            deformation=self._coordinates(point.x),
            tau=energy / scales * efforts[list(self._places)],
            dtau_dp=(energy / scales * by_actuation.T).T,
            dtau_du=energy / np.outer(scales, scales) * by_axes,
            energy_j=energy * point.energy.value,
            travel=energy * (point.travel - self._travel_at_rest),
            axial_strain=self._frame(point.x)[1],
            branch="constrained" if held else "free",
            status=self._status(point.x),
            iterations=equilibrium.iterations,
            wall_s=time.perf_counter() - begun,
            main=self.problem.axes.index(self.problem.main_axis),
            held=held,
            solution=point.x,
        )

    @cached_property
    def _travel_at_rest(self) -> Levels:
        point = self.newton.system.evaluate(self._undeformed(), self._unactuated)
        assert point is not None  # the mesh is sound
        return point.travel

    def _coordinates(self, x: Array) -> Array:
        """Return u of the module by axis, (k,)."""
        return np.asarray(self._scales * x[-self.newton.system.count :][list(self._places)])

    def deformed_nodes(self, state: FemState) -> Array:
        """Return (n, 3) node positions in m; the start section stays at rest."""
        turn, strain = self._frame(state.solution)
        k = turn / ((1 + strain) * self.problem.span_m)
        return placed(self._section(state.solution), k, self.problem.reference_z_m)

    @abstractmethod
    def _undeformed(self) -> Array:
        """Return (n,) the unknowns x of the undeformed rod."""

    @abstractmethod
    def _frame(self, x: Array) -> tuple[Array, float]:
        """Return Θ (3,) of the piece and e."""

    @abstractmethod
    def _section(self, x: Array) -> Array:
        """Return section coordinates (n, 3) of the mesh's nodes: s₁ and y, z."""


def placed(section: Array, k: Array, reference_z_m: float) -> Array:
    """Return positions (n, 3) in space of section coordinates (s, y, z) (n, 3); the section s = 0 stays at rest.

    R(s) = exp(s [k]×) and r(s) = ∫ R e₁ ds = s J(s k) e₁, with J the left Jacobian of the rotation.
    """
    along = section[:, 0]
    vectors = along[:, None] * k
    offset = np.column_stack([np.zeros_like(along), section[:, 1], section[:, 2] - reference_z_m])
    line = along[:, None] * left_jacobian(vectors)[:, :, 0]
    position: Array = line + np.einsum("nij,nj->ni", exp_map(vectors), offset)
    position[:, 2] += reference_z_m
    return position


def field_values(F: Array, stress: Array, energy: Array, volume_ratio: Array) -> dict[str, Array]:
    """Return fields of `ModuleFields` at points, from F, the Cauchy stress (…, 3, 3), W and the volume ratio (…)."""
    mean = np.trace(stress, axis1=-2, axis2=-1) / 3
    deviator = stress - mean[..., None, None] * np.eye(3)
    return {
        "von_mises_pa": np.sqrt(1.5 * np.sum(deviator**2, axis=(-2, -1))),
        "hydrostatic_pa": mean,
        "energy_j_m3": energy,
        "volume_ratio": volume_ratio,
        "largest_stretch": np.linalg.svd(F, compute_uv=False)[..., 0],
    }
