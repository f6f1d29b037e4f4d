"""The serendipity family: 20-node hexahedra, their 8-node faces, 6-node triangles.

Node order is that of Abaqus and CalculiX: corners of the lower face, of the upper face, then mid-edge nodes of the
lower, the upper and the upright edges.
"""

from __future__ import annotations

import numpy as np

from pliant.meshing.hexahedra import FACE_CENTRE, FACES, gauss
from pliant.records.design import Array
from pliant.records.fem import IntArray

_CORNERS = ((0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2))
_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
_LATTICE20 = np.vstack([_CORNERS, [(np.array(_CORNERS[a]) + _CORNERS[b]) // 2 for a, b in _EDGES]])
# Places of the twenty nodes among the 27 of Pliant's cells.
HEX20: IntArray = (_LATTICE20 @ [1, 3, 9]).astype(np.int64)
# Number of the face in a deck, by Pliant's order of faces (ξ = 0, 1, η = 0, 1, ζ = 0, 1).
FACE_NUMBER = (6, 4, 3, 5, 1, 2)
# Corners, then mid-edge nodes, of the 9-node faces.
QUAD8: IntArray = np.array([0, 2, 8, 6, 1, 5, 7, 3])


def _monomials(points: Array, slope: int | None = None) -> Array:
    """Return monomials of superlinear degree at most 2 at points (q, d), or their slope along one coordinate."""
    d = points.shape[1]
    powers = np.stack(np.meshgrid(*[range(3)] * d, indexing="ij"), -1).reshape(-1, d)
    powers = powers[(powers == 2).sum(axis=1) <= 1]
    factor = np.ones(len(powers))
    if slope is not None:
        factor = powers[:, slope].astype(float)
        powers = powers.copy()
        powers[:, slope] = np.maximum(powers[:, slope] - 1, 0)
    values: Array = factor * np.prod(points[:, None, :] ** powers, axis=-1)
    return values


class Serendipity:
    """Shape functions with these nodes (n, d) on the unit square or cube."""

    def __init__(self, nodes: Array) -> None:
        self.dimension = nodes.shape[1]
        self._coefficients = np.linalg.inv(_monomials(nodes))

    def shapes(self, points: Array) -> Array:
        """Return shape functions (q, n)."""
        values: Array = _monomials(points) @ self._coefficients
        return values

    def slopes(self, points: Array) -> Array:
        """Return slopes of the shape functions (q, n, d)."""
        parts = [_monomials(points, k) @ self._coefficients for k in range(self.dimension)]
        return np.stack(parts, axis=-1)


HEXAHEDRON = Serendipity(_LATTICE20 / 2.0)
QUADRILATERAL = Serendipity(np.stack([QUAD8 % 3, QUAD8 // 3], axis=-1) / 2.0)
# (27, 20): values at all nodes of a 27-node cell from those at its twenty.
FILL: Array = HEXAHEDRON.shapes(
    np.stack([np.arange(27) % 3, np.arange(27) // 3 % 3, np.arange(27) // 9], -1) / 2
)


def cube_rule(order: int) -> tuple[Array, Array]:
    """Return Gauss points (order³, 3) and weights of the unit cube."""
    point, weight = gauss(order)
    points = np.stack(np.meshgrid(point, point, point, indexing="ij"), axis=-1).reshape(-1, 3)
    return points, np.einsum("i,j,k->ijk", weight, weight, weight).ravel()


def square_rule(order: int) -> tuple[Array, Array]:
    """Return Gauss points (order², 2) and weights of the unit square."""
    point, weight = gauss(order)
    points = np.stack(np.meshgrid(point, point, indexing="ij"), axis=-1).reshape(-1, 2)
    return points, np.outer(weight, weight).ravel()


def triangle_shapes(points: Array) -> tuple[Array, Array]:
    """Return shapes (q, 6) and slopes (q, 6, 2) of a six-node triangle: corners (0,0), (1,0), (0,1), mid-edge nodes."""
    r, s = points.T
    t = 1 - r - s
    area = np.stack([t, r, s], axis=-1)
    slope = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    pairs = ((0, 1), (1, 2), (2, 0))
    corners = area * (2 * area - 1)
    middles = np.stack([4 * area[:, a] * area[:, b] for a, b in pairs], axis=-1)
    by_corner = (4 * area - 1)[..., None] * slope
    by_middle = np.stack(
        [4 * (area[:, a, None] * slope[b] + area[:, b, None] * slope[a]) for a, b in pairs], axis=1
    )
    return np.hstack([corners, middles]), np.concatenate([by_corner, by_middle], axis=1)


def triangle_rule() -> tuple[Array, Array]:
    """Return three points and weights, CalculiX' rule for the pressure on a six-node face."""
    return np.array([[1, 1], [4, 1], [1, 4]]) / 6, np.full(3, 1 / 6)


def deck_faces(cells: IntArray, faces: IntArray) -> tuple[IntArray, IntArray]:
    """Return cell and deck's face number (f,) of boundary faces (f, 9)."""
    centres = cells[:, FACES[:, FACE_CENTRE]]
    order = np.argsort(centres.ravel())
    found = order[np.searchsorted(centres.ravel(), faces[:, FACE_CENTRE], sorter=order)]
    return found // 6, np.array(FACE_NUMBER)[found % 6]
