"""Fitted constants of a material, and sentences on their identifiability and the quality of the fit.

With weighted residuals r (n,) and slopes J (n, k): covariance s² (JᵀJ)⁻¹, s² = Σ r²/(n − k); if the file states the
standard deviations, s² = max(1, Σ r²/(n − k)), since these may be too small. Correlated neighbouring residuals (a law
that deviates systematically from the curve) reduce the effective sample size: n is replaced by n (1 − ρ)/(1 + ρ), ρ
their correlation. With three specimens or more, the scatter between specimens is used if it is larger: the standard
deviation of the mean of each specimen's constants, to first order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pliant.formatting import display_unit, listed, number, output_unit, quantity, whole_percent, with_sd
from pliant.interfaces.material import MaterialConfig
from pliant.records.design import Array
from pliant.records.fem import IntArray
from pliant_calibrate.fitting import Fit, MaterialConstant
from pliant_calibrate.nearest import NearMaterial
from pliant_calibrate.reading import BenchData
from pliant_calibrate.volume import Volume

SINGULAR = 1e-7  # of the largest singular value
# FEM and geometry have an error of about 1 % of a curve. If shifting a quarter of the modulus from one constant to
# another changes the curve by less, the constants cannot be identified, however smooth the data.
SHIFT, MODEL_ERROR = 0.25, 0.01
ENOUGH_SPECIMENS = 3


@dataclass(frozen=True, eq=False)
class Certainty:
    """Uncertainty of k constants.

    Attributes:
        covariance: (k, k) in SI; infinite where the data determine nothing.
        correlation: (k, k).
        source: of the standard deviations: "residuals", "stated sigma" or "specimens".
        n_effective: effective sample size of the data.
        chi2: Σ r²/(n − k) in units of the stated variances; NaN without stated variances.
        strongest: (k,) the combination that the data determine best, in units of `scales`.
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
        """Return (k,) standard deviations of the constants, SI."""
        return np.asarray(np.sqrt(np.diag(self.covariance)), float)

    def standard_deviation(self, gradient: Array) -> float:
        """Return the standard deviation of a quantity with this gradient by the constants."""
        with np.errstate(invalid="ignore"):  # an infinite covariance
            return float(np.sqrt(max(float(gradient @ self.covariance @ gradient), 0.0)))


def certainty(fit: Fit, scales: Array, order: IntArray, specimen: np.ndarray, stated: bool) -> Certainty:
    """Return the uncertainty of a fit.

    Args:
        fit: the minimum.
        scales: (k,) sizes of the constants, in which they are compared.
        order: (n,) indices that sort rows of one specimen and test by x.
        specimen: (n,) names, empty without specimens.
        stated: whether residuals are in units of stated standard deviations.
    """
    n, k = fit.jacobian.shape
    n_effective = n * _worth(fit.residuals[order])
    chi2 = float(fit.residuals @ fit.residuals) / max(n - k, 1)
    variance = (max(1.0, chi2) if stated else chi2) * n / n_effective
    _, singular, right = np.linalg.svd(fit.jacobian * scales, full_matrices=False)
    covariance = _covariance(fit.jacobian, variance)
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


def _covariance(jacobian: Array, variance: float) -> Array:
    """Return s² (JᵀJ)⁻¹ (k, k), infinite where slopes (n, k) of different constants are dependent; scale-invariant."""
    sizes = np.linalg.norm(jacobian, axis=0)
    if not np.all(sizes > 0):
        return np.full((len(sizes), len(sizes)), np.inf)
    _, singular, right = np.linalg.svd(jacobian / sizes, full_matrices=False)
    if singular[-1] <= SINGULAR * singular[0]:
        return np.full((len(sizes), len(sizes)), np.inf)
    return np.asarray((right.T / singular**2) @ right * variance / np.outer(sizes, sizes), float)


def _worth(residuals: Array) -> float:
    """Return (1 − ρ)/(1 + ρ) of the correlation ρ of neighbours, 1 if it is not positive."""
    total = float(residuals @ residuals)
    rho = float(residuals[1:] @ residuals[:-1]) / total if total > 0 else 0.0
    rho = min(max(rho, 0.0), 1 - 2 / (len(residuals) + 1))
    return (1 - rho) / (1 + rho)


def _between(fit: Fit, scales: Array, specimen: np.ndarray) -> Array | None:
    """Return (k,) standard deviation of the mean over specimens; None below `ENOUGH_SPECIMENS` usable ones."""
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
    """Return which constants (k,) a computed curve cannot identify; residuals are relative to the range."""
    _, singular, right = np.linalg.svd(jacobian * scales, full_matrices=False)
    moved = SHIFT * singular / np.sqrt(len(jacobian))
    weak = np.abs(right[moved < MODEL_ERROR])
    return np.asarray(np.any(weak > 0.3, axis=0), bool)


def undetermined(
    constants: Sequence[MaterialConstant], sd: Array, modulus_pa: float
) -> tuple[MaterialConstant, ...]:
    """Return the constants with a standard deviation above a third of their size and of the modulus (power: ½)."""
    return tuple(
        constant
        for constant, spread in zip(constants, sd, strict=True)
        if not spread < max(abs(constant.value) / 3, modulus_pa if constant.is_modulus else 0.5)
    )


ALIKE = 0.98  # correlation from which constants are interchangeable
POOR_FIT = 0.05  # rms over the range from which the law is questioned
SMALL_SHARE = 0.05


@dataclass(frozen=True, eq=False)
class Calibration:
    """Fitted constants of a material.

    Attributes:
        config: the material's block with the fitted constants.
        constants: those that were fitted, with their values.
        certainty: their covariance, in the same order.
        undetermined: those among them that the data do not determine.
        shear_modulus_pa, shear_modulus_sd_pa: μ₀ of the fitted law.
        data: fitted data.
        predicted: (n,) the law's values at the data's rows.
        converged: whether the search ended at a minimum.
        fem_states: number of solved FEM states.
        volume: assumption on the change of volume.
        nearest: named rubbers with the closest stress, the closest first.
        remarks: sentences to read before using the constants.
    """

    config: MaterialConfig
    constants: tuple[MaterialConstant, ...]
    certainty: Certainty
    undetermined: tuple[MaterialConstant, ...]
    shear_modulus_pa: float
    shear_modulus_sd_pa: float
    data: BenchData
    predicted: Array
    converged: bool
    fem_states: int
    volume: Volume
    nearest: tuple[NearMaterial, ...]
    remarks: tuple[str, ...]

    @property
    def rmse(self) -> float:
        """Return the root mean square of the law's misfit, in SI."""
        return float(np.sqrt(np.mean((self.predicted - self.data.y) ** 2)))

    @property
    def rmse_of_range(self) -> float:
        """Return the `rmse` relative to the span of the measured column, 0 included."""
        return self.rmse / float(np.ptp(np.append(self.data.y, 0.0)))

    @property
    def covered(self) -> str:
        """Return the part of the law that the data cover, in words."""
        low, high = float(self.data.x.min()), float(self.data.x.max())
        if self.data.kind == "tensile":
            return f"stretch {low:.3g} to {high:.3g}"
        words = output_unit(self.data.x_name)
        return f"{words.label} {number(low * words.factor, 3)} to {words.text(high, 3)}"


def calibration_remarks(
    calibration: Calibration, scales: Array, touching: float | None, hidden: bool
) -> list[str]:
    """Return the sentences on a calibration.

    Args:
        calibration: the calibration.
        scales: (k,) sizes of its constants.
        touching: the actuation at which convolutions meet, if they do.
        hidden: whether constants are interchangeable within the error of FEM.
    """
    remarks = []
    if calibration.undetermined:
        remarks.append(_undetermined(calibration, scales, hidden))
    else:
        remarks += [*_exchangeable(calibration), *_near_zero(calibration)]
    if calibration.rmse_of_range > POOR_FIT:
        remarks.append(
            f"The law misses the data by {whole_percent(calibration.rmse_of_range)} of their range: another law, or a "
            "wrong unit, geometry or test?"
        )
    if calibration.certainty.chi2 > 2:
        remarks.append(
            f"The misfit is {number(np.sqrt(calibration.certainty.chi2), 2)} times the stated sigma; standard "
            "deviations are widened by that."
        )
    if not calibration.converged:
        remarks.append(
            "The fit had not converged when it was stopped: these data hardly separate its constants. Fit fewer terms "
            "or constants (--fit), add a second kind of test, or continue from these values (--out, then calibrate "
            "again)."
        )
    if touching is not None:
        words = output_unit(calibration.data.x_name)
        remarks.append(
            f"From {words.text(touching, 3)} on convolutions touch, which the FEM does not resolve; leave such rows "
            "out."
        )
    return remarks


def _undetermined(calibration: Calibration, scales: Array, hidden: bool) -> str:
    names = listed([c.written for c in calibration.undetermined])
    known, value, sd = _determined(calibration, scales)
    if not all(c.is_modulus for c in calibration.constants) and np.isfinite(calibration.shear_modulus_sd_pa):
        known, value, sd = (
            "the shear modulus at rest",
            calibration.shear_modulus_pa,
            calibration.shear_modulus_sd_pa,
        )
    advice = (
        "measure the rubber in a uniaxial test (--test uniaxial)"
        if calibration.data.kind == "free"
        else "test at larger stretch or in another mode (column test: equibiaxial, planar)"
    )
    verb = "is" if len(calibration.undetermined) == 1 else "are"
    only = f"determined is {known} = {with_sd(value, sd, display_unit('Pa'))}" if known else ""
    why = (
        "; a quarter of the modulus shifted from one to the other moves the curve by less than 1 % of its range, the "
        "error of FEM and geometry"
        if hidden
        else ""
    )
    return (
        f"These data do not determine {names}{' separately' if len(calibration.undetermined) > 1 else ''}: "
        f"{only or 'the effect is below their noise'}, and {names} {verb} free beside it{why}. "
        f"Fit fewer constants (--fit), or {advice}."
    )


def _determined(calibration: Calibration, scales: Array) -> tuple[str, float, float]:
    """Return the combination of moduli that the data determine best, its value and standard deviation in Pa."""
    weights = calibration.certainty.strongest / scales
    moduli = np.array([c.is_modulus for c in calibration.constants])
    if not moduli.any():
        return "", 0.0, 0.0
    largest = float(np.abs(weights[moduli]).max())
    weights = weights / largest
    terms = []
    for constant, weight in zip(calibration.constants, weights, strict=True):
        if constant.is_modulus and abs(weight) >= SMALL_SHARE:
            factor = "" if abs(abs(weight) - 1) < 5e-3 else f"{abs(weight):.2f} "
            terms.append(f"{'−' if weight < 0 else '+'} {factor}{constant.written}")
    values = np.array([c.value for c in calibration.constants])
    text = " ".join(terms).removeprefix("+ ")
    return text, float(weights[moduli] @ values[moduli]), calibration.certainty.strongest_sd / largest


def _exchangeable(calibration: Calibration) -> list[str]:
    remarks = []
    for i, j in zip(*np.tril_indices(len(calibration.constants), -1), strict=True):
        first, second, rho = (
            calibration.constants[i],
            calibration.constants[j],
            float(calibration.certainty.correlation[i, j]),
        )
        if abs(rho) > ALIKE:
            remarks.append(
                f"{second.written} and {first.written} are strongly correlated in these data (correlation "
                f"{number(rho, 4)}): their combination is known better than each alone."
            )
    return remarks


def _near_zero(calibration: Calibration) -> list[str]:
    if len(calibration.constants) < 2:
        return []
    return [
        f"{c.written} does not differ significantly from zero (± {quantity(sd, 'Pa' if c.is_modulus else '', 2)}): a "
        "law without it fits these data as well."
        for c, sd in zip(calibration.constants, calibration.certainty.sd, strict=True)
        if abs(c.value) < 2 * sd
    ]
