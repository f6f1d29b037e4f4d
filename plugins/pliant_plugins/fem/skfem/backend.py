"""The default FEM backend: `Skfem` makes a `SkfemSolver` for each module."""

from __future__ import annotations

import time
from collections.abc import Mapping

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.fem import FEMBackend
from pliant.interfaces.material import Material
from pliant.records.design import Array
from pliant.records.fem import FemState, ModuleFields, ModuleProblem
from pliant.records.structure import StructureProblem
from pliant_plugins.fem.rod_solver import RodSolver
from pliant_plugins.fem.skfem.assembly import Assembler
from pliant_plugins.fem.skfem.condense import Control, slopes
from pliant_plugins.fem.skfem.config import SkfemConfig
from pliant_plugins.fem.skfem.fields import module_fields
from pliant_plugins.fem.skfem.kinematics import placed
from pliant_plugins.fem.skfem.linear import linear_solver
from pliant_plugins.fem.skfem.newton import Equilibrium, Newton
from pliant_plugins.fem.skfem.structure import SkfemStructure


class SkfemSolver(RodSolver):
    """States of one module in the rod frame.

    A state's `solution` is x: displacements (m) node by node, volumes and pressures of mixed cells, then the
    piece's active globals among Θ_x, Θ_y, Θ_z, e.
    """

    newton: Newton

    def __init__(self, config: SkfemConfig, problem: ModuleProblem, material: Material) -> None:
        super().__init__(problem)
        self.assembler = Assembler(problem, material, config.dilatation)
        self.linear = linear_solver(config.linear_solver, self.assembler.pattern)
        self.newton = Newton(self.assembler, self.linear, config)
        self._at_rest = self.assembler.travel(np.zeros(self.assembler.count)).value

    def deformed_nodes(self, state: FemState) -> Array:
        """(n, 3) node positions in m; the start section stays at rest."""
        k, _ = self.assembler.globals.curvature(state.solution)
        return placed(self._section(state.solution), k, self.problem.reference_z_m)

    def fields(self, state: FemState) -> ModuleFields:
        """Displacement, Cauchy stress and stretch at the nodes."""
        return module_fields(self.assembler, state.solution, self.deformed_nodes(state))

    def cavity_volume(self, state: FemState) -> float:
        """Volume (m³) of the whole module's cavity."""
        return self.problem.energy_scale * self.assembler.cavity(state.solution).value

    def _undeformed(self) -> Array:
        return np.zeros(self.assembler.count)

    def _target(self, actuation: float, held: Mapping[str, float]) -> Control:
        """The module's coordinates as the piece's globals."""
        g = self.assembler.globals
        mask, goal = np.zeros(g.count, bool), np.zeros(g.count)
        for axis, place, scale in zip(g.axes, g.places, g.scales, strict=True):
            if axis in held:
                mask[place], goal[place] = True, held[axis] / scale
        return Control(actuation, mask, goal, np.zeros(g.count))

    def _state(self, equilibrium: Equilibrium, held: tuple[str, ...], begun: float) -> FemState:
        """Piece to module: u = c q, Π_module = E Π_piece, hence τ = −(E/c) ∂Π_piece/∂q."""
        point, g, energy = equilibrium.point, self.assembler.globals, self.problem.energy_scale
        by_actuation, by_axes = slopes(equilibrium.reduced, g.places)
        places, scales = list(g.places), np.array(g.scales)
        return FemState(
            actuation=point.actuation,
            deformation=self._coordinates(point.x),
            tau=energy / scales * point.effort[places],
            dtau_dp=energy / scales * by_actuation,
            dtau_du=energy / np.outer(scales, scales) * by_axes,
            energy_j=energy * point.energy.value,
            travel=energy * (point.travel.value - self._at_rest),
            axial_strain=self._frame(point.x)[1],
            branch="constrained" if held else "free",
            status="self_contact" if self._overlaps(point.x) else "ok",
            iterations=equilibrium.iterations,
            wall_s=time.perf_counter() - begun,
            main=g.axes.index(self.problem.main_axis),
            held=held,
            solution=point.x,
        )

    def _coordinates(self, x: Array) -> Array:
        g = self.assembler.globals
        return np.asarray(np.array(g.scales) * x[-g.count :][list(g.places)])

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
