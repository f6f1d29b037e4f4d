"""Structured grids of 27-node hexahedra: node positions [i, j, k] with two intervals per element → cells and faces.

A family's mesh is: positions on a grid, `numbered`, `grid_cells`, the faces of the layer that is wetted by
`grid_faces` (or the hollow `carved` out of a block), `boundary_faces` as skin, `module_sets`. Grids that meet share
nodes by sharing ids.
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
    """Coordinates of grid lines, two intervals an element, between neighbouring ends, which are kept exactly.

    Args:
        ends: (n + 1,) coordinates.
        elements: between all neighbours, or (n,) between each two.
    """
    counts = [elements] * (len(ends) - 1) if isinstance(elements, int) else elements
    pieces = [
        np.linspace(a, b, 2 * count + 1)[:-1] for (a, b), count in zip(pairwise(ends), counts, strict=True)
    ]
    return np.append(np.concatenate(pieces), ends[-1])


def block(x: Array, y: Array, z: Array) -> Array:
    """Positions [i, j, k, 3] of the grid with these lines."""
    return np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1)


def numbered(positions: Array) -> tuple[Array, IntArray]:
    """Positions [i, j, k, 3] → nodes (n, 3) and their ids [i, j, k]."""
    shape = positions.shape[:-1]
    return positions.reshape(-1, 3), np.arange(np.prod(shape), dtype=np.int64).reshape(shape)


def grid_cells(ids: IntArray) -> IntArray:
    """Cells (m, 27) of node ids [i, j, k], ξ along i, η along j, ζ along k.

    The three must be right-handed in space; otherwise let one run backwards (`ids[:, ::-1]`) or swap two.
    """
    windows = np.lib.stride_tricks.sliding_window_view(ids, (3, 3, 3))[::2, ::2, ::2]
    return np.ascontiguousarray(windows.transpose(0, 1, 2, 5, 4, 3)).reshape(-1, 27)


def grid_faces(ids: IntArray) -> IntArray:
    """Faces (f, 9) of a layer of node ids [i, j], a along i, b along j; `ids.T` turns the normals over."""
    windows = np.lib.stride_tricks.sliding_window_view(ids, (3, 3))[::2, ::2]
    return np.ascontiguousarray(windows.transpose(0, 1, 3, 2)).reshape(-1, 9)


def carved(nodes_m: Array, cells: IntArray, hollow: NDArray[np.bool_]) -> tuple[Array, IntArray, IntArray]:
    """A body without its cells `hollow` (m,): nodes that are left, cells, and the faces (f, 9) laid bare.

    The faces' normals point out of what is left, into the hollow: a cavity's faces.
    """
    left = cells[~hollow]
    skin, _ = boundary_faces(left)
    bare = skin[np.isin(skin[:, FACE_CENTRE], cells[hollow][:, FACES[:, FACE_CENTRE]])]
    used = np.unique(left)
    return nodes_m[used], np.searchsorted(used, left), np.searchsorted(used, bare)


def carved_cavities(
    nodes_m: Array, cells: IntArray, hollows: Mapping[str, NDArray[np.bool_]]
) -> tuple[Array, IntArray, dict[str, IntArray]]:
    """`carved` with several hollows: nodes and cells that are left, and the faces (f, 9) of each hollow by its name."""
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
    """Node sets of a piece: `start` (x = 0), `end` (x = span), `symmetry` (y = 0), `pin` (the node at a point).

    What is nearer than 1e-9 of the span lies on a plane or at the point.
    """
    x, y, _ = nodes_m.T
    distances = {
        "start": np.abs(x),
        "end": np.abs(x - span_m),
        "symmetry": np.abs(y),
        "pin": np.linalg.norm(nodes_m - np.asarray(pin_m), axis=1),
    }
    return {name: np.flatnonzero(distance < 1e-9 * span_m) for name, distance in distances.items()}
