"""Structured 27-node hexahedra of a quarter of the chamber: x ∈ [0, l/2], y ∈ [0, w/2]."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pliant.meshing.grids import block, carved, grid_cells, grid_lines, module_sets, numbered
from pliant.meshing.hexahedra import CENTRE, boundary_faces
from pliant.records.design import Array
from pliant.records.fem import ModuleMesh
from pliant_plugins.families.pneunet.geometry import ChamberGeometry

LAYER = "layer"
# Elements between neighbouring lines: chamber, wall, half a gap; channel, chamber, shell; layer … top.
ALONG, ACROSS, UPWARD = (2, 1, 1), (1, 2, 1), (1, 1, 1, 1, 3, 1)


def build_mesh(geometry: ChamberGeometry, refinement: int = 1) -> ModuleMesh:
    """The quarter with its layer as a region; `pin` is the corner above the layer at x = y = 0."""
    x, y, z = geometry.x_lines, geometry.y_lines, geometry.z_lines
    counted = ((x, ALONG), (y, ACROSS), (z, UPWARD))
    nodes, ids = numbered(block(*(_lines(ends, counts, refinement) for ends, counts in counted)))
    cells = grid_cells(ids)

    # between the chambers of neighbouring modules there is air
    cx, _, cz = nodes[cells[:, CENTRE]].T
    nodes, cells, _ = carved(nodes, cells, (cx > x[2]) & (cz > z[4]))
    cx, cy, cz = nodes[cells[:, CENTRE]].T
    chamber = (cx < x[1]) & (cy < y[2]) & (cz > z[2]) & (cz < z[5])
    channel = (cx > x[1]) & (cy < y[1]) & (cz > z[2]) & (cz < z[3])
    nodes, cells, cavity = carved(nodes, cells, chamber | channel)

    skin, _ = boundary_faces(cells)
    sets = module_sets(nodes, geometry.module_length_m / 2, (0.0, 0.0, geometry.layer_m / 2))
    regions = {LAYER: np.flatnonzero(nodes[cells[:, CENTRE], 2] < z[1])}
    return ModuleMesh(nodes, cells, cavity, skin, sets, regions)


def _lines(ends: Sequence[float], counts: Sequence[int], refinement: int) -> Array:
    pieces = [grid_lines(ends[i : i + 2], refinement * count) for i, count in enumerate(counts)]
    return np.concatenate([*(piece[:-1] for piece in pieces), pieces[-1][-1:]])
