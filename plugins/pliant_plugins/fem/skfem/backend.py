"""The default FEM backend: `Skfem` makes a `SkfemSolver` for each module."""

from __future__ import annotations

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.fem import FEMBackend
from pliant.interfaces.material import Material
from pliant.records.design import Array
from pliant.records.fem import FemState, ModuleFields, ModuleProblem
from pliant.records.structure import StructureProblem
from pliant_plugins.fem.config import SkfemConfig
from pliant_plugins.fem.newton import Newton, Tolerance
from pliant_plugins.fem.rod_solver import RodSolver
from pliant_plugins.fem.skfem.assembly import Assembler
from pliant_plugins.fem.skfem.fields import module_fields
from pliant_plugins.fem.skfem.linear import linear_solver
from pliant_plugins.fem.skfem.structure import SkfemStructure
from pliant_plugins.fem.skfem.system import ModuleSystem


class SkfemSolver(RodSolver):
    """States of one module in the rod frame.

    A state's `solution` is x: displacements (m) node by node, volumes and pressures of mixed cells, then the
    piece's active globals among Θ_x, Θ_y, Θ_z, e.
    """

    def __init__(self, config: SkfemConfig, problem: ModuleProblem, material: Material) -> None:
        self.assembler = Assembler(problem, material, config.dilatation)
        self.linear = linear_solver(config.linear_solver, self.assembler.pattern)
        # a uniform shear of 1 stores this much: the natural scale of a correction's work
        unit = float(material.evaluate(np.eye(3)).tangent[0, 1, 0, 1] * self.assembler.volume_m3)
        tolerance = Tolerance(unit, config.tolerance, config.max_iterations, config.max_halvings)
        g = self.assembler.globals
        newton = Newton(ModuleSystem(self.assembler, self.linear), tolerance)
        super().__init__(problem, newton, g.places, g.scales)

    def fields(self, state: FemState) -> ModuleFields:
        """Displacement, Cauchy stress and stretch at the nodes."""
        return module_fields(self.assembler, state.solution, self.deformed_nodes(state))

    def cavity_volume(self, state: FemState) -> float:
        """Volume (m³) of the whole module's cavity."""
        return self.problem.energy_scale * self.assembler.cavity(state.solution).value

    def _undeformed(self) -> Array:
        return np.zeros(self.assembler.count)

    def _frame(self, x: Array) -> tuple[Array, float]:
        return self.assembler.globals.split(x)

    def _section(self, x: Array) -> Array:
        section = self.assembler.positions(x)
        section[:, 0] += self._frame(x)[1] * self.problem.mesh.nodes_m[:, 0]
        return section


class Skfem(FEMBackend):
    """scikit-fem with a direct solver: rod-frame problems under pressure or by tendon."""

    config: SkfemConfig

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
