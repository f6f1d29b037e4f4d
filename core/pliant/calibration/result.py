"""Fitted constants of a material, and sentences on how far they can be told apart and how far the law fits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.calibration.certainty import Certainty
from pliant.calibration.constants import Constant
from pliant.calibration.reading import BenchData
from pliant.formatting import display_unit, listed, number, quantity, unit_of, whole_percent, with_sd
from pliant.interfaces.material import MaterialConfig
from pliant.records.design import Array

ALIKE = 0.98  # correlation from which constants trade places
POOR_FIT = 0.05  # rms over the range from which the law is doubted
SMALL_SHARE = 0.05


@dataclass(frozen=True, eq=False)
class Calibration:
    """Fitted constants of a material.

    Attributes:
        config: the material's block with the fitted constants.
        constants: those that were fitted, with their values.
        certainty: their covariance, in the same order.
        undetermined: those among them that the data do not decide.
        shear_modulus_pa, shear_modulus_sd_pa: μ₀ of the fitted law.
        data: what was fitted.
        predicted: (n,) the law's values at the data's rows.
        converged: whether the search ended at a minimum.
        fem_states: how many FEM states it took.
        remarks: what the reader should know before using the constants.
    """

    config: MaterialConfig
    constants: tuple[Constant, ...]
    certainty: Certainty
    undetermined: tuple[Constant, ...]
    shear_modulus_pa: float
    shear_modulus_sd_pa: float
    data: BenchData
    predicted: Array
    converged: bool
    fem_states: int
    remarks: tuple[str, ...]

    @property
    def rmse(self) -> float:
        """Root mean square of the law's misfit, in SI."""
        return float(np.sqrt(np.mean((self.predicted - self.data.y) ** 2)))

    @property
    def rmse_of_range(self) -> float:
        """The same over the span of the measured column, 0 included."""
        return self.rmse / float(np.ptp(np.append(self.data.y, 0.0)))

    @property
    def covered(self) -> str:
        """Which part of the law the data have seen, in words."""
        low, high = float(self.data.x.min()), float(self.data.x.max())
        if self.data.kind == "tensile":
            return f"stretch {low:.3g} to {high:.3g}"
        words = unit_of(self.data.x_name)
        return f"{words.label} {number(low * words.factor, 3)} to {words.text(high, 3)}"


def remarks_of(found: Calibration, scales: Array, touching: float | None, hidden: bool) -> list[str]:
    """Sentences on a calibration.

    Args:
        found: the calibration.
        scales: (k,) sizes of its constants.
        touching: the actuation at which convolutions meet, if they do.
        hidden: whether constants could trade places within what FEM itself errs by.
    """
    remarks = []
    if found.undetermined:
        remarks.append(_undetermined(found, scales, hidden))
    else:
        remarks += [*_exchangeable(found), *_near_zero(found)]
    if found.rmse_of_range > POOR_FIT:
        remarks.append(
            f"The law misses the data by {whole_percent(found.rmse_of_range)} of their range: another law, or a wrong "
            "unit, geometry or test?"
        )
    if found.certainty.chi2 > 2:
        remarks.append(
            f"The misfit is {number(np.sqrt(found.certainty.chi2), 2)} times the stated sigma; standard deviations are "
            "widened by that."
        )
    if not found.converged:
        remarks.append("The fit still moved when it was stopped; look at the error before you believe it.")
    if touching is not None:
        words = unit_of(found.data.x_name)
        remarks.append(
            f"From {words.text(touching, 3)} on convolutions touch, which the FEM does not resolve; leave such rows "
            "out."
        )
    return remarks


def _undetermined(found: Calibration, scales: Array, hidden: bool) -> str:
    names = listed([c.written for c in found.undetermined])
    known, value, sd = _determined(found, scales)
    if not all(c.is_modulus for c in found.constants) and np.isfinite(found.shear_modulus_sd_pa):
        known, value, sd = "the shear modulus at rest", found.shear_modulus_pa, found.shear_modulus_sd_pa
    advice = (
        "measure the rubber in a uniaxial test (--test uniaxial)"
        if found.data.kind == "free"
        else "test at larger stretch or in another mode (column test: equibiaxial, planar)"
    )
    verb = "is" if len(found.undetermined) == 1 else "are"
    only = f"determined is {known} = {with_sd(value, sd, display_unit('Pa'))}" if known else ""
    why = (
        "; a quarter of the modulus shifted from one to the other moves the curve by less than 1 % of its range, which "
        "FEM and geometry err by"
        if hidden
        else ""
    )
    return (
        f"These data do not tell {names}{' apart' if len(found.undetermined) > 1 else ''}: "
        f"{only or 'the effect is below their noise'}, and {names} {verb} free beside it{why}. "
        f"Fit fewer constants (--fit), or {advice}."
    )


def _determined(found: Calibration, scales: Array) -> tuple[str, float, float]:
    """The combination of moduli that the data decide best, its value and standard deviation in Pa."""
    weights = found.certainty.strongest / scales
    moduli = np.array([c.is_modulus for c in found.constants])
    if not moduli.any():
        return "", 0.0, 0.0
    largest = float(np.abs(weights[moduli]).max())
    weights = weights / largest
    terms = []
    for constant, weight in zip(found.constants, weights, strict=True):
        if constant.is_modulus and abs(weight) >= SMALL_SHARE:
            factor = "" if abs(abs(weight) - 1) < 5e-3 else f"{abs(weight):.2f} "
            terms.append(f"{'−' if weight < 0 else '+'} {factor}{constant.written}")
    values = np.array([c.value for c in found.constants])
    text = " ".join(terms).removeprefix("+ ")
    return text, float(weights[moduli] @ values[moduli]), found.certainty.strongest_sd / largest


def _exchangeable(found: Calibration) -> list[str]:
    remarks = []
    for i, first in enumerate(found.constants):
        for j, second in enumerate(found.constants[:i]):
            rho = float(found.certainty.correlation[i, j])
            if abs(rho) > ALIKE:
                remarks.append(
                    f"{second.written} and {first.written} nearly trade places in these data (correlation "
                    f"{number(rho, 4)}): what they give together is surer than each alone."
                )
    return remarks


def _near_zero(found: Calibration) -> list[str]:
    if len(found.constants) < 2:
        return []
    return [
        f"{c.written} is not told from zero (± {quantity(sd, 'Pa' if c.is_modulus else '', 2)}): a "
        "law without it fits these data as well."
        for c, sd in zip(found.constants, found.certainty.sd, strict=True)
        if abs(c.value) < 2 * sd
    ]
