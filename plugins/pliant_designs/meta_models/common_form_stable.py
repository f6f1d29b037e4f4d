"""Coefficients whose law is stable: ∂τ/∂u negative definite over a grid of the box of a family's designs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from pliant.records.design import Array
from pliant_designs.meta_models.common_form_terms import scaled_basis
from pliant_plugins.surrogates.polynomial.energy import Exponents, unit

# Levels of the actuation, of the main axis and of a side axis, which is symmetric or nearly so.
LEVELS = (5, 25, 5)
ONE_AXIS_LEVELS = (9, 41)
# Of several actuations: levels of each, and of each axis; the first that make no more points than this.
SEVERAL_LEVELS = ((9, 41), (5, 41), (5, 15), (5, 9), (3, 7), (3, 5), (3, 3))
MOST_POINTS = 4000
# Every joint keeps at least this share of its family's typical stiffness at rest.
MARGIN = 0.02
CUTS = 25
HALVINGS = 30
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class StabilityGrid:
    """Scaled slopes ∂τ/∂u as linear functions of coefficients, at points of a box.

    Attributes:
        points: (g, m + k) scaled actuations and deformations.
        slopes: (g, k, k, m) slopes of each term.
        margin: (k,) stiffness that must remain.
    """

    points: Array
    slopes: Array
    margin: Array

    @cached_property
    def _rows(self) -> Array:
        return np.ascontiguousarray(self.slopes.reshape(-1, self.slopes.shape[-1]))

    @cached_property
    def _levels(self) -> list[Array]:
        return [np.unique(column) for column in self.points.T]

    @staticmethod
    def from_box(exponents: Exponents, box: Array, main: int, margin: Array) -> StabilityGrid:
        """Return a grid of the scaled box (m + k, 2)."""
        k = len(margin)
        m = len(box) - k
        counts = _levels(m, k, main)
        sides = [np.linspace(low, high, count) for (low, high), count in zip(box, counts, strict=True)]
        points = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, m + k)
        basis = scaled_basis(exponents)
        slopes = np.zeros((len(points), k, k, len(exponents)))
        for i in range(k):
            for j in range(i, k):
                slopes[:, i, j] = -basis.derivative(points[:, :m], points[:, m:], unit(m + k, m + i, m + j))
                slopes[:, j, i] = slopes[:, i, j]
        return StabilityGrid(points, slopes, MARGIN * margin)

    def transformed(self, matrix: Array) -> StabilityGrid:
        """Return the grid for coefficients z with c = matrix · z."""
        return StabilityGrid(self.points, self.slopes @ matrix, self.margin)

    def inside(self, box: Array) -> Mask:
        """Return (g,) points in a deformation box (k, 2), and the first beyond each side of it."""
        keep = np.ones(len(self.points), bool)
        for axis, (low, high) in enumerate(box, start=self.points.shape[1] - len(box)):
            levels = self._levels[axis]
            first = levels[max(np.searchsorted(levels, low, side="right") - 1, 0)]
            last = levels[min(np.searchsorted(levels, high), len(levels) - 1)]
            keep &= (self.points[:, axis] >= first) & (self.points[:, axis] <= last)
        return keep

    def at(self, coefficients: Array, keep: Mask) -> Array:
        """Return (g', k, k) slopes plus the margin: stable where negative definite."""
        # The product over the whole grid costs less than a copy of a part of it.
        return (self._rows @ coefficients).reshape(self.slopes.shape[:3])[keep] + np.diag(self.margin)

    def stable(self, slopes: Array) -> bool:
        """Return whether all of the symmetric slopes (g, k, k) are negative definite."""
        return bool(_negative_definite(slopes).all())

    def blended(self, coefficients: Array, reference: Array, keep: Mask) -> Array:
        """Move the coefficients toward a stable reference by the least amount that makes them stable."""
        own, other = self.at(coefficients, keep), self.at(reference, keep)
        if self.stable(own):
            return coefficients
        low, high = 0.0, 1.0
        for _ in range(HALVINGS if len(self.margin) == 1 else HALVINGS // 2):
            middle = (low + high) / 2
            if self.stable(own + middle * (other - own)):
                high = middle
            else:
                low = middle
        return coefficients + high * (reference - coefficients)

    def nearest_targets(self, targets: Array, keep: Mask) -> Array | None:
        """Return the stable targets nearest to given ones, for a grid of coefficients (1, targets), or None.

        The margin that is aimed at is twice the one that must remain, so that few cuts are enough.
        """
        found = self.nearest(np.concatenate([[1.0], targets]), np.eye(len(targets)), keep, fixed=1)
        return found[1:] if self.stable(self.at(found, keep)) else None

    def nearest(self, coefficients: Array, precision: Array, keep: Mask, fixed: int = 0) -> Array:
        """Return the stable coefficients nearest to given ones in the metric `precision` (m, m).

        The first `fixed` coefficients stay as they are; `precision` is of the others.

        Cutting planes (Kelley, J. SIAM 8, 1960): a direction d of growing effort at a point gives the plane
        dᵀ S d ≤ 0; the quadratic program over the planes is solved by its dual, a non-negative least squares.
        """
        root = np.linalg.cholesky(
            precision + 1e-12 * np.trace(precision) / len(precision) * np.eye(len(precision))
        )
        held, free = coefficients[:fixed], coefficients[fixed:]
        points, planes, limits = np.flatnonzero(keep), [], []
        found = coefficients
        for _ in range(CUTS):
            own = self.at(found, keep)
            bad = np.flatnonzero(~_negative_definite(own))
            if not bad.size:
                break
            values, vectors = np.linalg.eigh(own[bad])
            worst = np.argsort(values[:, -1])[::-1][:40]
            d, slopes = vectors[worst, :, -1], self.slopes[points[bad[worst]]]
            along = np.einsum("gi,gijm,gj->gm", d, slopes, d)
            planes.append(along[:, fixed:])
            limits.append(-2.0 * np.einsum("gi,i,gi->g", d, self.margin, d) - along[:, :fixed] @ held)
            moved = _project(free, root, np.concatenate(planes), np.concatenate(limits))
            found = np.concatenate([held, moved])
        return found


def _project(start: Array, root: Array, planes: Array, limits: Array) -> Array:
    """Minimise |rootᵀ (c − start)| subject to planes · c ≤ limits (Lawson and Hanson, 1974, ch. 23)."""
    # With y = rootᵀ (c − start) the planes read −G y ≥ −h; the least distance is the residual of an NNLS.
    g = np.linalg.solve(root, planes.T).T
    h = limits - planes @ start
    scale = np.maximum(np.linalg.norm(g, axis=1), 1e-300)
    g, h = g / scale[:, None], h / scale
    system = np.vstack([-g.T, -h[None]])
    goal = np.zeros(len(system))
    goal[-1] = 1.0
    try:
        weights, _ = nnls(system, goal, maxiter=50 * system.shape[1])
    except RuntimeError:
        return start
    r = system @ weights - goal
    if abs(r[-1]) < 1e-12:
        return start
    step: Array = np.linalg.solve(root.T, -r[:-1] / r[-1])
    return start + step


def _levels(m: int, k: int, main: int) -> tuple[int, ...]:
    """Return levels of m actuations and k axes."""
    if m > 1:
        fitting = (pair for pair in SEVERAL_LEVELS if pair[0] ** m * pair[1] ** k <= MOST_POINTS)
        of_input, of_axis = next(fitting, SEVERAL_LEVELS[-1])
        return (of_input,) * m + (of_axis,) * k
    if k == 1:
        return ONE_AXIS_LEVELS
    return (LEVELS[0], *(LEVELS[1 if i == main else 2] for i in range(k)))


def _negative_definite(slopes: Array) -> Mask:
    """Return (g,) which symmetric slopes (g, k, k) are negative definite, by leading minors or eigenvalues (k > 3)."""
    if slopes.shape[1] > 3:
        largest: Mask = np.linalg.eigvalsh(slopes)[:, -1] < 0
        return largest
    s = -slopes
    found: Mask = s[:, 0, 0] > 0
    if s.shape[1] > 1:
        found &= s[:, 0, 0] * s[:, 1, 1] - s[:, 0, 1] ** 2 > 0
    if s.shape[1] > 2:
        determinant = (
            s[:, 0, 0] * (s[:, 1, 1] * s[:, 2, 2] - s[:, 1, 2] ** 2)
            - s[:, 0, 1] * (s[:, 0, 1] * s[:, 2, 2] - s[:, 1, 2] * s[:, 0, 2])
            + s[:, 0, 2] * (s[:, 0, 1] * s[:, 1, 2] - s[:, 1, 1] * s[:, 0, 2])
        )
        found &= determinant > 0
    return found
