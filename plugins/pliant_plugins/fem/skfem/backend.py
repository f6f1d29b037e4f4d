"""The default FEM backend: `Skfem` makes a `SkfemSolver` for each module."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.fem import FEMBackend
from pliant.interfaces.material import Material, require_regions
from pliant.records.actuation import Levels, actuation_kind
from pliant.records.design import Array
from pliant.records.fem import FemState, ModuleFields, ModuleProblem
from pliant.records.structure import StructureProblem
from pliant_plugins.fem.config import SkfemConfig
from pliant_plugins.fem.iteration import SingularMatrixError, Tolerance
from pliant_plugins.fem.newton import Control, Newton, PathPoint, Reduced
from pliant_plugins.fem.rod_solver import RodSolver, Touch, field_values
from pliant_plugins.fem.skfem.assembly import Assembler
from pliant_plugins.fem.skfem.basis import mesh_element
from pliant_plugins.fem.skfem.linear import WideningSolver
from pliant_plugins.fem.skfem.pattern import Terms

if TYPE_CHECKING:
    from pliant_plugins.fem.skfem.structure import SkfemStructure


@dataclass(frozen=True, eq=False)
class ModuleSystem:
    """One assembled problem and the solver of its matrix."""

    assembler: Assembler
    linear: WideningSolver

    @cached_property
    def count(self) -> int:
        """Number G of the active globals."""
        return self.assembler.globals.count

    def evaluate(self, x: Array, actuation: Levels) -> PathPoint[Terms] | None:
        """Return U to first and W to second order at x; None if a cell is inverted."""
        if not (np.all(np.isfinite(x)) and self.assembler.globals.split(x)[1] > -1):
            return None
        energy = self.assembler.elastic_energy(x, second=False)
        return None if energy is None else PathPoint(x, actuation, energy, self.assembler.travels(x))

    def reduce(self, point: PathPoint[Terms]) -> Reduced:
        """Factorise and condense. Raises `SingularMatrixError`."""
        potential, G = self.assembler.elastic_energy(point.x), self.count
        assert potential is not None  # the point's slope exists
        for level, travel in zip(np.atleast_1d(point.actuation).tolist(), point.travels, strict=True):
            potential = potential.plus(-level, travel)
        works = [travel.gradient for travel in point.travels]
        columns = np.column_stack([potential.gradient, potential.border, *works])
        reduced = self.assembler.pattern.reduce(columns[:-G])
        solved = self.linear.solve(potential.matrix, reduced, potential.coupling)
        if not np.all(np.isfinite(solved)):
            raise SingularMatrixError("the tangent stiffness is singular")
        full = columns[-G:] - reduced[:, 1 : 1 + G].T @ solved
        return Reduced.from_condensed(solved, full, G)

    def again(self, point: PathPoint[Terms]) -> tuple[Array, Array]:
        """Return (r_v, K⁻¹ r_v) with the matrix that was factorised last."""
        right = self.assembler.pattern.reduce(point.residual[: -self.count])
        return right, self.linear.again(right[:, None])[:, 0]

    def step(self, inner: Array, globals_: Array) -> Array:
        """Return the change of x."""
        return np.concatenate([self.assembler.pattern.expand(inner), globals_])

    def work(self, point: PathPoint[Terms], step: tuple[Array, Array], control: Control) -> float:
        """Return |residual · step| over the unknowns; multipliers count with the other sign."""
        residual, G = point.residual, self.count
        residual[-G:] = np.where(control.held, 0.0, residual[-G:] + control.effort)
        residual[self.assembler.pressures] *= -1
        return abs(float(residual @ self.step(*step)))


def module_fields(assembler: Assembler, x: Array, placed_m: Array) -> ModuleFields:
    """Return displacement to `placed_m` (n, 3), Cauchy stress and stretch at x.

    `hydrostatic_pa` is the mean normal stress, positive in tension; `energy_j_m3` per reference volume;
    `volume_ratio` that of the mixed element, ϑ, where it is one.
    """
    mesh = assembler.problem.mesh
    F, energy, P = assembler.at_points(x)
    J, volume = np.linalg.det(F), assembler.volume_ratio(x)
    stress = P @ np.swapaxes(F, -1, -2) / J[..., None, None]
    values = field_values(F, stress, energy, J if volume is None else volume)
    return ModuleFields(
        points_m=mesh.nodes_m,
        displacement_m=placed_m - mesh.nodes_m,
        cells=mesh.cells,
        point_data={name: at_nodes(assembler, value) for name, value in values.items()},
    )


def at_nodes(assembler: Assembler, values: Array) -> Array:
    """Return (n,) values at nodes from (m, q) values at quadrature points."""
    cells, count = assembler.cells, len(assembler.problem.mesh.nodes_m)
    of = mesh_element(assembler.problem.mesh.cells)
    at_nodes = of.solid.doflocs
    at_points = cells.value @ at_nodes
    local = values @ (of.linear(at_nodes) @ np.linalg.pinv(of.linear(at_points))).T
    nodes = cells.nodes.ravel()
    totals = np.bincount(nodes, local.ravel(), count)
    return totals / np.bincount(nodes, minlength=count)


class SkfemSolver(RodSolver):
    """States of one module in the rod frame.

    A state's `solution` is x: displacements (m) node by node, volumes and pressures of mixed cells, then the
    piece's active globals among Θ_x, Θ_y, Θ_z, e.
    """

    def __init__(self, config: SkfemConfig, problem: ModuleProblem, material: Material) -> None:
        self.assembler = Assembler(
            problem, material, config.dilatation, contact=config.self_contact == "solve"
        )
        self.linear = WideningSolver(config.linear_solver, self.assembler.pattern)
        # a uniform shear of 1 stores this much: the natural scale of a correction's work
        unit = float(material.evaluate(np.eye(3)).tangent[0, 1, 0, 1] * self.assembler.volume_m3)
        tolerance = Tolerance(unit, config.tolerance, config.max_iterations, config.max_halvings)
        g = self.assembler.globals
        newton = Newton(ModuleSystem(self.assembler, self.linear), tolerance)
        super().__init__(problem, newton, g.places, g.scales)

    def fields(self, state: FemState) -> ModuleFields:
        """Return displacement, Cauchy stress and stretch at the nodes."""
        return module_fields(self.assembler, state.solution, self.deformed_nodes(state))

    def cavity_volume(self, state: FemState) -> float:
        """Return volume (m³) of the whole module's cavities."""
        places = range(len(self.assembler.faces))
        volumes = [self.assembler.cavity(state.solution, place).value for place in places]
        return self.problem.energy_scale * float(sum(volumes))

    def _touching(self, x: Array) -> Touch | None:
        contacts = self.assembler.contacts
        if contacts is None:
            return None
        from pliant_plugins.fem.skfem.contact import DEEPEST
        from pliant_plugins.fem.skfem.stops import edges

        turn, strain = self._frame(x)
        beyond = [depth / contacts.skin.wall_m for depth, _, _ in edges(self.problem, turn, strain)]
        share = max(contacts.deepest(x, strain), *beyond, 0.0)
        return "free" if share == 0 else "solved" if share <= DEEPEST else "deep"

    def _undeformed(self) -> Array:
        return np.zeros(self.assembler.count)

    def _frame(self, x: Array) -> tuple[Array, float]:
        return self.assembler.globals.split(x)

    def _section(self, x: Array) -> Array:
        section = self.assembler.positions(x)
        section[:, 0] += self._frame(x)[1] * self.problem.mesh.nodes_m[:, 0]
        return section


def _check_driven(problem: ModuleProblem) -> None:
    """Raise `UserError` for what drives the module and is neither a pressure in a cavity nor the tendon."""
    names = problem.actuations
    for name in names:
        kind = actuation_kind(name).name
        if kind not in ("pressure_pa", "tendon_force_n"):
            raise UserError(
                f"fem 'skfem' solves modules driven by 'pressure_pa' or 'tendon_force_n', not '{name}'."
            )
        if kind == "tendon_force_n" and problem.tendon is None:
            raise UserError(f"a module driven by '{name}' needs its tendon; the problem has none.")
        if kind == "pressure_pa" and len(names) > 1 and name not in problem.mesh.cavities:
            known = ", ".join(problem.mesh.cavities) or "none"
            raise UserError(f"the module has no cavity for '{name}'; its mesh names the cavities {known}.")
    if sum(actuation_kind(name).name == "tendon_force_n" for name in names) > 1:
        raise UserError(f"fem 'skfem' solves modules of one tendon, and this one has {problem.actuation}.")


class Skfem(FEMBackend):
    """scikit-fem with a direct solver: rod-frame problems under pressure or by tendon."""

    config: SkfemConfig
    knows = frozenset(
        [
            "regions",
            "fibres",
            "tetrahedra",
            "ribbons",
            "tendon",
            "links",
            "ties",
            "contact",
            "several_actuations",
        ]
    )

    def solver(self, problem: ModuleProblem, material: Material) -> SkfemSolver:
        """Return the solver. Raises `UserError` for a frame, actuation or requirement that it does not support."""
        self.check(problem, material)
        if problem.frame != "rod":
            raise UserError(f"fem 'skfem' solves frame 'rod' only, not '{problem.frame}'.")
        _check_driven(problem)
        return SkfemSolver(self.config, problem, material)

    def structure(self, problem: StructureProblem, material: Material) -> SkfemStructure:
        """Return a solver for a body of several modules."""
        from pliant_plugins.fem.skfem.structure import SkfemStructure

        require_regions(problem.mesh.regions, material.regions)
        return SkfemStructure(self.config, problem, material)
