"""The second FEM backend: `Ngsolve` makes an `NgsolveSolver` for each module."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.fem import FEMBackend, Held, ModuleSolver, StateNotConvergedError
from pliant.interfaces.material import Material
from pliant.meshing.hexahedra import cell_volumes
from pliant.records.design import Array
from pliant.records.fem import FemState, ModuleFields, ModuleProblem
from pliant_plugins.fem.ngsolve.config import NgsolveConfig
from pliant_plugins.fem.ngsolve.constraints import eliminate
from pliant_plugins.fem.ngsolve.fields import deformation_gradients, nodal_fields
from pliant_plugins.fem.ngsolve.forms import AXES, STRAIN, build_forms
from pliant_plugins.fem.ngsolve.library import ngs
from pliant_plugins.fem.ngsolve.mesh import curved_mesh, nodal_table, placed
from pliant_plugins.fem.ngsolve.newton import DivergedError, Equilibrium, Newton, Target
from pliant_plugins.fem.ngsolve.system import ONE_AT_A_TIME, SingularMatrixError, System

REMEMBERED = 6  # equilibria kept condensed: a start among them costs nothing
OVERLAP = 1e-4  # of the span: material this far beyond a mirror plane is self-contact


class NgsolveSolver(ModuleSolver):
    """States of one module in the rod frame.

    A state's `solution` is (v/span, q/μ, numbers): NGSolve's hierarchical unknowns of displacement and pressure, then
    the components of Θ that are axes, and e.
    """

    def __init__(self, config: NgsolveConfig, problem: ModuleProblem, material: Material) -> None:
        self.problem, self.material = problem, material
        mesh = curved_mesh(problem.mesh)
        forms = build_forms(mesh, problem, material, config.order)
        scalar = ngs.H1(mesh, order=config.order)
        self.system = System(
            forms,
            eliminate(problem, scalar, forms.space.ndof - len(forms.globals_)),
            config.threads,
        )
        volume = float(cell_volumes(problem.mesh.nodes_m, problem.mesh.cells).sum())
        self.newton = Newton(
            self.system,
            material.shear_modulus_pa * volume,
            config.tolerance,
            config.max_iterations,
            config.max_halvings,
        )
        self._table = nodal_table(scalar, problem.mesh)
        self._scalar = scalar
        self._pressures = nodal_table(ngs.H1(mesh, order=config.order - 1), problem.mesh)
        # places of the joint's coordinates among the numbers, and u per number
        prismatic = problem.joint == "prismatic"
        names = (STRAIN,) if prismatic else problem.axes
        self._places = [forms.globals_.index(name) for name in names]
        self._scale = problem.deformation_scale * (problem.span_m if prismatic else 1.0)
        self._travel_at_rest = 0.0
        self._known: deque[Equilibrium] = deque(maxlen=REMEMBERED)
        self._travel_at_rest = self._at(self.system.start(), 0.0).point.travel

    def rest(self) -> FemState:
        """The undeformed state with its slopes."""
        begun = time.perf_counter()
        return self._state(self._at(self.system.start(), 0.0), None, begun)

    def free(self, actuation: float, start: FemState) -> FemState:
        """Equilibrium without external effort; that of a held start fades out along the way."""
        return self._solve(actuation, None, start)

    def constrained(self, actuation: float, held: Held, start: FemState) -> FemState:
        """Equilibrium with some coordinates of the joint held, rad or m."""
        named = held if isinstance(held, Mapping) else {self.problem.main_axis: held}
        for axis in named:
            if axis not in self.problem.axes:
                known = ", ".join(f"'{name}'" for name in self.problem.axes)
                raise UserError(f"fem 'ngsolve' cannot hold axis '{axis}': this problem's axes are {known}.")
        return self._solve(actuation, {axis: float(value) for axis, value in named.items()}, start)

    def deformed_nodes(self, state: FemState) -> Array:
        """(n, 3) node positions in m; the start section stays at rest."""
        turn, strain = self._frame(state.solution)
        section = self._section(state.solution)
        return placed(section, self.problem.span_m, self.problem.reference_z_m, turn, strain)

    def fields(self, state: FemState) -> ModuleFields:
        """Displacement, stress, energy, volume ratio and stretch at the mesh's nodes."""
        mesh, x = self.problem.mesh, state.solution
        turn, strain = self._frame(x)
        shift = self.problem.span_m * x[: 3 * self._scalar.ndof].reshape(3, -1).T
        F = deformation_gradients(self.problem, self._scalar, shift, turn, strain)
        pressure = None
        if self.system.forms.mixed:
            unknowns = x[3 * self._scalar.ndof : self.system.fields]
            pressure = self.material.shear_modulus_pa * (self._pressures @ unknowns)[mesh.cells]
        return ModuleFields(
            points_m=mesh.nodes_m,
            displacement_m=self.deformed_nodes(state) - mesh.nodes_m,
            cells=mesh.cells,
            point_data=nodal_fields(self.material, F, pressure, mesh.cells),
        )

    def cavity_volume(self, state: FemState) -> float:
        """Volume (m³) of the whole module's cavity, of a problem under pressure."""
        return state.travel + self.problem.energy_scale * self._travel_at_rest

    def _solve(self, actuation: float, held: dict[str, float] | None, start: FemState) -> FemState:
        begun = time.perf_counter()
        places = dict(zip(self.problem.axes, self._places, strict=True))
        target = Target(
            actuation, {places[axis]: value / self._scale for axis, value in (held or {}).items()}
        )
        try:
            found = self.newton.advance(self._at(start.solution, start.actuation), target)
        except (DivergedError, SingularMatrixError) as error:
            unit = "Pa" if self.problem.actuation == "pressure_pa" else "N"
            size = "m" if self.problem.joint == "prismatic" else "rad"
            what = "free" if held is None else "constrained"
            at = "".join(f", {axis} = {value:.4g} {size}" for axis, value in (held or {}).items())
            raise StateNotConvergedError(
                f"no {what} equilibrium at {actuation:.6g} {unit}{at} from the state at "
                f"{start.actuation:.6g} {unit}, {start.angle_rad:.4g} {size}: {error}."
            ) from error
        self._known.append(found)
        return self._state(found, held, begun)

    def _at(self, x: Array, actuation: float) -> Equilibrium:
        """The equilibrium at x, condensed anew unless it is remembered."""
        if x.shape != (self.system.size,):
            raise UserError(
                f"the start state has {x.size} unknowns, this module {self.system.size}: it belongs to another mesh, "
                "order or backend."
            )
        for known in self._known:
            if known.point.actuation == actuation and np.array_equal(known.point.x, x):
                return known
        found = self.newton.at(x, actuation)
        self._known.append(found)
        return found

    def _state(self, found: Equilibrium, held: Mapping[str, float] | None, begun: float) -> FemState:
        """Piece to module: u = a g, Π_module = c Π_piece, hence τ = −(c/a) ∂Π_piece/∂g."""
        problem, point = self.problem, found.point
        scale, energy = self._scale, problem.energy_scale
        effort, by_actuation, by_number = self._condensed(found)
        _, strain = self._frame(point.x)
        return FemState(
            actuation=point.actuation,
            deformation=self._coordinates(point.x),
            tau=-energy / scale * effort,
            dtau_dp=energy / scale * by_actuation,
            dtau_du=-energy / scale**2 * by_number,
            energy_j=energy * point.energy_j,
            travel=energy * (point.travel - self._travel_at_rest),
            axial_strain=strain,
            branch="free" if held is None else "constrained",
            status="self_contact" if self._overlaps(point.x) else "ok",
            iterations=found.iterations,
            wall_s=time.perf_counter() - begun,
            main=problem.axes.index(problem.main_axis),
            held=tuple(held or ()),
            solution=point.x,
        )

    def _condensed(self, found: Equilibrium) -> tuple[Array, Array, Array]:
        """∂Π/∂g of the joint's coordinates, −∂²Π/∂g∂a and ∂²Π/∂g², the strain eliminated where it is none."""
        reduced, kept = found.reduced, self._places
        S, b = reduced.stiffness, reduced.actuation
        effort = found.point.residual[self.system.elimination.size :]
        other = [place for place in range(self.system.numbers) if place not in kept]
        own, rise = S[np.ix_(kept, kept)], b[kept]
        if other:
            shift = np.linalg.solve(
                S[np.ix_(other, other)], np.column_stack([S[np.ix_(other, kept)], b[other]])
            )
            coupling = S[np.ix_(kept, other)]
            own, rise = own - coupling @ shift[:, :-1], rise - coupling @ shift[:, -1]
        return effort[kept], rise, 0.5 * (own + own.T)

    def _coordinates(self, x: Array) -> Array:
        """u of the module, (k,)."""
        u: Array = self._scale * x[self.system.fields :][self._places]
        return u

    def _frame(self, x: Array) -> tuple[Array, float]:
        """Θ (3,) and e."""
        values = dict(zip(self.system.forms.globals_, x[self.system.fields :].tolist(), strict=True))
        return np.array([values.get(axis, 0.0) for axis in AXES]), values.get(STRAIN, 0.0)

    def _section(self, x: Array) -> Array:
        """Section coordinates (n, 3) of the mesh's nodes: s₁ and y, z."""
        nodes = self.problem.mesh.nodes_m
        shift = self.problem.span_m * x[: 3 * self._scalar.ndof].reshape(3, -1).T
        section: Array = nodes + self._table @ shift
        section[:, 0] += self._frame(x)[1] * nodes[:, 0]
        return section

    def _overlaps(self, x: Array) -> bool:
        """Whether skin nodes crossed a mirror plane that neighbouring convolutions share, or rigid parts meet."""
        if self.problem.contact_range is not None:
            low, high = self.problem.contact_range
            if not low <= self._coordinates(x)[self.problem.axes.index(self.problem.main_axis)] <= high:
                return True
        span, strain = self.problem.span_m, self._frame(x)[1]
        s = self._section(x)[np.unique(self.problem.mesh.skin), 0]
        beyond = {"start": -s.min(), "end": s.max() - (1 + strain) * span}
        return any(beyond[plane] > OVERLAP * span for plane in self.problem.contact_planes)


class Ngsolve(FEMBackend):
    """NGSolve: Taylor–Hood hexahedra of order 2 or 3, energies differentiated symbolically, sparse LDLᵀ."""

    config: NgsolveConfig

    def __init__(self, config: NgsolveConfig) -> None:
        super().__init__(config)

    def solver(self, problem: ModuleProblem, material: Material) -> NgsolveSolver:
        """Raises `UserError` for a frame, actuation, link or material that this backend does not know."""
        if problem.frame != "rod":
            raise UserError(f"fem 'ngsolve' solves frame 'rod' only, not '{problem.frame}'.")
        with ONE_AT_A_TIME:
            return NgsolveSolver(self.config, problem, material)
