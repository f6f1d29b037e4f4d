"""Structured 27-node hexahedra of a quarter of the flexure: x ∈ [0, c/2], y ∈ [0, w/2], the whole thickness."""

from __future__ import annotations

import numpy as np

from pliant.meshing.grids import block, grid_cells, grid_lines, module_sets, numbered
from pliant.meshing.hexahedra import boundary_faces
from pliant.records.design import Array
from pliant.records.fem import ModuleMesh
from pliant_plugins.families.tendon_joint.geometry import JointGeometry

ELEMENTS = (4, 3, 2)  # along x, y, z


def build_mesh(geometry: JointGeometry, refinement: int = 1) -> ModuleMesh:
    """The quarter; node sets `start` (x = 0), `end` (x = c/2), `symmetry` (y = 0), `pin` (the origin).

    Bonded corners are where strains change fastest: the cells at the link and at the free edge are the smaller.
    """
    t = geometry.flexure_thickness_m
    along, across, through = (refinement * n for n in ELEMENTS)
    nodes, ids = numbered(
        block(
            geometry.span_m * _graded(along),
            geometry.flexure_width_m / 2 * _graded(across),
            grid_lines((-t / 2, t / 2), through),
        )
    )
    cells = grid_cells(ids)
    skin, _ = boundary_faces(cells)
    sets = module_sets(nodes, geometry.span_m)
    return ModuleMesh(nodes, cells, np.empty((0, 9), np.int64), skin, sets)


def _graded(elements: int) -> Array:
    """Grid lines from 0 to 1, mid-nodes included, closer toward 1: s ↦ s (2 − s)."""
    ends = np.linspace(0, 1, elements + 1)
    return grid_lines(ends * (2 - ends), 1)
