"""Conversion of cells of files and meshers to quadratic cells: midpoint nodes are added and nodes reordered.

Names of cells and node orders are VTK's, which meshio provides for every file format.
"""

from __future__ import annotations

import numpy as np

from pliant.meshing import tetrahedra
from pliant.records.design import Array
from pliant.records.fem import IntArray

# Lattice places (i, j, k)/2 of VTK's 27-node hexahedron: corners, edges, faces, middle.
HEX_CORNERS = ((0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2))
HEX_EDGES = (
    (1, 0, 0), (2, 1, 0), (1, 2, 0), (0, 1, 0), (1, 0, 2), (2, 1, 2), (1, 2, 2), (0, 1, 2),
    (0, 0, 1), (2, 0, 1), (2, 2, 1), (0, 2, 1),
)  # fmt: skip
HEX_FACES = ((0, 1, 1), (2, 1, 1), (1, 0, 1), (1, 2, 1), (1, 1, 0), (1, 1, 2))
# Lexicographic index of each of VTK's 27 nodes.
VTK_ORDER: IntArray = np.array([*HEX_CORNERS, *HEX_EDGES, *HEX_FACES, (1, 1, 1)], np.int64) @ np.array(
    [1, 3, 9]
)
# Number of nodes of each supported kind of solid cell.
SOLID = {"tetra": 4, "tetra10": 10, "hexahedron": 8, "hexahedron20": 20, "hexahedron27": 27}


def as_quadratic(nodes_m: Array, kind: str, cells: IntArray) -> tuple[Array, IntArray]:
    """Return nodes (the given ones first) and cells (m, 10) or (m, 27) from cells of one of the kinds of `SOLID`.

    First-order cells keep straight edges; the face centres of a 20-node cell follow from its shape functions.
    """
    if kind == "tetra":
        return tetrahedra.raised(nodes_m, cells)
    if kind == "tetra10":
        return nodes_m, cells
    given = SOLID[kind]
    lexicographic: IntArray = np.full((len(cells), 27), -1, np.int64)
    lexicographic[:, VTK_ORDER[:given]] = cells
    missing = VTK_ORDER[given:]
    if not len(missing):
        return nodes_m, lexicographic
    keys = _keys(lexicographic[:, VTK_ORDER[:8]], missing)
    unique, first, number = np.unique(
        keys.reshape(-1, keys.shape[-1]), axis=0, return_index=True, return_inverse=True
    )
    places = _weights(given)[missing] @ nodes_m[cells]  # (m, missing, 3)
    lexicographic[:, missing] = len(nodes_m) + number.reshape(len(cells), len(missing))
    return np.vstack([nodes_m, places.reshape(-1, 3)[first][: len(unique)]]), lexicographic


def _keys(corners: IntArray, missing: IntArray) -> IntArray:
    """Return (m, missing, 8) ids of the corners around each missing node, ascending, with leading −1."""
    lattice = np.array(HEX_CORNERS)
    keys = np.full((len(corners), len(missing), 8), -1, np.int64)
    for column, place in enumerate(missing.tolist()):
        at = np.array([place % 3, place // 3 % 3, place // 9])
        around = np.all((at == 1) | (lattice == at), axis=1)
        keys[:, column, 8 - around.sum() :] = np.sort(corners[:, around], axis=1)
    return keys


def _weights(given: int) -> Array:
    """Return (27, given) values of a cell's shape functions (8 or 20 nodes, VTK's order) at the lattice's nodes."""
    lattice = np.array([(i, j, k) for k in range(3) for j in range(3) for i in range(3)]) / 2 * 2 - 1.0
    corners, edges = np.array(HEX_CORNERS) - 1.0, np.array(HEX_EDGES) - 1.0
    linear = np.prod(1 + lattice[:, None] * corners, axis=-1) / 8
    if given == 8:
        return np.asarray(linear)
    middle = (
        np.prod(np.where(edges == 0, 1 - lattice[:, None] ** 2, 1 + lattice[:, None] * edges), axis=-1) / 4
    )
    ends = np.all((edges[:, None] == corners) | (edges[:, None] == 0), axis=-1)  # (12, 8)
    return np.hstack([linear - middle @ ends / 2, middle])


def mirrored_y(nodes_m: Array, cells: IntArray) -> tuple[Array, IntArray]:
    """Return the mirror image in y = 0, cells still right-handed."""
    return nodes_m * np.array([1.0, -1.0, 1.0]), other_handed(cells)


def other_handed(cells: IntArray) -> IntArray:
    """Return the same cells (m, 10) or (m, 27) with the opposite orientation."""
    if cells.shape[1] == 10:
        return cells[:, [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]]
    return cells[:, np.arange(27).reshape(3, 3, 3)[:, :, ::-1].ravel()]
