"""Smooth curves from the slopes of their values: ridge by marginal likelihood, judged on left-out runs.

Residuals r (N,) are in units of the noise floor, J (N, K) their slopes by the values v at the knots of a curve. With
N readings equivalent to n_eff independent ones of mean square σ²,

    v ~ N(0, s² C_ℓ),      r | v ~ N(J v, σ² N/n_eff)

C_ℓ the squared exponential of the knots' distances over ℓ. Size s and length ℓ maximize the likelihood with v
integrated out (MacKay, Neural Comput. 4, 1992), σ² is the noise floor's or, if larger, the curve's mean squared
residual. The posterior N(m, V) has the error bars. Without a group of readings the mean follows from sums over the
others, without a refit.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from pliant.mechanics.learned_curve import CurveAxis
from pliant.records.design import Array

# Correlation lengths of a curve, as shares of its range; only long ones for the second covariate of a surface.
LENGTHS = (0.04, 0.08, 0.15, 0.3, 0.6, 1.5)
SECOND_LENGTHS = (0.4, 1.5)
SIZES = np.logspace(-1.5, 4.0, 12)
JITTER = 1e-6
ROUNDS = 3


@dataclass(frozen=True, eq=False)
class Sums:
    """JᵀJ (K, K), Jᵀr (K,) and rᵀr of each group of readings (G,)."""

    gram: Array
    right: Array
    square: Array
    count: Array

    @staticmethod
    def from_residuals(slopes: Array, residual: Array, groups: NDArray[np.intp]) -> Sums:
        """Return sums over the readings of each group number that occurs."""
        rows = [np.flatnonzero(groups == g) for g in np.unique(groups)]
        return Sums(
            np.array([slopes[k].T @ slopes[k] for k in rows]),
            np.array([slopes[k].T @ residual[k] for k in rows]),
            np.array([residual[k] @ residual[k] for k in rows]),
            np.array([len(k) for k in rows], float),
        )


@dataclass(frozen=True, eq=False)
class CurvePrior:
    """Size and length of a curve, with the weight of a reading relative to it.

    Attributes:
        factor: (K, K) lower Cholesky factor of s² C_ℓ.
        weight: n_eff / (N σ²).
        lengths: ℓ of each covariate, as a share of its range.
    """

    factor: Array
    weight: float
    lengths: tuple[float, ...]

    def posterior(self, gram: Array, right: Array) -> tuple[Array, Array]:
        """Return mean (K,) and covariance (K, K) of the values.

        Eigenvalues are used because rounding makes some of them negative if slopes are steep.
        """
        known, ways = np.linalg.eigh(self.weight * self.factor.T @ gram @ self.factor)
        half = (self.factor @ ways) / np.sqrt(1.0 + np.maximum(known, 0.0))
        covariance = half @ half.T
        return self.weight * covariance @ right, covariance

    def freedom(self, gram: Array) -> float:
        """Return the effective number of values that the readings determine."""
        return float(np.trace(self.weight * self.posterior(gram, np.zeros(len(gram)))[1] @ gram))


def most_likely(
    axes: Sequence[CurveAxis], sums: Sums, n_effective: float, floor_square: float
) -> CurvePrior | None:
    """Return the prior with the highest likelihood; None if the curve changes no reading, or one infinitely."""
    gram, right, n = sums.gram.sum(axis=0), sums.right.sum(axis=0), float(sums.count.sum())
    if not 0.0 < np.trace(gram) < np.inf:
        return None
    noise, found = floor_square, None
    for _ in range(ROUNDS):
        weight = n_effective / (n * noise)
        found = max(_priors(axes, gram, right, weight), key=lambda one: one[0])[1]
        mean, _ = found.posterior(gram, right)
        left = float(sums.square.sum() - 2.0 * mean @ right + mean @ gram @ mean) / n
        if left <= 1.02 * noise:
            break
        noise = left
    return found


def _priors(
    axes: Sequence[CurveAxis], gram: Array, right: Array, weight: float
) -> Iterator[tuple[float, CurvePrior]]:
    """Yield log evidence, up to a constant, and prior of every length and size."""
    options = [
        [length for length in (LENGTHS if k == 0 else SECOND_LENGTHS) if length * (axis.knots - 1) > 0.5]
        for k, axis in enumerate(axes)
    ]
    for lengths in product(*options):
        kernel: Array = np.ones((1, 1))
        for axis, length in zip(axes, lengths, strict=True):
            at = np.linspace(0.0, 1.0, axis.knots)
            of_axis = np.exp(-0.5 * ((at[:, None] - at[None]) / length) ** 2)
            kernel = np.asarray(np.kron(kernel, of_axis), float)
        lower = np.linalg.cholesky(kernel + JITTER * np.eye(len(kernel)))
        values, vectors = np.linalg.eigh(weight * lower.T @ gram @ lower)
        values = np.maximum(values, 0.0)
        along = (vectors.T @ (weight * lower.T @ right)) ** 2
        for size in SIZES / max(float(values.sum()), 1e-300) * len(values):
            shrunk = 1.0 + size * values
            evidence = -0.5 * float(np.log(shrunk).sum()) + 0.5 * float((size * along / shrunk).sum())
            yield evidence, CurvePrior(np.sqrt(size) * lower, weight, lengths)


@dataclass(frozen=True, eq=False)
class LinearModel:
    """The readings to first order about some values (K,): residual (N,) there and slopes (N, K)."""

    value: Array
    residual: Array
    slopes: Array

    @property
    def aim(self) -> Array:
        """Return (N,) the change that the whole curve should make, to first order."""
        return self.residual + self.slopes @ self.value


def left_out(prior: CurvePrior, models: Sequence[LinearModel], groups: NDArray[np.intp]) -> Array:
    """Return (N,) residual of each reading, with the curve's values estimated from the other groups only.

    Values come from the last of the models, and predictions from the model nearest to them: without the only group that
    shows a curve the curve almost vanishes, and the model about no curve is used.
    """
    last = models[-1]
    sums = Sums.from_residuals(last.slopes, last.aim, groups)
    gram, right = sums.gram.sum(axis=0), sums.right.sum(axis=0)
    left = np.zeros(len(last.residual))
    for k, group in enumerate(np.unique(groups)):
        mine = groups == group
        mean, _ = prior.posterior(gram - sums.gram[k], right - sums.right[k])

        def away(model: LinearModel, mean: Array = mean) -> float:
            return float((mean - model.value) @ gram @ (mean - model.value))

        nearest = min(reversed(models), key=away)
        left[mine] = nearest.residual[mine] - nearest.slopes[mine] @ (mean - nearest.value)
    return left
