"""Gaussian process of a potential observed through its derivatives: values of τ and exact slopes.

Π(x), x = (p, u_1 … u_k) scaled to [−1, 1], has a polynomial trend of unknown coefficients and a residual with the
covariance σ² Π_d exp(−(x_d − x'_d)²/2ℓ_d²). The observations are derivatives of Π: first ones, τ_i = −∂Π/∂u_i, and
second ones, the slopes, so that the process applies to any number of axes and its slopes are always symmetric.
Covariances of derivatives are Hermite polynomials; the trend is integrated out and the lengths ℓ maximise the
restricted likelihood (Rasmussen & Williams, Gaussian Processes for Machine Learning, 2006, §§ 2.7, 5.4, 9.4).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from pliant.records.design import Array

Orders = NDArray[np.int64]

LENGTHS = (0.3, 20.0)  # bounds of ℓ; the box has the width 2
FIRST_LENGTH = 1.5
# Errors of observations as a share of their prior deviation: rounding of the solver and of the factorisation.
NUGGET = 1e-5
REFUSED = 1e10
# Differences of the cost below 0.1 are not significant; rounding is too large for the usual finite-difference step.
SEARCH = {"maxiter": 30, "ftol": 1e-6, "gtol": 1e-2, "eps": 1e-3}


def effort_orders(axes: int) -> Orders:
    """Return (k, 1 + k) derivatives of Π that are efforts."""
    return np.eye(1 + axes, dtype=np.int64)[1:]


def slope_orders(axes: int) -> Orders:
    """Return (k + k(k+1)/2, 1 + k) derivatives of Π that are slopes: ∂τ_i/∂p, then ∂τ_i/∂u_j with i ≤ j."""
    unit = np.eye(1 + axes, dtype=np.int64)
    by_p = [unit[0] + unit[1 + i] for i in range(axes)]
    by_u = [unit[1 + i] + unit[1 + j] for i in range(axes) for j in range(i, axes)]
    return np.array(by_p + by_u)


@dataclass(frozen=True, eq=False)
class Process:
    """The process conditioned on observations.

    Attributes:
        points: (n, d) scaled places.
        orders: (a, d) the derivatives observed at each of them.
        values: (n·a,) the observations, place by place.
        lengths: (d,) ℓ.
    """

    points: Array
    orders: Orders
    values: Array
    lengths: Array

    @cached_property
    def _trend_orders(self) -> Orders:
        """The powers of the trend: u_i, p u_i, u_i u_j."""
        k = self.points.shape[1] - 1
        return np.concatenate([effort_orders(k), slope_orders(k)])

    @cached_property
    def _factor(self) -> Array | None:
        K = _covariance(self.points, self.orders, self.points, self.orders, self.lengths)
        K[np.diag_indices_from(K)] *= 1 + NUGGET**2
        try:
            return np.asarray(np.linalg.cholesky(K), dtype=np.float64)
        except np.linalg.LinAlgError:
            return None

    @cached_property
    def _whitened(self) -> tuple[Array, Array, Array, Array]:
        """The whitened trend L⁻¹H = QR as (L⁻¹H, R), its coefficients and the whitened residual of the values."""
        assert self._factor is not None
        H = _monomials(self.points, self.orders, self._trend_orders)
        both = scipy.linalg.solve_triangular(self._factor, np.column_stack([H, self.values]), lower=True)
        trend, values = both[:, :-1], both[:, -1]
        Q, R = np.linalg.qr(trend)
        coefficients = scipy.linalg.solve_triangular(R, Q.T @ values)
        return trend, R, coefficients, values - trend @ coefficients

    @cached_property
    def variance(self) -> float:
        """σ², by maximum likelihood for the given lengths."""
        trend, _, _, rest = self._whitened
        return float(rest @ rest) / (len(rest) - trend.shape[1])

    def cost(self) -> float:
        """Return minus the logarithm of the restricted likelihood, up to a constant."""
        if self._factor is None:
            return REFUSED
        trend, R, _, rest = self._whitened
        free = len(rest) - trend.shape[1]
        spread = 0.5 * free * math.log(max(float(rest @ rest), 1e-300) / free)
        return float(spread + np.log(np.diag(self._factor)).sum() + np.log(np.abs(np.diag(R))).sum())

    def left_out(self) -> tuple[Array, Array]:
        """Return leave-one-out residuals and deviations, both (n,), of the first derivative at each place.

        With P the precision of the values after the trend, a left-out block has the residual P_BB⁻¹ (P y)_B with the
        covariance σ² P_BB⁻¹ (Dubrule 1983).
        """
        assert self._factor is not None
        trend, _, _, rest = self._whitened
        Q, _ = np.linalg.qr(trend)
        inverse = scipy.linalg.solve_triangular(self._factor, np.eye(len(rest)), lower=True)
        across = Q.T @ inverse
        P, known = inverse.T @ inverse - across.T @ across, inverse.T @ rest
        a = len(self.orders)
        blocks = [slice(start, start + a) for start in range(0, len(rest), a)]
        covariances = [np.linalg.inv(P[block, block]) for block in blocks]
        misses = [(C @ known[block])[0] for C, block in zip(covariances, blocks, strict=True)]
        spread = [max(self.variance * C[0, 0], 0.0) for C in covariances]
        return np.array(misses), np.sqrt(spread)

    def predict(self, points: Array, orders: Orders) -> tuple[Array, Array]:
        """Return mean and standard deviation, both (m, b), of derivatives `orders` (b, d) at `points` (m, d)."""
        trend, R, coefficients, rest = self._whitened
        crossed = _covariance(self.points, self.orders, points, orders, self.lengths)
        V = scipy.linalg.solve_triangular(self._factor, crossed, lower=True)
        H = _monomials(points, orders, self._trend_orders)
        mean = H @ coefficients + V.T @ rest
        T = scipy.linalg.solve_triangular(R, (H - V.T @ trend).T, trans=1)
        here = points[:1]
        prior = np.diag(_covariance(here, orders, here, orders, self.lengths))
        unknown = np.tile(prior, len(points)) - np.einsum("ij,ij->j", V, V)
        variance = self.variance * (unknown + np.einsum("ij,ij->j", T, T))
        shape = (len(points), len(orders))
        return mean.reshape(shape), np.sqrt(np.maximum(variance, 0.0)).reshape(shape)


def fit(points: Array, orders: Orders, values: Array, near: Array | None = None) -> Process:
    """Fit the lengths by maximum restricted likelihood, starting from those of `near` or from a fixed start."""
    bounds = [tuple(np.log(LENGTHS))] * points.shape[1]

    def cost(logarithms: Array) -> float:
        return Process(points, orders, values, np.exp(logarithms)).cost()

    start = np.full(points.shape[1], FIRST_LENGTH) if near is None else near
    best = scipy.optimize.minimize(cost, np.log(start), method="L-BFGS-B", bounds=bounds, options=SEARCH)
    lengths = np.exp(best.x)
    while Process(points, orders, values, lengths)._factor is None:
        lengths = 0.7 * lengths  # shorter lengths are always positive definite
    return Process(points, orders, values, lengths)


def _covariance(X: Array, A: Orders, Y: Array, B: Orders, lengths: Array) -> Array:
    """Return (n·a, m·b) covariances, for σ = 1, of derivatives A at X (n, d) with derivatives B at Y (m, d)."""
    by_dimension = [
        _derivatives((X[:, None, d] - Y[None, :, d]) / lengths[d], lengths[d]) for d in range(X.shape[1])
    ]
    out = np.empty((len(X), len(A), len(Y), len(B)))
    for i, a in enumerate(A):
        for j, b in enumerate(B):
            block = np.full((len(X), len(Y)), (-1.0) ** int(a.sum()))
            for d, table in enumerate(by_dimension):
                block *= table[int(a[d] + b[d])]
            out[:, i, :, j] = block
    return out.reshape(len(X) * len(A), len(Y) * len(B))


def _derivatives(r: Array, length: float) -> list[Array]:
    """Return He_n(r) exp(−r²/2) / ℓⁿ for n = 0 … 4: derivatives up to the sign, which alternates with those of x."""
    he = [np.ones_like(r), r, r * r - 1, r * (r * r - 3), (r * r - 6) * r * r + 3]
    bell = np.exp(-r * r / 2)
    return [polynomial * bell / length**n for n, polynomial in enumerate(he)]


def _monomials(points: Array, orders: Orders, powers: Orders) -> Array:
    """Return (n·a, q) derivatives `orders` of the monomials x^powers."""
    out = np.zeros((len(points), len(orders), len(powers)))
    for i, a in enumerate(orders):
        for j, power in enumerate(powers):
            left = power - a
            if np.all(left >= 0):
                factor = math.prod(math.perm(int(n), int(k)) for n, k in zip(power, a, strict=True))
                out[:, i, j] = factor * np.prod(points**left, axis=1)
    return out.reshape(len(points) * len(orders), len(powers))
