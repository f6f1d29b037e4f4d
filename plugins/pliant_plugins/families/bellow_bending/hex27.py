"""Quadrature over 27-node hexahedra in lexicographic order: what meshes are checked and weighed with."""

from __future__ import annotations

import numpy as np

from pliant.records.design import Array
from pliant.records.fem import IntArray

# The six faces (axis held, side), and how their two free axes run for an outward normal.
_LATTICE = np.arange(27).reshape(3, 3, 3)  # [k, j, i]
FACES: IntArray = np.stack(
    [
        _LATTICE[:, :, 0].T.ravel(),  # ξ = 0: a along ζ, b along η
        _LATTICE[:, :, 2].ravel(),  # ξ = 1: a along η, b along ζ
        _LATTICE[:, 0, :].ravel(),  # η = 0: a along ξ, b along ζ
        _LATTICE[:, 2, :].T.ravel(),  # η = 1
        _LATTICE[0, :, :].T.ravel(),  # ζ = 0
        _LATTICE[2, :, :].ravel(),  # ζ = 1: a along ξ, b along η
    ]
).astype(np.int64)


def _lagrange(points: Array) -> tuple[Array, Array]:
    """Quadratic Lagrange polynomials on [0, 1] with nodes 0, ½, 1, and their slopes: (q, 3) each."""
    s = points[:, None]
    values = np.hstack([(1 - s) * (1 - 2 * s), 4 * s * (1 - s), s * (2 * s - 1)])
    return values, np.hstack([4 * s - 3, 4 - 8 * s, 4 * s - 1])


def gauss(order: int = 3) -> tuple[Array, Array]:
    """Gauss points and weights on [0, 1]."""
    node, weight = np.polynomial.legendre.leggauss(order)
    return (node + 1) / 2, weight / 2


def tabulate(order: int = 3) -> tuple[Array, Array, Array]:
    """Shape functions (q, 27), their slopes (q, 27, 3) and weights (q,) at order³ Gauss points."""
    point, weight = gauss(order)
    value, slope = _lagrange(point)
    parts = [(slope, value, value), (value, slope, value), (value, value, slope)]
    # local node i + 3j + 9k, hence ζ slowest
    N = np.einsum("ri,sj,tk->tsrkji", value, value, value).reshape(-1, 27)
    dN = np.stack([np.einsum("ri,sj,tk->tsrkji", *p).reshape(-1, 27) for p in parts], axis=-1)
    return N, dN, np.einsum("r,s,t->tsr", weight, weight, weight).ravel()


def tabulate_face(order: int = 3) -> tuple[Array, Array, Array]:
    """Shape functions (q, 9), slopes (q, 9, 2) and weights (q,) on a face, local node a + 3b."""
    point, weight = gauss(order)
    value, slope = _lagrange(point)
    N = np.einsum("ra,sb->srba", value, value).reshape(-1, 9)
    dN = np.stack(
        [np.einsum("ra,sb->srba", *p).reshape(-1, 9) for p in ((slope, value), (value, slope))], axis=-1
    )
    return N, dN, np.einsum("r,s->sr", weight, weight).ravel()


def quadrature(nodes_m: Array, cells: IntArray, order: int = 3) -> tuple[Array, Array]:
    """Gauss points (m, q, 3) and their signed volumes (m, q), negative where a cell is inverted."""
    N, dN, weight = tabulate(order)
    corner = nodes_m[cells]
    jacobian = np.einsum("eai,qaj->eqij", corner, dN)
    return np.einsum("qa,eai->eqi", N, corner), np.linalg.det(jacobian) * weight


def enclosed_volume(nodes_m: Array, faces: IntArray, order: int = 4) -> float:
    """∮ x·n dA / 3 over faces (f, 9) whose normal ∂x/∂a × ∂x/∂b points out: the divergence theorem."""
    N, dN, weight = tabulate_face(order)
    tangent = np.einsum("fai,qaj->fqij", nodes_m[faces], dN)
    normal = np.cross(tangent[..., 0], tangent[..., 1])
    point = np.einsum("qa,fai->fqi", N, nodes_m[faces])
    return float(np.einsum("fqi,fqi,q->", point, normal, weight) / 3)


def boundary_faces(cells: IntArray) -> IntArray:
    """Faces (g, 9) that belong to one cell only, normals outward."""
    faces = cells[:, FACES].reshape(-1, 9)
    # the middle node of a face belongs to that face alone
    _, first, count = np.unique(faces[:, 4], return_index=True, return_counts=True)
    return faces[np.sort(first[count == 1])]
