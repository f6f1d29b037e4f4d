"""27-node hexahedra: node order, faces, shape functions, Gauss rules, volumes, boundary, divergence theorem.

Local node i + 3j + 9k is at (ξ, η, ζ) = (i, j, k)/2 of the unit cube; x(ξ) = Σ N_a(ξ) x_a is quadratic in each
coordinate. Local node a + 3b of a face is at (a, b)/2 of the unit square; its normal is ∂x/∂a × ∂x/∂b. `CENTRE` is
the local node in the middle of a cell, `FACE_CENTRE` that of a face.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from pliant.records.design import Array
from pliant.records.fem import IntArray

CENTRE = 13  # local node in the middle of a cell
FACE_CENTRE = 4  # local node in the middle of a face, of that face only

_LATTICE = np.arange(27).reshape(3, 3, 3)  # [k, j, i]
# (6, 9) local nodes of the faces, with the free axes ordered so that normals point out of a right-handed cell.
FACES: IntArray = np.stack(
    [
        _LATTICE[:, :, 0].T.ravel(),  # ξ = 0: a along ζ, b along η
        _LATTICE[:, :, 2].ravel(),  # ξ = 1: a along η, b along ζ
        _LATTICE[:, 0, :].ravel(),  # η = 0: a along ξ, b along ζ
        _LATTICE[:, 2, :].T.ravel(),  # η = 1: a along ζ, b along ξ
        _LATTICE[0, :, :].T.ravel(),  # ζ = 0: a along η, b along ξ
        _LATTICE[2, :, :].ravel(),  # ζ = 1: a along ξ, b along η
    ]
).astype(np.int64)


def lagrange(s: Array) -> tuple[Array, Array]:
    """Return quadratic Lagrange polynomials with nodes 0, ½, 1 at s (q,), and their slopes: (q, 3) each."""
    t = s[:, None]
    values = np.hstack([(1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)])
    return values, np.hstack([4 * t - 3, 4 - 8 * t, 4 * t - 1])


def shapes(points: Array) -> Array:
    """Return N (q, 27) at reference points (q, 3)."""
    return _product(*(lagrange(s)[0] for s in points.T))


def shape_slopes(points: Array) -> Array:
    """Return ∂N/∂ξ (q, 27, 3) at reference points (q, 3)."""
    (a, da), (b, db), (c, dc) = (lagrange(s) for s in points.T)
    return np.stack([_product(da, b, c), _product(a, db, c), _product(a, b, dc)], axis=-1)


def _product(a: Array, b: Array, c: Array) -> Array:
    """Return (q, 27) products of one-dimensional polynomials (q, 3), local node i + 3j + 9k."""
    return np.einsum("qi,qj,qk->qkji", a, b, c).reshape(len(a), 27)


@cache
def gauss(order: int = 3) -> tuple[Array, Array]:
    """Return Gauss points and weights (order,) on [0, 1], read-only: exact to degree 2 order − 1."""
    node, weight = np.polynomial.legendre.leggauss(order)
    return _kept((node + 1) / 2), _kept(weight / 2)


@cache
def gauss_cube(order: int = 3) -> tuple[Array, Array]:
    """Return Gauss points (order³, 3) and weights (order³,) of the unit cube, read-only."""
    point, weight = gauss(order)
    points = np.stack(np.meshgrid(point, point, point, indexing="ij"), axis=-1).reshape(-1, 3)
    return _kept(points), _kept(np.einsum("i,j,k->ijk", weight, weight, weight).ravel())


@cache
def _cube_shapes(order: int) -> tuple[Array, Array]:
    """Return N and ∂N/∂ξ at the Gauss points of the unit cube, cached for searches with thousands of meshes."""
    points, _ = gauss_cube(order)
    return _kept(shapes(points)), _kept(shape_slopes(points))


def _kept(array: Array) -> Array:
    array.setflags(write=False)
    return array


def sample_points() -> Array:
    """Return corners, Gauss points and centre of the unit cube, (36, 3), at which Jacobians are checked."""
    corners = np.stack(np.meshgrid(*[[0.0, 1.0]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.concatenate([corners, gauss_cube()[0], [[0.5, 0.5, 0.5]]])


def jacobians(nodes_m: Array, cells: IntArray, points: Array) -> Array:
    """Return determinants (m, q) of ∂x/∂ξ in m³ of cells (m, 27) at reference points (q, 3)."""
    return _determinants(nodes_m, cells, shape_slopes(points))


def _determinants(nodes_m: Array, cells: IntArray, slopes: Array) -> Array:
    corners = nodes_m[cells].transpose(2, 0, 1).reshape(-1, 27)
    # Matrix products by component: ten times faster than one sum over all indices.
    (a, b, c), (d, e, f), (g, h, i) = (
        (corners @ slopes[:, :, j].T).reshape(3, len(cells), len(slopes)) for j in range(3)
    )
    return np.asarray(a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g))


def quadrature(nodes_m: Array, cells: IntArray, order: int = 3) -> tuple[Array, Array]:
    """Return Gauss points (m, q, 3) in m and their signed volumes (m, q) in m³, negative in inverted cells.

    The determinant is of degree 5 in each coordinate: order 3 integrates 1 exactly, order 4 positions, order 5
    products of two positions.
    """
    values, slopes = _cube_shapes(order)
    return values @ nodes_m[cells], _determinants(nodes_m, cells, slopes) * gauss_cube(order)[1]


def cell_volumes(nodes_m: Array, cells: IntArray) -> Array:
    """Return signed volumes (m,) in m³, exact."""
    return np.asarray(quadrature(nodes_m, cells)[1].sum(axis=1))


def boundary_faces(cells: IntArray) -> tuple[IntArray, IntArray]:
    """Return faces (g, 9) that belong to one cell only, normals out of it, and these cells' numbers (g,)."""
    faces = cells[:, FACES].reshape(-1, 9)
    _, first, count = np.unique(faces[:, FACE_CENTRE], return_index=True, return_counts=True)
    chosen = np.sort(first[count == 1])
    return faces[chosen], chosen // len(FACES)


def area_vector(nodes_m: Array, faces: IntArray) -> Array:
    """Return ∮ n dA (3,) in m² over faces (f, 9): zero if they are closed."""
    _, normals = face_quadrature(nodes_m, faces)
    return np.asarray(normals.sum(axis=(0, 1)))


def enclosed_volume(nodes_m: Array, faces: IntArray) -> float:
    """Return ∮ x·n dA / 3 in m³ over closed faces (f, 9) with normals outward: the divergence theorem."""
    points, normals = face_quadrature(nodes_m, faces)
    return float(np.einsum("fqi,fqi->", points, normals) / 3)


def face_quadrature(nodes_m: Array, faces: IntArray) -> tuple[Array, Array]:
    """Return Gauss points (f, 9, 3) and n dA (f, 9, 3); x·n dA is of degree 5 in each coordinate, hence exact."""
    point, weight = gauss(3)
    value, slope = lagrange(point)
    corner = nodes_m[faces].reshape(-1, 3, 3, 3)  # [face, b, a, component]
    places, along_a, along_b = (
        np.einsum("qa,rb,fbai->fqri", of_a, of_b, corner).reshape(-1, 9, 3)
        for of_a, of_b in ((value, value), (slope, value), (value, slope))
    )
    return places, np.cross(along_a, along_b) * np.outer(weight, weight).reshape(-1, 1)
