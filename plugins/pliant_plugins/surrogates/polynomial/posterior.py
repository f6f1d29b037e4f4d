"""Least squares with or without a prior: coefficients, their uncertainty, and leave-one-out errors.

The prior takes all terms of the largest degree at once, each held back by how smooth the data say the law is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import lgamma

import numpy as np
import scipy  # scipy.stats, half a second, only where a law is fitted
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from pliant.records.design import Array
from pliant.records.error_bar import BORDER, FEWEST_INNER, ErrorBar
from pliant_plugins.surrogates.polynomial.system import System, Terms, values_at

# Candidates of the radii ρ and of the noise, as variances against the prior's. Below the smallest the data's own
# rounding (an FEM mesh, a solver's tolerance) would be fitted.
RADII = ((0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0), (0.5, 1.0, 1.5, 2.0, 3.0, 4.0))
NOISES = tuple(10.0**power for power in range(-10, 1))


@dataclass(frozen=True, eq=False)
class CoefficientPrior:
    """Standard deviations (k,) of the terms and the noise's variance, both in units of one common scale.

    Attributes:
        radii: ρ_p, ρ_u.
    """

    deviations: Array
    noise: float
    radii: tuple[float, float]


def all_terms(degree: int, potential: bool = False) -> Terms:
    """Return exponents up to a total degree; with `potential` those without effort too (`System.rows`)."""
    efforts = [(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]
    return np.array(efforts + [(i, -1) for i in range(degree + 2) if potential])


def fit_prior(system: System, terms: Terms) -> CoefficientPrior:
    """Return the prior with the highest marginal likelihood.

    Coefficients c_ij of Chebyshev terms are normal with deviations s ρ_p^−i ρ_u^−j / √(i + j)!, those of total
    degree 0 and 1 with s: functions as smooth as those of a Gaussian kernel, whose Taylor coefficients fall like
    that. The rows have normal noise. s is eliminated; ρ_p, ρ_u and the noise maximise the evidence (MacKay, Neural
    Computation 4, 1992) over `RADII` and `NOISES`.
    """
    matrix, right, _ = system.rows(terms)
    m = len(right)
    # An orthogonal transformation of the rows keeps the evidence: k + 1 rows are equivalent to m.
    compact: Array = np.asarray(np.linalg.qr(np.column_stack([matrix, right]), mode="r"))
    best: tuple[float, CoefficientPrior] | None = None
    for radii, deviations in _deviations(terms):
        scaled = compact[:, :-1] * deviations
        variances, basis = np.linalg.eigh(scaled @ scaled.T)
        inner = (basis.T @ compact[:, -1]) ** 2
        for noise in NOISES:
            total = np.maximum(variances, 0.0) + noise
            scale = np.sum(inner / total) / m
            evidence = -0.5 * (m * np.log(scale) + np.log(total).sum() + (m - len(total)) * np.log(noise))
            if best is None or evidence > best[0]:
                best = evidence, CoefficientPrior(deviations, noise, radii)
    assert best is not None
    return best[1]


def _deviations(terms: Terms) -> Iterator[tuple[tuple[float, float], Array]]:
    i, j = terms.T
    factorial = np.exp([lgamma(max(degree, 0) + 1) / 2 for degree in terms.sum(axis=1)])
    for along_p in RADII[0]:
        for along_u in RADII[1]:
            deviations = along_p ** -i.astype(float) * along_u ** -j.astype(float) / factorial
            deviations[i + j <= 1] = deviations[j >= 0].max()
            yield (along_p, along_u), deviations


RANK_TOLERANCE = 1e-10
# Points of the box at which the bar's shape is kept, and how far each of them reaches.
PLACES = 256
REACH = 0.1
# A state that the others do not determine at all cannot be left out.
DETERMINED = 1e-11
FEWEST_SCORES = 4


def solve(matrix: Array, right: Array, prior: CoefficientPrior | None = None) -> Array | None:
    """Solve for the coefficients (k,); None if there is no prior and the rows do not determine all of them."""
    solution: Array
    if prior is not None:
        held = np.sqrt(prior.noise) * np.eye(matrix.shape[1])
        stacked = np.concatenate([matrix * prior.deviations, held])
        zeros = np.zeros(matrix.shape[1])
        solution = np.linalg.lstsq(stacked, np.concatenate([right, zeros]), rcond=None)[0]
        return solution * prior.deviations
    if len(matrix) < matrix.shape[1]:
        return None
    solution, _, rank, _ = np.linalg.lstsq(matrix, right, rcond=RANK_TOLERANCE)  # type: ignore[assignment]
    return solution if rank == matrix.shape[1] else None


@dataclass(frozen=True, eq=False)
class CoefficientPosterior:
    """A solved system.

    Attributes:
        terms: (k, 2) exponents.
        prior: None for plain least squares.
        solution: (k,) coefficients over the effort's range.
        root: (k, k) upper triangle R with RᵀR the precision of the (scaled) coefficients for a noise of 1.
    """

    system: System
    terms: Terms
    prior: CoefficientPrior | None
    solution: Array
    root: Array

    @staticmethod
    def from_system(
        system: System, terms: Terms, prior: CoefficientPrior | None = None
    ) -> CoefficientPosterior | None:
        """Compute the posterior of the terms; None if the states do not determine them."""
        matrix, right, _ = system.rows(terms)
        solution = solve(matrix, right, prior)
        if solution is None:
            return None
        rows = matrix * _scales(terms, prior)
        if prior is not None:
            rows = np.concatenate([rows, np.sqrt(prior.noise) * np.eye(len(terms))])
        return CoefficientPosterior(system, terms, prior, solution, np.asarray(np.linalg.qr(rows, mode="r")))

    @property
    def potential(self) -> bool:
        """Return whether energies and travels of the states are fitted."""
        return bool((self.terms[:, 1] < 0).any())

    def effective_terms(self) -> float:
        """Return the trace of the hat matrix from given to predicted values."""
        return float(np.sum(self._whitened(self.system.rows(self.terms)[0]) ** 2))

    def shape(self, x: Array, v: Array) -> Array:
        """Return (n,) predictive deviation at points of [−1, 1]², for a noise of 1."""
        doubt = np.sum(self._whitened(values_at(self.terms, x, v)) ** 2, axis=1)
        return np.sqrt(1 + doubt)

    def scores(self) -> Array:
        """Return (s,) sizes of left-out errors of values, each over its predictive deviation for a noise of 1.

        With Q Qᵀ the hat matrix and r the residuals, rows G that are left out together miss by
        e = (1 − Q_G Q_Gᵀ)⁻¹ r_G, and the inverse is their covariance (Allen's PRESS in blocks; Technometrics 16,
        1974). All rows of a state go together; on a grid all states of a fold do. With energies states tell so much
        of their neighbours that those on the border, predicted from one side, miss by far more than any inside: the
        scores are then of states inside, where there are enough.
        """
        matrix, right, state = self.system.rows(self.terms)
        residuals, hats = right - matrix @ self.solution, self._whitened(matrix)
        n = len(self.system.x)
        groups = self.system.folds if self.system.grid else [np.arange(n) == k for k in range(n)]
        inside = np.maximum(np.abs(self.system.x), np.abs(self.system.v)) < 1 - BORDER
        keep = inside if self.potential and inside.sum() >= FEWEST_INNER else np.ones(n, bool)
        found = [_left_out(residuals, hats, np.flatnonzero(group[state]), keep) for group in groups]
        return np.concatenate(found)

    def misses(self) -> Array:
        """Return (n,) leave-one-out errors, value minus prediction; NaN if the others do not determine it."""
        matrix, right, state = self.system.rows(self.terms)
        residuals, hats = right - matrix @ self.solution, self._whitened(matrix)
        missed = np.full(len(self.system.x), np.nan)
        for k in range(len(missed)):
            rows = np.flatnonzero(state == k)  # the state's value comes first
            inner = np.eye(len(rows)) - hats[rows] @ hats[rows].T
            if np.linalg.eigvalsh(inner)[0] >= DETERMINED:
                missed[k] = np.linalg.solve(inner, residuals[rows])[0]
        return missed

    def error_bar(self) -> ErrorBar | None:
        """Return the bar with the predictive deviation scaled by the scores; None for too few of them."""
        scores = self.scores()
        if len(scores) < FEWEST_SCORES:
            return None
        places = 2 * scipy.stats.qmc.Sobol(2, scramble=False).random(PLACES) - 1
        domain = self.system.domain
        box = np.vstack([domain.actuation, domain.deformation])
        sizes = self.shape(places[:, 0], places[:, 1]) * self.system.range
        return ErrorBar.from_shape(box, places, sizes[:, None], scores[:, None], REACH)

    def _whitened(self, rows: Array) -> Array:
        """Return (m, k) rows R⁻¹, in the scaled coefficients."""
        scaled = rows * _scales(self.terms, self.prior)
        return solve_triangular(self.root, scaled.T, trans="T").T


def _scales(terms: Terms, prior: CoefficientPrior | None) -> Array:
    return np.ones(len(terms)) if prior is None else prior.deviations


def _left_out(residuals: Array, hats: Array, rows: NDArray[np.int64], keep: NDArray[np.bool_]) -> Array:
    """Return scores of the values of the states to keep (n,) among the rows that are left out together."""
    inner = np.eye(len(rows)) - hats[rows] @ hats[rows].T
    if len(rows) == 0 or np.linalg.eigvalsh(inner)[0] < DETERMINED:
        return np.zeros(0)
    covariance = np.linalg.inv(inner)
    values = rows < len(keep)
    values[values] = keep[rows[values]]
    return np.abs(covariance @ residuals[rows])[values] / np.sqrt(np.diag(covariance)[values])
