"""How sure fitted constants are, and which combinations the data do not decide.

With weighted residuals r (n,) and slopes J (n, k): covariance s² (JᵀJ)⁻¹, s² = Σ r²/(n − k); where the file states the
standard deviations, s² = max(1, Σ r²/(n − k)), for they may be too hopeful but not the fit's proof. Neighbouring
residuals that are alike (a law that misses the curve a little) are worth fewer: n is replaced by n (1 − ρ)/(1 + ρ), ρ
their correlation. With three specimens or more, what separates them counts if it is more: each specimen's constants are
taken to first order, and the standard deviation of their mean is compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pliant.calibration.constants import Constant
from pliant.calibration.fitting import Fit
from pliant.records.design import Array
from pliant.records.fem import IntArray

SINGULAR = 1e-7  # of the largest singular value
# FEM and geometry err by about 1 % of a curve: what moves it by less, when a quarter of the modulus is shifted from one
# constant to another, is not to be read from it, however smooth the data.
SHIFT, MODEL_ERROR = 0.25, 0.01
ENOUGH_SPECIMENS = 3


@dataclass(frozen=True, eq=False)
class Certainty:
    """Uncertainty of k constants.

    Attributes:
        covariance: (k, k) in SI; infinite where the data decide nothing.
        correlation: (k, k).
        source: what the standard deviations come from: "residuals", "stated sigma" or "specimens".
        n_effective: how many independent readings the data are worth.
        chi2: Σ r²/(n − k) in units of the stated variances; NaN where none are stated.
        strongest: (k,) the combination that the data decide best, in units of `scales`.
        strongest_sd: its standard deviation.
    """

    covariance: Array
    correlation: Array
    source: str
    n_effective: float
    chi2: float
    strongest: Array
    strongest_sd: float

    @property
    def sd(self) -> Array:
        """(k,) in SI."""
        return np.asarray(np.sqrt(np.diag(self.covariance)), float)

    def sd_of(self, gradient: Array) -> float:
        """Of a quantity with this gradient by the constants."""
        return float(np.sqrt(max(float(gradient @ self.covariance @ gradient), 0.0)))


def certainty(fit: Fit, scales: Array, order: IntArray, specimen: np.ndarray, stated: bool) -> Certainty:
    """The certainty of a fit.

    Args:
        fit: the minimum.
        scales: (k,) sizes of the constants, in which they are compared.
        order: (n,) indices that put rows of one specimen and test in the order of x.
        specimen: (n,) names, empty where there are none.
        stated: whether residuals are in units of stated standard deviations.
    """
    n, k = fit.jacobian.shape
    n_effective = n * _worth(fit.residuals[order])
    chi2 = float(fit.residuals @ fit.residuals) / max(n - k, 1)
    variance = (max(1.0, chi2) if stated else chi2) * n / n_effective
    _, singular, right = np.linalg.svd(fit.jacobian * scales, full_matrices=False)
    if singular[-1] <= SINGULAR * singular[0]:
        covariance = np.full((k, k), np.inf)
    else:
        covariance = (right.T / singular**2) @ right * variance * np.outer(scales, scales)
    source = "stated sigma" if stated else "residuals"
    between = _between(fit, scales, specimen)
    if between is not None and np.all(np.isfinite(covariance)):
        wider = np.maximum(1.0, between / np.sqrt(np.diag(covariance)))
        source = "specimens" if np.any(wider > 1) else source
        covariance = covariance * np.outer(wider, wider)
    with np.errstate(invalid="ignore"):
        spread = np.sqrt(np.diag(covariance))
        correlation = covariance / np.outer(spread, spread)
    strongest = right[0] * np.sign(right[0][np.argmax(np.abs(right[0]))])
    sd = float(np.sqrt(variance) / singular[0])
    return Certainty(covariance, correlation, source, n_effective, chi2 if stated else np.nan, strongest, sd)


def _worth(residuals: Array) -> float:
    """(1 − ρ)/(1 + ρ) of the correlation ρ of neighbours, 1 where it is not positive."""
    total = float(residuals @ residuals)
    rho = float(residuals[1:] @ residuals[:-1]) / total if total > 0 else 0.0
    rho = min(max(rho, 0.0), 1 - 2 / (len(residuals) + 1))
    return (1 - rho) / (1 + rho)


def _between(fit: Fit, scales: Array, specimen: np.ndarray) -> Array | None:
    """(k,) standard deviation of the mean over specimens; None with fewer than `ENOUGH_SPECIMENS` that decide."""
    moved = []
    for name in np.unique(specimen):
        rows = specimen == name
        slopes = fit.jacobian[rows] * scales
        _, singular, _ = np.linalg.svd(slopes, full_matrices=False)
        if rows.sum() >= len(scales) and singular[-1] > 1e-4 * singular[0]:
            moved.append(-np.linalg.lstsq(slopes, fit.residuals[rows], rcond=None)[0] * scales)
    if len(moved) < ENOUGH_SPECIMENS:
        return None
    return np.asarray(np.std(moved, axis=0, ddof=1) / np.sqrt(len(moved)), float)


def hidden_by_model_error(jacobian: Array, scales: Array) -> NDArray[np.bool_]:
    """Which constants (k,) take part in a change that a computed curve hides; residuals in units of the range."""
    _, singular, right = np.linalg.svd(jacobian * scales, full_matrices=False)
    moved = SHIFT * singular / np.sqrt(len(jacobian))
    weak = np.abs(right[moved < MODEL_ERROR])
    return np.asarray(np.any(weak > 0.3, axis=0), bool)


def undetermined(constants: Sequence[Constant], sd: Array, modulus_pa: float) -> tuple[Constant, ...]:
    """Constants whose standard deviation exceeds a third of their size and the solid's modulus (½ for a power)."""
    return tuple(
        constant
        for constant, spread in zip(constants, sd, strict=True)
        if not spread < max(abs(constant.value) / 3, modulus_pa if constant.is_modulus else 0.5)
    )
