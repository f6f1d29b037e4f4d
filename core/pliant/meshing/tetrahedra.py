"""10-node tetrahedra: node order, faces, shape functions, quadrature, Jacobians, boundary.

Local nodes 0 to 3 are the corners (0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1) of the unit tetrahedron, 4 to 9 the
middles of its edges 01, 12, 02, 03, 13, 23 (VTK's order); x(ξ) = Σ N_a(ξ) x_a is quadratic. A face has the corners
0, 1, 2 at (0, 0), (1, 0), (0, 1) and the middles 3, 4, 5 of its edges 01, 12, 02; its normal is ∂x/∂a × ∂x/∂b.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from pliant.meshing.hexahedra import gauss
from pliant.records.design import Array
from pliant.records.fem import IntArray

EDGES: IntArray = np.array([(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)], np.int64)
# (4, 6) local nodes of the faces, ordered so that normals point out of a right-handed cell.
FACES: IntArray = np.array(
    [(0, 2, 1, 6, 5, 4), (0, 1, 3, 4, 8, 7), (1, 2, 3, 5, 9, 8), (2, 0, 3, 6, 7, 9)], np.int64
)
# A face as four triangles.
TRIANGLES: IntArray = np.array([(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)], np.int64)
FACE_EDGES: IntArray = np.array([(0, 1), (1, 2), (0, 2)], np.int64)
CORNERS = 4


def shapes(points: Array) -> Array:
    """Return N (q, 10) at reference points (q, 3)."""
    return _quadratic(_barycentric(points), EDGES)


def shape_slopes(points: Array) -> Array:
    """Return ∂N/∂ξ (q, 10, 3) at reference points (q, 3)."""
    return _quadratic_slopes(_barycentric(points), EDGES)


def face_shapes(points: Array) -> Array:
    """Return N (q, 6) of a face at reference points (q, 2)."""
    return _quadratic(_barycentric(points), FACE_EDGES)


def face_slopes(points: Array) -> Array:
    """Return ∂N/∂(a, b) (q, 6, 2) of a face at reference points (q, 2)."""
    return _quadratic_slopes(_barycentric(points), FACE_EDGES)


def _barycentric(points: Array) -> Array:
    return np.column_stack([1 - points.sum(axis=1), points])


def _quadratic(at: Array, edges: IntArray) -> Array:
    first, second = at[:, edges[:, 0]], at[:, edges[:, 1]]
    return np.hstack([at * (2 * at - 1), 4 * first * second])


def _quadratic_slopes(at: Array, edges: IntArray) -> Array:
    size = at.shape[1] - 1
    slope = np.vstack([-np.ones(size), np.eye(size)])  # of the barycentric coordinates
    corners = (4 * at - 1)[..., None] * slope
    first, second = edges.T
    middles = 4 * (at[:, first, None] * slope[second] + at[:, second, None] * slope[first])
    return np.concatenate([corners, middles], axis=1)


@cache
def rule(order: int) -> tuple[Array, Array]:
    """Return points (order³, 3) and weights (order³,) of the unit tetrahedron: exact to degree 2 order − 3.

    Gauss points of the unit cube with two of its faces collapsed (Stroud, Approximate Calculation of Multiple
    Integrals, 1971).
    """
    node, weight = gauss(order)
    a, b, c = (g.ravel() for g in np.meshgrid(node, node, node, indexing="ij"))
    of_a, of_b, of_c = (g.ravel() for g in np.meshgrid(weight, weight, weight, indexing="ij"))
    points = np.stack([a, b * (1 - a), c * (1 - a) * (1 - b)], axis=1)
    return points, of_a * of_b * of_c * (1 - a) ** 2 * (1 - b)


@cache
def face_rule(order: int) -> tuple[Array, Array]:
    """Return points (order², 2) and weights (order²,) of the unit triangle: exact to degree 2 order − 2."""
    node, weight = gauss(order)
    a, b = (g.ravel() for g in np.meshgrid(node, node, indexing="ij"))
    of_a, of_b = (g.ravel() for g in np.meshgrid(weight, weight, indexing="ij"))
    return np.stack([a, b * (1 - a)], axis=1), of_a * of_b * (1 - a)


def sample_points() -> Array:
    """Return the ten nodes and some inner points, at which Jacobians are checked."""
    corners = np.vstack([np.zeros(3), np.eye(3)])
    middles = corners[EDGES].mean(axis=1)
    return np.concatenate([corners, middles, rule(2)[0], [[0.25, 0.25, 0.25]]])


def jacobians(nodes_m: Array, cells: IntArray, points: Array) -> Array:
    """Return determinants (m, q) of ∂x/∂ξ in m³ of cells (m, 10) at reference points (q, 3)."""
    slopes = shape_slopes(points).transpose(2, 0, 1)  # (3, q, 10)
    columns = [slope @ nodes_m[cells] for slope in slopes]  # (m, q, 3) each
    return np.asarray(np.einsum("mqi,mqi->mq", columns[0], np.cross(columns[1], columns[2])))


def quadrature(nodes_m: Array, cells: IntArray, order: int = 3) -> tuple[Array, Array]:
    """Return points (m, q, 3) in m and their signed volumes (m, q) in m³, negative in inverted cells.

    The determinant is of degree 3: order 3 integrates 1 exactly, order 4 positions, order 5 products of two positions.
    """
    points, weight = rule(order)
    return shapes(points) @ nodes_m[cells], jacobians(nodes_m, cells, points) * weight


def boundary_faces(cells: IntArray) -> tuple[IntArray, IntArray]:
    """Return faces (g, 6) that belong to one cell only, normals out of it, and these cells' numbers (g,)."""
    faces = cells[:, FACES].reshape(-1, 6)
    _, first, count = np.unique(np.sort(faces[:, :3], axis=1), axis=0, return_index=True, return_counts=True)
    chosen = np.sort(first[count == 1])
    return faces[chosen], chosen // len(FACES)


def face_quadrature(nodes_m: Array, faces: IntArray) -> tuple[Array, Array]:
    """Return points (f, q, 3) and n dA (f, q, 3); x·n dA is of degree 4, hence exact."""
    points, weight = face_rule(3)
    corner, slopes = nodes_m[faces], face_slopes(points)
    along_a, along_b = (slopes[..., i] @ corner for i in range(2))
    return face_shapes(points) @ corner, np.cross(along_a, along_b) * weight[:, None]


def raised(nodes_m: Array, corners: IntArray) -> tuple[Array, IntArray]:
    """Convert first-order cells (m, 4) to straight 10-node ones: nodes, the given ones first, and cells (m, 10)."""
    ends = np.sort(corners[:, EDGES].reshape(-1, 2), axis=1)
    unique, number = np.unique(ends, axis=0, return_inverse=True)
    middles: IntArray = len(nodes_m) + number.reshape(len(corners), len(EDGES)).astype(np.int64)
    return np.vstack([nodes_m, nodes_m[unique].mean(axis=1)]), np.hstack([corners, middles])
