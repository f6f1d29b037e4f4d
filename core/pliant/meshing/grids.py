"""Structured grids of 27-node hexahedra: node positions [i, j, k] with two intervals per element → cells and faces.

A family builds its mesh from positions on a grid by `numbered`, `grid_cells`, `grid_faces` for the wetted layer (or
`carved` for a hollow in a block), `boundary_faces` for the skin, and `module_sets`. Adjacent grids share nodes by
sharing ids.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pliant.meshing.hexahedra import FACE_CENTRE, FACES, boundary_faces
from pliant.records.design import Array
from pliant.records.fem import IntArray


def grid_lines(ends: Sequence[float] | Array, elements: int | Sequence[int]) -> Array:
    """Return coordinates of grid lines, two intervals per element, between neighbouring ends, kept exactly.

    Args:
        ends: (n + 1,) coordinates.
        elements: number between all neighbours, or (n,) between each two.
    """
    counts = [elements] * (len(ends) - 1) if isinstance(elements, int) else elements
    pieces = [
        np.linspace(a, b, 2 * count + 1)[:-1] for (a, b), count in zip(pairwise(ends), counts, strict=True)
    ]
    return np.append(np.concatenate(pieces), ends[-1])


def block(x: Array, y: Array, z: Array) -> Array:
    """Return positions [i, j, k, 3] of the grid with these lines."""
    return np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1)


def numbered(positions: Array) -> tuple[Array, IntArray]:
    """Convert positions [i, j, k, 3] to nodes (n, 3) and their ids [i, j, k]."""
    shape = positions.shape[:-1]
    return positions.reshape(-1, 3), np.arange(np.prod(shape), dtype=np.int64).reshape(shape)


def grid_cells(ids: IntArray) -> IntArray:
    """Return cells (m, 27) of node ids [i, j, k], ξ along i, η along j, ζ along k.

    The three directions must be right-handed in space; otherwise reverse one (`ids[:, ::-1]`) or swap two.
    """
    windows = np.lib.stride_tricks.sliding_window_view(ids, (3, 3, 3))[::2, ::2, ::2]
    return np.ascontiguousarray(windows.transpose(0, 1, 2, 5, 4, 3)).reshape(-1, 27)


def grid_faces(ids: IntArray) -> IntArray:
    """Return faces (f, 9) of a layer of node ids [i, j], a along i, b along j; `ids.T` reverses the normals."""
    windows = np.lib.stride_tricks.sliding_window_view(ids, (3, 3))[::2, ::2]
    return np.ascontiguousarray(windows.transpose(0, 1, 3, 2)).reshape(-1, 9)


def carved(nodes_m: Array, cells: IntArray, hollow: NDArray[np.bool_]) -> tuple[Array, IntArray, IntArray]:
    """Return a body without its cells `hollow` (m,): remaining nodes and cells, and the exposed faces (f, 9).

    The faces' normals point out of the remaining body into the hollow, as for a cavity.
    """
    left = cells[~hollow]
    skin, _ = boundary_faces(left)
    bare = skin[np.isin(skin[:, FACE_CENTRE], cells[hollow][:, FACES[:, FACE_CENTRE]])]
    used = np.unique(left)
    return nodes_m[used], np.searchsorted(used, left), np.searchsorted(used, bare)


def carved_cavities(
    nodes_m: Array, cells: IntArray, hollows: Mapping[str, NDArray[np.bool_]]
) -> tuple[Array, IntArray, dict[str, IntArray]]:
    """Return `carved` for several hollows: remaining nodes and cells, and faces (f, 9) of each hollow by name."""
    nodes, left, bare = carved(nodes_m, cells, np.any([*hollows.values()], axis=0))
    used = np.unique(cells[~np.any([*hollows.values()], axis=0)])
    cavities = {}
    for name, hollow in hollows.items():
        centres = cells[hollow][:, FACES[:, FACE_CENTRE]]
        cavities[name] = bare[np.isin(used[bare[:, FACE_CENTRE]], centres)]
    return nodes, left, cavities


def module_sets(
    nodes_m: Array, span_m: float, pin_m: Sequence[float] = (0.0, 0.0, 0.0)
) -> dict[str, IntArray]:
    """Return the node sets of a piece: `start` (x = 0), `end` (x = span), `symmetry` (y = 0), `pin` (node at a point).

    Nodes within 1e-9 of the span are on a plane or at the point.
    """
    x, y, _ = nodes_m.T
    distances = {
        "start": np.abs(x),
        "end": np.abs(x - span_m),
        "symmetry": np.abs(y),
        "pin": np.linalg.norm(nodes_m - np.asarray(pin_m), axis=1),
    }
    return {name: np.flatnonzero(distance < 1e-9 * span_m) for name, distance in distances.items()}
