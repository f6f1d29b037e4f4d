"""Fields at the nodes of a solved piece: Gauss-point values fitted trilinearly in each cell, averaged at nodes."""

from __future__ import annotations

import numpy as np
from skfem import ElementHex1, ElementHex2

from pliant.records.design import Array
from pliant.records.fem import ModuleFields
from pliant_plugins.fem.rod_solver import field_values
from pliant_plugins.fem.skfem.assembly import Assembler


def module_fields(assembler: Assembler, x: Array, placed_m: Array) -> ModuleFields:
    """Displacement to `placed_m` (n, 3), Cauchy stress and stretch at x.

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
    """(n,) at nodes from (m, q) at quadrature points."""
    cells, count = assembler.cells, len(assembler.problem.mesh.nodes_m)
    at_nodes = ElementHex2().doflocs
    at_points = cells.value @ at_nodes
    local = values @ (_trilinear(at_nodes) @ np.linalg.pinv(_trilinear(at_points))).T
    nodes = cells.nodes.ravel()
    totals = np.bincount(nodes, local.ravel(), count)
    return totals / np.bincount(nodes, minlength=count)


def _trilinear(points: Array) -> Array:
    """(n, 8) functions at reference points (n, 3)."""
    element = ElementHex1()
    return np.stack([element.lbasis(points.T, i)[0] for i in range(8)], axis=-1)
