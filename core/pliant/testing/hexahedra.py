"""27-node hexahedra for checks: Jacobians, volumes, boundary faces. Independent of any plugin's own code."""

from __future__ import annotations

import numpy as np

from pliant.records.design import Array
from pliant.records.fem import IntArray

_LATTICE = np.arange(27).reshape(3, 3, 3)  # [k, j, i]: local node i + 3j + 9k
# Local nodes of the six faces, a + 3b, with ∂x/∂a × ∂x/∂b out of the element.
FACES: IntArray = np.stack(
    [
        _LATTICE[:, :, 0].T.ravel(),
        _LATTICE[:, :, 2].ravel(),
        _LATTICE[:, 0, :].ravel(),
        _LATTICE[:, 2, :].T.ravel(),
        _LATTICE[0, :, :].T.ravel(),
        _LATTICE[2, :, :].ravel(),
    ]
)


def _basis(s: Array) -> tuple[Array, Array]:
    """Quadratic Lagrange polynomials at s (q,) on [0, 1] and their slopes, (q, 3) each."""
    t = s[:, None]
    values = np.hstack([(1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)])
    return values, np.hstack([4 * t - 3, 4 - 8 * t, 4 * t - 1])


def shape_slopes(points: Array) -> Array:
    """∂N/∂ξ (q, 27, 3) at reference points (q, 3)."""
    (a, da), (b, db), (c, dc) = (_basis(points[:, i]) for i in range(3))

    def product(x: Array, y: Array, z: Array) -> Array:
        return np.einsum("qi,qj,qk->qkji", x, y, z).reshape(len(points), 27)

    return np.stack([product(da, b, c), product(a, db, c), product(a, b, dc)], axis=-1)


def _gauss() -> tuple[Array, Array]:
    node, weight = np.polynomial.legendre.leggauss(3)
    grid = np.stack(np.meshgrid(*[(node + 1) / 2] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    return grid, np.einsum("i,j,k->ijk", *[weight / 2] * 3).ravel()


def sample_points() -> Array:
    """Corners, Gauss points and centre of the reference element, (36, 3): where Jacobians are judged."""
    corners = np.stack(np.meshgrid(*[[0.0, 1.0]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.concatenate([corners, _gauss()[0], [[0.5, 0.5, 0.5]]])


def jacobians(nodes: Array, cells: IntArray, points: Array) -> Array:
    """Determinants (m, q) of ∂x/∂ξ."""
    slope = np.einsum("mai,qaj->mqij", nodes[cells], shape_slopes(points))
    determinants: Array = np.linalg.det(slope)
    return determinants


def cell_volumes(nodes: Array, cells: IntArray) -> Array:
    """(m,) volumes."""
    points, weights = _gauss()
    volumes: Array = jacobians(nodes, cells, points) @ weights
    return volumes


def boundary_faces(cells: IntArray) -> tuple[IntArray, IntArray]:
    """Faces (g, 9) that belong to one cell only, normals out of it, and these cells (g,)."""
    faces = cells[:, FACES].reshape(-1, 9)
    # a face's middle node belongs to no other face
    _, first, count = np.unique(faces[:, 4], return_index=True, return_counts=True)
    chosen = np.sort(first[count == 1])
    return faces[chosen], chosen // 6


def face_integrals(nodes: Array, faces: IntArray) -> tuple[Array, float]:
    """∮ n dA (3,) and ∮ x·n dA / 3 over faces: zero and the enclosed volume for a closed surface."""
    node, weight = np.polynomial.legendre.leggauss(4)
    value, slope = _basis((node + 1) / 2)
    corner = nodes[faces].reshape(-1, 3, 3, 3)  # [face, b, a, component]
    along_a = np.einsum("ra,sb,fbai->frsi", slope, value, corner)
    along_b = np.einsum("ra,sb,fbai->frsi", value, slope, corner)
    point = np.einsum("ra,sb,fbai->frsi", value, value, corner)
    normal = np.cross(along_a, along_b)
    weights = np.outer(weight, weight) / 4
    area = np.einsum("frsi,rs->i", normal, weights)
    return area, float(np.einsum("frsi,frsi,rs->", point, normal, weights) / 3)
