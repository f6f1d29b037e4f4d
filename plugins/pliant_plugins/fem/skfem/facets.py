"""Quadratic faces as polynomials of their own coordinates, to second order, and projections onto them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from pliant.meshing.cells import kind_of_faces
from pliant.records.design import Array
from pliant.records.fem import IntArray
from pliant_plugins.fem.skfem.basis import ELEMENTS

DAMPED, MOST = 3, 12  # steps of a projection: the first without the faces' curvature, all at most
CLOSE = 1e-13  # the last step, in a face's own coordinates
FAR = 0.5  # how far outside a face's own coordinates a projection may stray


@dataclass(frozen=True, eq=False)
class Facet:
    """Shape functions of the faces of one kind, N = Σ coefficient · ξ^i η^j, nodes in scikit-fem's order.

    Attributes:
        powers: (n, 2).
        coefficients: (n, n) by monomial and node.
        triangle: whether faces are triangles, ξ + η ≤ 1.
    """

    powers: IntArray
    coefficients: Array
    triangle: bool

    def jets(self, at: Array) -> tuple[Array, Array, Array]:
        """N (p, n), ∂N (p, 2, n) and ∂²N (p, 2, 2, n) at (p, 2)."""
        one, zero = np.ones(len(at)), np.zeros(len(at))
        # 1, t, t² and their slopes, of ξ and of η
        xs, ys = (
            [
                np.stack([one, t, t * t], 1),
                np.stack([zero, one, 2 * t], 1),
                np.stack([zero, zero, 2 * one], 1),
            ]
            for t in at.T
        )
        i, j = self.powers.T

        def term(a: int, b: int) -> Array:
            return (xs[a][:, i] * ys[b][:, j]) @ self.coefficients

        first = np.stack([term(1, 0), term(0, 1)], axis=1)
        mixed = term(1, 1)
        second = np.stack([np.stack([term(2, 0), mixed], 1), np.stack([mixed, term(0, 2)], 1)], axis=1)
        return term(0, 0), first, second

    def outside(self, at: Array) -> Array:
        """(p,) how far (p, 2) lie outside a face, in its own coordinates; at most 0 on it."""
        beyond = [-at[:, 0], -at[:, 1]]
        beyond += [at.sum(axis=1) - 1] if self.triangle else [at[:, 0] - 1, at[:, 1] - 1]
        return np.max(beyond, axis=0)

    def project(self, points: Array, faces: Array) -> Array:
        """(p, 2) where the points (p, 3) are closest to the faces' nodes (p, n, 3), extended beyond their edges."""
        at = np.full((len(points), 2), 1 / 3 if self.triangle else 0.5)
        for number in range(MOST):
            value, first, second = self.jets(at)
            away = points - np.einsum("pn,pni->pi", value, faces)
            along = np.einsum("pan,pni->pai", first, faces)
            matrix = np.einsum("pai,pbi->pab", along, along)
            if number >= DAMPED:
                matrix = matrix - np.einsum("pabn,pni,pi->pab", second, faces, away)
            step = _solved(matrix, np.einsum("pai,pi->pa", along, away))
            before, at = at, np.clip(at + np.clip(step, -FAR, FAR), -FAR, 1 + FAR)
            if np.max(np.abs(at - before), initial=0.0) < CLOSE:
                break
        return at


def _solved(matrix: Array, right: Array) -> Array:
    """Solutions (p, 2) of 2 × 2 systems."""
    (a, b), (c, d) = matrix[:, 0].T, matrix[:, 1].T
    determinant = a * d - b * c
    determinant = np.where(np.abs(determinant) > 1e-12 * (a * d + 1e-300), determinant, np.inf)
    f, g = right.T
    return np.stack([d * f - b * g, a * g - c * f], axis=1) / determinant[:, None]


@cache
def _facet(name: str) -> Facet:
    of = ELEMENTS[name]
    places, triangle = np.asarray(of.face.doflocs, float), of.vertices == 4
    powers = np.array([(i, j) for i in range(3) for j in range(3) if not triangle or i + j <= 2])
    monomials = places[:, None, 0] ** powers[:, 0] * places[:, None, 1] ** powers[:, 1]
    return Facet(powers, np.linalg.inv(monomials), triangle)


def facet_of(faces: IntArray) -> Facet:
    """The shape functions of a mesh's faces."""
    return _facet(kind_of_faces(faces).name)
