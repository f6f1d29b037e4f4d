"""Estimate of the law's error under a hypothesis: its prior, size, coefficients and penalty.

The model is that of `law_discrepancy`: coefficients c ~ N(0, s²) change the readings by B c, s has a prior on a grid.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.diagnosis.noise import LEAST_SQUARE
from pliant.records.design import Array

JITTER = 1e-8
ROUNDS = 3
# Prior probability that a law is exact.
EXACT = 0.05


@dataclass(frozen=True)
class LawErrorPrior:
    """Log-normal prior of the size s, a share of the torque range, on a grid.

    Attributes:
        median: the median size.
        spread: standard deviation of ln s.
        most: the largest size that is considered.
    """

    median: float
    spread: float
    most: float
    least: float = 2e-4
    count: int = 15

    @staticmethod
    def stated(share: float) -> LawErrorPrior:
        """Return the prior of a law with a stated error: half of it is the median, and it is the maximum."""
        return LawErrorPrior(0.5 * share, np.log(2.0), share, least=0.05 * share)

    @property
    def sizes(self) -> Array:
        """Return (n,) the grid."""
        return np.geomspace(self.least, self.most, self.count)

    @property
    def log_weights(self) -> Array:
        """Return (n,) log prior probability of each size of the grid."""
        logs = -0.5 * (np.log(self.sizes / self.median) / self.spread) ** 2
        return np.asarray(logs - np.log(np.sum(np.exp(logs))))

    @property
    def large(self) -> float:
        """Return the 95 % quantile of the size."""
        return float(min(self.median * np.exp(1.6449 * self.spread), self.most))


# Without a statement: a law from FEM of rubber, or fitted to a test rig, is usually off by 0.3 to 3 % of its range.
USUAL = LawErrorPrior(median=0.01, spread=np.log(2.2), most=0.06)


def law_error_prior(law_error: float | None) -> LawErrorPrior:
    """Return the prior that a study's `law_error` states, or the usual one without it."""
    return USUAL if law_error is None else LawErrorPrior.stated(law_error)


@dataclass(frozen=True, eq=False)
class LawError:
    """The estimate of δ from the readings of a fit.

    Attributes:
        columns: (N, m) B, change of the readings per unit of each coefficient, in noise floors.
        coefficient: (m,) its posterior mean.
        size: s, the most probable share of the torque range.
        precision: of each coefficient, in units of squared residuals: 1 / (w s²).
        price: log-odds penalty of δ: its prior at the coefficients and Occam's factor, the size integrated.
    """

    columns: Array
    coefficient: Array
    size: float
    precision: float
    price: float

    @property
    def change(self) -> Array:
        """Return (N,) the change by δ, in noise floors."""
        return np.asarray(self.columns @ self.coefficient)

    @property
    def penalty(self) -> float:
        """Return the contribution of the prior to the sum of squared residuals."""
        return float(self.precision * (self.coefficient @ self.coefficient))

    @property
    def normal(self) -> Array:
        """Return (m, m) BᵀB + I / (w s²)."""
        return np.asarray(self.columns.T @ self.columns + self.precision * np.eye(len(self.coefficient)))

    def posterior_root(self) -> Array:
        """Return R (m, m) with σ²-scaled covariance R Rᵀ of the coefficients, in units of squared residuals."""
        values, vectors = np.linalg.eigh(self.normal)
        return np.asarray(vectors / np.sqrt(values))

    def reduce(self, slopes: Array) -> Array:
        """Return (k, k) JᵀJ of slopes (N, k) with δ marginalised, in units of 1 / σ²."""
        across = slopes.T @ self.columns
        return np.asarray(slopes.T @ slopes - across @ np.linalg.solve(self.normal, across.T))


@dataclass(frozen=True, eq=False)
class Whitener:
    """The linear map W with WᵀW = V⁻¹ / w, which removes the possible changes by δ from residuals and slopes.

    Attributes:
        basis: (N, m) orthonormal directions.
        factor: (m,) W along each, between 0 and 1.
    """

    basis: Array
    factor: Array

    @staticmethod
    def from_sensitivities(columns: Array, precision: float) -> Whitener:
        """Return W for sensitivities B (N, m) and a precision 1 / (w s²) of the coefficients."""
        left, sizes, _ = np.linalg.svd(columns, full_matrices=False)
        return Whitener(left, 1.0 / np.sqrt(1.0 + sizes**2 / precision))

    def apply(self, values: Array) -> Array:
        """Return W times a vector (N,) or columns (N, k)."""
        return self._scaled(values, self.factor - 1.0)

    def undo(self, values: Array) -> Array:
        """Return the inverse of `apply`."""
        return self._scaled(values, 1.0 / self.factor - 1.0)

    def _scaled(self, values: Array, by: Array) -> Array:
        along = self.basis.T @ values
        return np.asarray(values + self.basis @ (by[:, None] * along if along.ndim > 1 else by * along))


def coefficient_precision(size: float, n_readings: int, n_effective: float, square: float) -> float:
    """Return 1 / (w s²), with σ² the `square` of the noise in a reading."""
    return n_readings * max(square, LEAST_SQUARE) / (max(n_effective, 2.0) * size**2)


def estimate(
    raw: Array, slopes: Array, pulls: Array, columns: Array, prior: LawErrorPrior, n_effective: float
) -> LawError:
    """Return the estimate of δ from the readings at a fit.

    The size is weighed with the parameters x refitted to first order, relative to an exact law; the coefficients are
    those at x.

    Args:
        raw: (N,) reading − prediction without δ, in noise floors.
        slopes: (N, k) of the parameters that may be refitted.
        pulls: (k,) their prior weights, in units of squared residuals.
        columns: (N, m) B.
        prior: of the size.
        n_effective: independent readings.
    """
    n, n_readings = max(n_effective, 2.0), len(raw)
    sizes, logs = prior.sizes, prior.log_weights
    whole = np.column_stack([slopes, columns])
    k = slopes.shape[1]
    gram, right, total = whole.T @ whole, whole.T @ raw, float(raw @ raw)
    gram[np.arange(k), np.arange(k)] += pulls + JITTER * (np.diag(gram)[:k] + 1.0)
    alone = gram[k:, k:] - gram[k:, :k] @ np.linalg.solve(gram[:k, :k], gram[:k, k:]) if k else gram
    known = np.maximum(np.linalg.eigvalsh(alone), 0.0)
    evidence, precisions = np.empty(len(sizes)), np.empty(len(sizes))
    squares = np.empty(len(sizes))
    for index, size in enumerate(sizes):
        square = max(total / n_readings, LEAST_SQUARE)
        for _ in range(ROUNDS):
            precision = coefficient_precision(float(size), n_readings, n, square)
            weighted = gram + np.diag(np.r_[np.zeros(k), np.full(len(gram) - k, precision)])
            best = np.linalg.solve(weighted, right)
            penalty = precision * float(best[k:] @ best[k:])
            left = max(total - float(best @ right) - penalty, 0.0) / n_readings
            square = max(left, LEAST_SQUARE)
        occam = 0.5 * float(np.sum(np.log1p(known / precision)))
        prior_cost = 0.5 * float(best[k:] @ best[k:]) / float(size) ** 2
        evidence[index] = -0.5 * n * np.log(square) - prior_cost - occam + logs[index]
        precisions[index], squares[index] = precision, square
    top = int(np.argmax(evidence))
    no_error = -0.5 * n * np.log(max(total / n_readings, LEAST_SQUARE)) + np.log(EXACT)
    every = np.r_[evidence + np.log(1.0 - EXACT), no_error]
    total_evidence = float(every.max() + np.log(np.sum(np.exp(every - every.max()))))
    price = -0.5 * n * float(np.log(squares[top])) - total_evidence
    precision = float(precisions[top])
    normal = columns.T @ columns + precision * np.eye(columns.shape[1])
    coefficient = np.asarray(np.linalg.solve(normal, columns.T @ raw), float)
    return LawError(columns, coefficient, float(sizes[top]), precision, max(price, 0.0))
