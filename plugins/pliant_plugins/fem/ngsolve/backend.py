"""The second FEM backend: `Ngsolve` makes an `NgsolveSolver` for each module."""

from __future__ import annotations

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.fem import FEMBackend
from pliant.interfaces.material import Material
from pliant.meshing.hexahedra import cell_volumes
from pliant.records.design import Array
from pliant.records.fem import FemState, ModuleFields, ModuleProblem
from pliant_plugins.fem.config import NgsolveConfig
from pliant_plugins.fem.newton import Newton, Tolerance
from pliant_plugins.fem.ngsolve.constraints import eliminate
from pliant_plugins.fem.ngsolve.fields import deformation_gradients, nodal_fields
from pliant_plugins.fem.ngsolve.forms import AXES, STRAIN, build_forms
from pliant_plugins.fem.ngsolve.library import ngs
from pliant_plugins.fem.ngsolve.mesh import curved_mesh, nodal_table
from pliant_plugins.fem.ngsolve.system import ONE_AT_A_TIME, System
from pliant_plugins.fem.rod_solver import RodSolver


class NgsolveSolver(RodSolver):
    """States of one module in the rod frame.

    A state's `solution` is (v/span, q/μ, numbers): NGSolve's hierarchical unknowns of displacement and pressure, then
    the components of Θ that are axes, and e.
    """

    remembered = 6

    def __init__(self, config: NgsolveConfig, problem: ModuleProblem, material: Material) -> None:
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
        tolerance = Tolerance(
            unit, config.tolerance, config.max_iterations, config.max_halvings, 0.1, 1 / 16, 1.0
        )
        self._table = nodal_table(scalar, problem.mesh)
        self._scalar = scalar
        self._pressures = nodal_table(ngs.H1(mesh, order=config.order - 1), problem.mesh)
        prismatic = problem.joint == "prismatic"
        names = (STRAIN,) if prismatic else problem.axes
        scale = problem.deformation_scale * (problem.span_m if prismatic else 1.0)
        places = tuple(forms.globals_.index(name) for name in names)
        super().__init__(problem, Newton(self.system, tolerance), places, (scale,) * len(names))

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
        return np.zeros(self.system.size)

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
