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
from pliant.records.fem import Branch, FemState, ModuleProblem
from pliant_plugins.fem.skfem.assembly import Assembler
from pliant_plugins.fem.skfem.condense import slopes
from pliant_plugins.fem.skfem.config import SkfemConfig
from pliant_plugins.fem.skfem.linear import linear_solver
from pliant_plugins.fem.skfem.newton import Control, DivergedError, Equilibrium, Newton

REMEMBERED = 8  # equilibria kept factorised: a start among them costs nothing
OVERLAP = 1e-4  # of the span: material this far beyond a mirror plane is self-contact


class SkfemSolver(ModuleSolver):
    """States of one module in the bend frame.

    A state's `solution` is x = (v, θ, e): displacements (m) node by node, half-module angle, axial strain.
    Convolutions that meet are reported, not resolved: there is no contact in the model.
    """

    def __init__(self, config: SkfemConfig, problem: ModuleProblem, material: Material) -> None:
        self.problem = problem
        self.assembler = Assembler(problem, material, config.dilatation)
        self.linear = linear_solver(config.linear_solver, self.assembler.pattern)
        self.newton = Newton(
            self.assembler, self.linear, config.tolerance, config.max_iterations, config.max_halvings
        )
        self._cavity_at_rest = self.assembler.cavity(np.zeros(self.assembler.size + 2)).value
        self._known: deque[Equilibrium] = deque(maxlen=REMEMBERED)

    def rest(self) -> FemState:
        """The undeformed state with its slopes."""
        begun = time.perf_counter()
        rest = self._at(np.zeros(self.assembler.size + 2), 0.0)
        return self._state(rest, "free", time.perf_counter() - begun)

    def free(self, actuation: float, start: FemState) -> FemState:
        """Equilibrium at pressure `actuation` (Pa) without external moment.

        From a constrained start the external moment is released along with the change of pressure.
        """
        return self._solve(Control(actuation, None), "free", start)

    def constrained(self, actuation: float, held: Held, start: FemState) -> FemState:
        """Equilibrium at pressure `actuation` (Pa) with the module's angle held."""
        angle_rad = held["y"] if isinstance(held, Mapping) else held
        return self._solve(
            Control(actuation, angle_rad / self.problem.deformation_scale), "constrained", start
        )

    def deformed_nodes(self, state: FemState) -> Array:
        """(n, 3) node positions in m; the start section stays at rest."""
        section = self.assembler.positions(state.solution)
        reference = self.problem.mesh.nodes_m
        section[:, 0] += state.axial_strain * reference[:, 0]
        return self.assembler.frame.place(section, float(state.solution[-2]), state.axial_strain)

    def cavity_volume(self, state: FemState) -> float:
        """Volume (m³) of the whole module's cavity."""
        return self.problem.energy_scale * self.assembler.cavity(state.solution).value

    def _solve(self, target: Control, branch: Branch, start: FemState) -> FemState:
        begun = time.perf_counter()
        try:
            found = self.newton.advance(self._at(start.solution, start.actuation), target)
        except DivergedError as error:
            held = (
                ""
                if target.theta is None
                else f" and angle {self.problem.deformation_scale * target.theta:.4g} rad"
            )
            raise StateNotConvergedError(
                f"no {branch} equilibrium at {target.pressure:.6g} Pa{held} from the state at "
                f"{start.actuation:.6g} Pa, {start.angle_rad:.4g} rad: {error}."
            ) from error
        self._known.append(found)
        return self._state(found, branch, time.perf_counter() - begun)

    def _at(self, x: Array, pressure: float) -> Equilibrium:
        """The equilibrium at x, factorised anew unless it is remembered."""
        if x.shape != (self.assembler.size + 2,):
            raise UserError(
                f"the start state has {x.size} unknowns, this module {self.assembler.size + 2}: "
                "it belongs to another mesh."
            )
        for known in self._known:
            if known.point.pressure == pressure and np.array_equal(known.point.x, x):
                return known
        found = self.newton.at(x, pressure)
        self._known.append(found)
        return found

    def _state(self, found: Equilibrium, branch: Branch, wall_s: float) -> FemState:
        """Piece to module: u = a θ, Π_module = c Π_piece, hence τ = −(c/a) ∂Π_piece/∂θ."""
        point, (by_pressure, by_theta) = found.point, slopes(found.reduced)
        angle, energy = self.problem.deformation_scale, self.problem.energy_scale
        return FemState(
            actuation=point.pressure,
            deformation=np.array([angle * point.x[-2]]),
            tau=np.array([energy / angle * point.moment]),
            dtau_dp=np.array([energy / angle * by_pressure]),
            dtau_du=np.array([[energy / angle**2 * by_theta]]),
            energy_j=energy * point.energy.value,
            travel=energy * (point.cavity.value - self._cavity_at_rest),
            held=() if branch == "free" else ("y",),
            axial_strain=float(point.x[-1]),
            branch=branch,
            status="self_contact" if self._overlaps(point.x) else "ok",
            iterations=found.iterations,
            wall_s=wall_s,
            solution=point.x,
        )

    def _overlaps(self, x: Array) -> bool:
        """Whether skin nodes crossed a mirror plane that neighbouring convolutions share."""
        strain, span = float(x[-1]), self.problem.span_m
        skin = np.unique(self.problem.mesh.skin)
        s = self.assembler.positions(x)[skin, 0] + strain * self.problem.mesh.nodes_m[skin, 0]
        beyond = {"start": -s.min(), "end": s.max() - (1 + strain) * span}
        return any(beyond[plane] > OVERLAP * span for plane in self.problem.contact_planes)


class Skfem(FEMBackend):
    """scikit-fem with a direct solver: bend-frame problems under pressure."""

    config: SkfemConfig

    def __init__(self, config: SkfemConfig) -> None:
        super().__init__(config)

    def solver(self, problem: ModuleProblem, material: Material) -> SkfemSolver:
        """Raises `UserError` for another frame or actuation than this backend knows."""
        if problem.frame != "rod":
            raise UserError(f"fem 'skfem' solves frame 'rod' only, not '{problem.frame}'.")
        if problem.actuation != "pressure_pa":
            raise UserError(
                f"fem 'skfem' solves modules driven by 'pressure_pa' only, not '{problem.actuation}'."
            )
        return SkfemSolver(self.config, problem, material)
