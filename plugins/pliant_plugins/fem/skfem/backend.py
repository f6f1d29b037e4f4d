"""The default FEM backend: `Skfem` makes a `SkfemSolver` for each module."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.fem import FEMBackend, Held, ModuleSolver, StateNotConvergedError
from pliant.interfaces.material import Material
from pliant.records.design import Array
from pliant.records.fem import FemState, ModuleFields, ModuleProblem
from pliant.records.structure import StructureProblem
from pliant_plugins.fem.skfem.assembly import Assembler
from pliant_plugins.fem.skfem.condense import Control, slopes
from pliant_plugins.fem.skfem.config import SkfemConfig
from pliant_plugins.fem.skfem.fields import module_fields
from pliant_plugins.fem.skfem.kinematics import placed
from pliant_plugins.fem.skfem.linear import linear_solver
from pliant_plugins.fem.skfem.newton import DivergedError, Equilibrium, Newton
from pliant_plugins.fem.skfem.structure import SkfemStructure

REMEMBERED = 8  # equilibria kept factorised: a start among them costs nothing
OVERLAP = 1e-4  # of the span: material this far beyond a mirror plane is self-contact


class SkfemSolver(ModuleSolver):
    """States of one module in the rod frame.

    A state's `solution` is x: displacements (m) node by node, volumes and pressures of mixed cells, then the
    piece's active globals among Θ_x, Θ_y, Θ_z, e. Convolutions that meet are reported, not resolved: there is no
    contact in the model.
    """

    def __init__(self, config: SkfemConfig, problem: ModuleProblem, material: Material) -> None:
        self.problem = problem
        self.assembler = Assembler(problem, material, config.dilatation)
        self.linear = linear_solver(config.linear_solver, self.assembler.pattern)
        self.newton = Newton(
            self.assembler, self.linear, config.tolerance, config.max_iterations, config.max_halvings
        )
        self._at_rest = self.assembler.travel(np.zeros(self.assembler.count)).value
        self._known: deque[Equilibrium] = deque(maxlen=REMEMBERED)

    def rest(self) -> FemState:
        """The undeformed state with its slopes."""
        begun = time.perf_counter()
        rest = self._at(np.zeros(self.assembler.count), 0.0)
        return self._state(rest, (), time.perf_counter() - begun)

    def free(self, actuation: float, start: FemState) -> FemState:
        """Equilibrium at `actuation` (Pa or N) without external effort.

        From a constrained start the external effort is released along with the change of actuation.
        """
        return self._solve(actuation, {}, start)

    def constrained(self, actuation: float, held: Held, start: FemState) -> FemState:
        """Equilibrium at `actuation` (Pa or N) with some of the module's coordinates held."""
        by_axis = held if isinstance(held, Mapping) else {self.problem.main_axis: float(held)}
        for axis in by_axis:
            if axis not in self.problem.axes:
                raise UserError(
                    f"the held axis '{axis}' is none of this module's: {', '.join(self.problem.axes)}."
                )
        return self._solve(actuation, by_axis, start)

    def deformed_nodes(self, state: FemState) -> Array:
        """(n, 3) node positions in m; the start section stays at rest."""
        section = self.assembler.positions(state.solution)
        k, strain = self.assembler.globals.curvature(state.solution)
        section[:, 0] += strain * self.problem.mesh.nodes_m[:, 0]
        return placed(section, k, self.problem.reference_z_m)

    def fields(self, state: FemState) -> ModuleFields:
        """Displacement, Cauchy stress and stretch at the nodes."""
        return module_fields(self.assembler, state.solution, self.deformed_nodes(state))

    def cavity_volume(self, state: FemState) -> float:
        """Volume (m³) of the whole module's cavity."""
        return self.problem.energy_scale * self.assembler.cavity(state.solution).value

    def _solve(self, actuation: float, held: Mapping[str, float], start: FemState) -> FemState:
        begun = time.perf_counter()
        try:
            here = self._at(start.solution, start.actuation)
            found = self.newton.advance(here, self._control(actuation, held))
        except DivergedError as error:
            unit = "N" if self.problem.actuation == "tendon_force_n" else "Pa"
            raise StateNotConvergedError(
                f"no {'constrained' if held else 'free'} equilibrium at {actuation:.6g} {unit}"
                f"{self._named(held)} from the state at {start.actuation:.6g} {unit}"
                f"{self._named(dict(zip(self.problem.axes, start.deformation, strict=True)))}: {error}."
            ) from error
        self._known.append(found)
        return self._state(found, tuple(held), time.perf_counter() - begun)

    def _named(self, held: Mapping[str, float]) -> str:
        unit = "m" if self.problem.joint == "prismatic" else "rad"
        values = ", ".join(f"{axis} = {value:.4g} {unit}" for axis, value in held.items())
        return f" and {values}" if held else ""

    def _control(self, actuation: float, held: Mapping[str, float]) -> Control:
        """The module's coordinates as the piece's globals."""
        g = self.assembler.globals
        mask, goal = np.zeros(g.count, bool), np.zeros(g.count)
        for axis, place, scale in zip(g.axes, g.places, g.scales, strict=True):
            if axis in held:
                mask[place], goal[place] = True, held[axis] / scale
        return Control(actuation, mask, goal, np.zeros(g.count))

    def _at(self, x: Array, actuation: float) -> Equilibrium:
        """The equilibrium at x, factorised anew unless it is remembered."""
        if x.shape != (self.assembler.count,):
            raise UserError(
                f"the start state has {x.size} unknowns, this module {self.assembler.count}: "
                "it belongs to another mesh."
            )
        for known in self._known:
            if known.point.actuation == actuation and np.array_equal(known.point.x, x):
                return known
        found = self.newton.at(np.array(x), actuation)
        self._known.append(found)
        return found

    def _state(self, found: Equilibrium, held: tuple[str, ...], wall_s: float) -> FemState:
        """Piece to module: u = c q, Π_module = E Π_piece, hence τ = −(E/c) ∂Π_piece/∂q."""
        point, g, energy = found.point, self.assembler.globals, self.problem.energy_scale
        by_actuation, by_axes = slopes(found.reduced, g.places)
        places, scales = list(g.places), np.array(g.scales)
        return FemState(
            actuation=point.actuation,
            deformation=scales * point.x[-g.count :][places],
            tau=energy / scales * point.effort[places],
            dtau_dp=energy / scales * by_actuation,
            dtau_du=energy / np.outer(scales, scales) * by_axes,
            energy_j=energy * point.energy.value,
            travel=energy * (point.travel.value - self._at_rest),
            axial_strain=g.split(point.x)[1],
            branch="constrained" if held else "free",
            status="self_contact" if self._overlaps(point.x) else "ok",
            iterations=found.iterations,
            wall_s=wall_s,
            main=g.axes.index(self.problem.main_axis),
            held=held,
            solution=point.x,
        )

    def _overlaps(self, x: Array) -> bool:
        """Whether skin nodes crossed a mirror plane that neighbouring convolutions share, or rigid parts meet."""
        g = self.assembler.globals
        if self.problem.contact_range is not None:
            main = g.axes.index(self.problem.main_axis)
            u = g.scales[main] * x[-g.count :][g.places[main]]
            low, high = self.problem.contact_range
            if not low <= u <= high:
                return True
        strain, span = g.split(x)[1], self.problem.span_m
        skin = np.unique(self.problem.mesh.skin)
        s = self.assembler.positions(x)[skin, 0] + strain * self.problem.mesh.nodes_m[skin, 0]
        beyond = {"start": -s.min(), "end": s.max() - (1 + strain) * span}
        return any(beyond[plane] > OVERLAP * span for plane in self.problem.contact_planes)


class Skfem(FEMBackend):
    """scikit-fem with a direct solver: rod-frame problems under pressure or by tendon."""

    config: SkfemConfig

    def __init__(self, config: SkfemConfig) -> None:
        super().__init__(config)

    def solver(self, problem: ModuleProblem, material: Material) -> SkfemSolver:
        """Raises `UserError` for another frame or actuation than this backend knows."""
        if problem.frame != "rod":
            raise UserError(f"fem 'skfem' solves frame 'rod' only, not '{problem.frame}'.")
        if problem.actuation not in ("pressure_pa", "tendon_force_n"):
            raise UserError(
                f"fem 'skfem' solves modules driven by 'pressure_pa' or 'tendon_force_n', "
                f"not '{problem.actuation}'."
            )
        if problem.actuation == "tendon_force_n" and problem.tendon is None:
            raise UserError("a module driven by 'tendon_force_n' needs its tendon; the problem has none.")
        return SkfemSolver(self.config, problem, material)

    def structure(self, problem: StructureProblem, material: Material) -> SkfemStructure:
        """A solver for a body of several modules."""
        return SkfemStructure(self.config, problem, material)
