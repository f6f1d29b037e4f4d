"""Structured 27-node hexahedra of x ∈ [0, l/2], y ≥ 0: a grid along the tube, around it and through its wall.

At angle φ from the bottom the wall's line runs straight from the bore's circle (a sin φ, d − a cos φ) to the tube's
(R sin φ, −R cos φ); nodes lie on both circles, so quadratic faces follow them to fourth order.
"""

from __future__ import annotations

import numpy as np

from pliant.meshing.grids import grid_cells, grid_faces, module_sets, numbered
from pliant.meshing.hexahedra import boundary_faces
from pliant.records.design import Array
from pliant.records.fem import ModuleMesh
from pliant_eccentric_tube.section import Section

AROUND, WALL, ALONG = 8, 2, 1


def build_mesh(section: Section, half_length_m: float, refinement: int = 1) -> ModuleMesh:
    """Build the mesh of half a module. Node sets: `start`, `end`, `symmetry` (y = 0), `pin` (bottom of the start)."""
    nodes, ids = numbered(_grid(section, half_length_m, refinement))  # [along, around, outward]
    # at the bottom x, −z, y, which is right-handed: along, outward, around
    cells = grid_cells(ids.transpose(0, 2, 1))
    bore = grid_faces(ids[:, :, 0])
    skin, _ = boundary_faces(cells)
    pin = (0.0, 0.0, -section.outer_m)
    return ModuleMesh(nodes, cells, bore, skin, module_sets(nodes, half_length_m, pin))


def _grid(section: Section, half_length_m: float, refinement: int) -> Array:
    """Return node positions [along, around, outward, 3]."""
    x = np.linspace(0.0, half_length_m, 2 * ALONG * refinement + 1)
    phi = np.linspace(0.0, np.pi, 2 * AROUND * refinement + 1)
    depth = np.linspace(0.0, 1.0, 2 * WALL * refinement + 1)[:, None]
    around = np.stack([np.sin(phi), -np.cos(phi)], axis=1)
    around[-1, 0] = 0.0  # sin π leaves rounding on the mirror plane
    inner = section.bore_m * around + np.array([0.0, section.offset_m])
    outer = section.outer_m * around
    wall = (1 - depth) * inner[:, None] + depth * outer[:, None]
    nodes = np.empty((len(x), *wall.shape[:2], 3))
    nodes[..., 0] = x[:, None, None]
    nodes[..., 1:] = wall
    return nodes
