"""The second FEM backend: `Ngsolve` makes an `NgsolveSolver` for each module."""

from __future__ import annotations

import time
from collections.abc import Mapping

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.fem import FEMBackend
from pliant.interfaces.material import Material
from pliant.meshing.hexahedra import cell_volumes
from pliant.records.design import Array
from pliant.records.fem import FemState, ModuleFields, ModuleProblem
from pliant_plugins.fem.newton import Tolerance
from pliant_plugins.fem.ngsolve.config import NgsolveConfig
from pliant_plugins.fem.ngsolve.constraints import eliminate
from pliant_plugins.fem.ngsolve.fields import deformation_gradients, nodal_fields
from pliant_plugins.fem.ngsolve.forms import AXES, STRAIN, build_forms
from pliant_plugins.fem.ngsolve.library import ngs
from pliant_plugins.fem.ngsolve.mesh import curved_mesh, nodal_table, placed
from pliant_plugins.fem.ngsolve.newton import Equilibrium, Newton, Target
from pliant_plugins.fem.ngsolve.system import ONE_AT_A_TIME, System
from pliant_plugins.fem.rod_solver import RodSolver


class NgsolveSolver(RodSolver):
    """States of one module in the rod frame.

    A state's `solution` is (v/span, q/μ, numbers): NGSolve's hierarchical unknowns of displacement and pressure, then
    the components of Θ that are axes, and e.
    """

    remembered = 6
    newton: Newton

    def __init__(self, config: NgsolveConfig, problem: ModuleProblem, material: Material) -> None:
        super().__init__(problem)
        self.material = material
        mesh = curved_mesh(problem.mesh)
        forms = build_forms(mesh, problem, material, config.order)
        scalar = ngs.H1(mesh, order=config.order)
        self.system = System(
            forms,
            eliminate(problem, scalar, forms.space.ndof - len(forms.globals_)),
            config.threads,
        )
        volume = float(cell_volumes(problem.mesh.nodes_m, problem.mesh.cells).sum())
        unit = material.shear_modulus_pa * volume
        tolerance = Tolerance(unit, config.tolerance, config.max_iterations, config.max_halvings)
        self.newton = Newton(self.system, tolerance)
        self._table = nodal_table(scalar, problem.mesh)
        self._scalar = scalar
        self._pressures = nodal_table(ngs.H1(mesh, order=config.order - 1), problem.mesh)
        # places of the joint's coordinates among the numbers, and u per number
        prismatic = problem.joint == "prismatic"
        names = (STRAIN,) if prismatic else problem.axes
        self._places = [forms.globals_.index(name) for name in names]
        self._scale = problem.deformation_scale * (problem.span_m if prismatic else 1.0)
        self._travel_at_rest = self._at(self._undeformed(), 0.0).point.travel

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

    def _undeformed(self) -> Array:
        return self.system.start()

    def _target(self, actuation: float, held: Mapping[str, float]) -> Target:
        places = dict(zip(self.problem.axes, self._places, strict=True))
        return Target(actuation, {places[axis]: value / self._scale for axis, value in held.items()})

    def _state(self, equilibrium: Equilibrium, held: tuple[str, ...], begun: float) -> FemState:
        """Piece to module: u = a g, Π_module = c Π_piece, hence τ = −(c/a) ∂Π_piece/∂g."""
        problem, point = self.problem, equilibrium.point
        scale, energy = self._scale, problem.energy_scale
        effort, by_actuation, by_number = self._condensed(equilibrium)
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
            branch="constrained" if held else "free",
            status="self_contact" if self._overlaps(point.x) else "ok",
            iterations=equilibrium.iterations,
            wall_s=time.perf_counter() - begun,
            main=problem.axes.index(problem.main_axis),
            held=held,
            solution=point.x,
        )

    def _condensed(self, equilibrium: Equilibrium) -> tuple[Array, Array, Array]:
        """∂Π/∂g of the joint's coordinates, −∂²Π/∂g∂a and ∂²Π/∂g², the strain eliminated where it is none."""
        reduced, kept = equilibrium.reduced, self._places
        S, b = reduced.stiffness, reduced.actuation
        effort = equilibrium.point.residual[self.system.elimination.size :]
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
        return np.asarray(self._scale * x[self.system.fields :][self._places])

    def _frame(self, x: Array) -> tuple[Array, float]:
        values = dict(zip(self.system.forms.globals_, x[self.system.fields :].tolist(), strict=True))
        return np.array([values.get(axis, 0.0) for axis in AXES]), values.get(STRAIN, 0.0)

    def _section(self, x: Array) -> Array:
        nodes = self.problem.mesh.nodes_m
        shift = self.problem.span_m * x[: 3 * self._scalar.ndof].reshape(3, -1).T
        section: Array = nodes + self._table @ shift
        section[:, 0] += self._frame(x)[1] * nodes[:, 0]
        return section


class Ngsolve(FEMBackend):
    """NGSolve: Taylor–Hood hexahedra of order 2 or 3, energies differentiated symbolically, sparse LDLᵀ."""

    config: NgsolveConfig

    def solver(self, problem: ModuleProblem, material: Material) -> NgsolveSolver:
        """Raises `UserError` for a frame, actuation, link or material that this backend does not know."""
        if problem.frame != "rod":
            raise UserError(f"fem 'ngsolve' solves frame 'rod' only, not '{problem.frame}'.")
        with ONE_AT_A_TIME:
            return NgsolveSolver(self.config, problem, material)
