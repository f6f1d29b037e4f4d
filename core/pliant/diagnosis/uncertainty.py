"""Uncertainty of a fit's parameters: standard deviations, correlation, profile intervals.

Residuals r are in units of the noise floor. Noise is autocorrelated: N readings are equivalent to n_eff independent
ones, each of which adds

    s² = Σ r² / (n_eff − k)

to Σ r² by chance, k parameters fitted. The covariance in the parameters' x is s² (JᵀJ)⁻¹, in a parameter's own unit
times dv/dx (delta method), with the prior of forms that vary. A profile interval contains the values of one parameter
at which Σ r², all other parameters refitted, rises by less than s² · 2.706, the 90 % point of χ² with one degree of
freedom (Venzon & Moolgavkar, Applied Statistics 37, 1988): it follows bounds and curved valleys, unlike a standard
deviation.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from pliant.diagnosis.candidates import NINETY, EffectSet
from pliant.diagnosis.effect_fit import EffectFit
from pliant.diagnosis.fitting import Fitter
from pliant.diagnosis.noise import LEAST_SQUARE
from pliant.formatting import Unit, display_unit, number, quantity, significant_decimals, with_sd
from pliant.interfaces.effect import EffectConfig, EffectParameter
from pliant.records.design import Array

# The rise at an end, in standard deviations, is met within this share.
CLOSE = 0.02
MOST_STEPS = 14
# Maximum step away from the best fit in x, if the data are insensitive.
LONGEST = 3.0
# Eigenvalues of JᵀJ below this share of the largest are directions to which the data are insensitive.
UNFELT = 1e-12


@dataclass(frozen=True)
class Estimate:
    """One fitted parameter, in its own unit.

    Attributes:
        name: ``kind.parameter``.
        parameter: its declaration by the effect's plugin.
        value, sd: the best value and its standard deviation; infinite if the data are insensitive to it.
        low, high: 90 % profile interval.
        open_low, open_high: the profile does not rise enough before the bound, which is then the end.
        at_limit: the best value is on a bound.
    """

    name: str
    parameter: EffectParameter
    value: float
    sd: float
    low: float
    high: float
    open_low: bool
    open_high: bool
    at_limit: bool

    @property
    def kind(self) -> str:
        return self.name.partition(".")[0]

    @property
    def unit(self) -> str:
        """Return the unit as written behind a number; empty for a pure number."""
        return "" if self.parameter.unit == "1" else self.parameter.unit

    @property
    def plausible(self) -> bool:
        """Return whether the value is in the plausible range or between it and neutral, within one sd."""
        low, high = self.parameter.plausible
        neutral, doubt = self.parameter.neutral, self.sd if math.isfinite(self.sd) else 0.0
        return min(low, neutral) - doubt <= self.value <= max(high, neutral) + doubt

    @property
    def includes_neutral(self) -> bool:
        """Return whether the interval includes the value at which the effect vanishes (strengths only)."""
        return self.parameter.role == "strength" and self.low <= self.parameter.neutral <= self.high

    @property
    def simpler(self) -> str:
        """Return that a simpler form is enough, in the effect's words; empty if the shape is needed or undetermined."""
        low = self.parameter.bounds[0] if self.open_low else self.low
        high = self.parameter.bounds[1] if self.open_high else self.high
        forms = [form for form in self.parameter.simpler if low <= form[0] <= high]
        if self.at_limit:
            forms = sorted(forms, key=lambda form: abs(form[0] - self.value))[:1]
        elif self.open_low and self.open_high:
            return ""
        return forms[0][1] if len(forms) == 1 else ""

    @property
    def words(self) -> str:
        """Return ``0.212 ± 0.014, 90 % between 0.19 and 0.236`` in SI, as in a study, with the remarks."""
        return self.told(Unit(self.unit))

    def told(self, unit: Unit) -> str:
        """Return the same words in another unit."""
        # as many digits as the interval's length needs
        largest, length = max(abs(self.low), abs(self.high)), self.high - self.low
        narrow = 0.0 < length < 0.1 * largest and math.isfinite(largest)
        digits = 2 + math.ceil(math.log10(largest / length)) if narrow else 3
        low, high = number(unit.factor * self.low, digits), number(unit.factor * self.high, digits)
        between = f"between {low} and {high}"
        if self.open_low or self.open_high:
            between = f"below {high}" if self.open_low else f"above {low}"
        if self.open_low and self.open_high:
            between = "anywhere within its bounds"
        return ", ".join([with_sd(self.value, self.sd, unit), f"90 % {between}", *self.remarks])

    @property
    def doubts(self) -> tuple[str, ...]:
        """Return the objections to the value."""
        found = []
        if self.includes_neutral:
            found.append(f"includes {quantity(self.parameter.neutral, self.unit, 3)}: no effect")
        if not self.plausible and not self.simpler:
            unit = display_unit(self.unit)
            value, low, high = (unit.text(v, 3) for v in (self.value, *self.parameter.plausible))
            found.append(f"implausible: {value} is outside {low} to {high}")
        return tuple(found)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Return the doubts, and the simpler form if it is enough."""
        return (*self.doubts, self.simpler) if self.simpler else self.doubts


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """All parameters of a fit; `correlation` (k, k) in the order of `estimates`, NaN where a variance is infinite."""

    estimates: tuple[Estimate, ...]
    correlation: Array

    def estimate(self, name: str) -> Estimate:
        """Return the estimate of a parameter by its name ``kind.parameter``."""
        return next(one for one in self.estimates if one.name == name)

    def absent(self, kind: str) -> bool:
        """Return whether no strength of this effect differs significantly from zero."""
        strengths = [e for e in self.estimates if e.kind == kind and e.parameter.role == "strength"]
        return all(estimate.includes_neutral for estimate in strengths)


@dataclass(frozen=True)
class Held(EffectSet):
    """A candidate with one parameter fixed."""

    index: int = 0
    at: float = 0.0
    inner: EffectSet = field(default_factory=lambda: EffectSet((), (), ()))

    @staticmethod
    def hold(candidate: EffectSet, index: int, at: float) -> Held:
        return Held(candidate.kinds, candidate.parameters, candidate.models, index, at, candidate)

    def configs(self, x: Array) -> tuple[EffectConfig, ...]:
        """Return the configs of the inner candidate, which may be of another class."""
        return self.inner.configs(x)

    def limits(self) -> tuple[Array, Array]:
        """Return bounds in x, with both ends of the fixed parameter at its number."""
        low, high = (ends.copy() for ends in self.inner.limits())
        low[self.index] = high[self.index] = self.at
        return low, high


def uncertainty(fitter: Fitter, fit: EffectFit, n_effective: float, profiles: bool = True) -> Uncertainty:
    """Return standard deviations and profile intervals.

    Without `profiles`, or if forms vary, intervals are ± 1.645 standard deviations.

    Args:
        fitter: the fitter that made the fit, with its readings and weights.
        fit: a fit of one parameter or more.
        n_effective: independent readings of the fit.
    """
    scale = square_per_reading(fitter.weights, fit, n_effective)
    covariance = parameter_covariance(fitter, fit, scale)
    spread = np.sqrt(np.diag(covariance))
    profiles = profiles and not fit.candidate.forms
    estimates = []
    for k, parameter in enumerate(fit.candidate.parameters):
        ends = [_end(fitter, fit, k, side, float(spread[k]), scale if profiles else None) for side in (-1, 1)]
        x = float(fit.x[k])
        estimates.append(
            Estimate(
                name=parameter.name,
                parameter=parameter.declared,
                value=parameter.value(x),
                sd=float(spread[k] * abs(parameter.slope(x))),
                low=parameter.value(ends[0][0]),
                high=parameter.value(ends[1][0]),
                open_low=ends[0][1],
                open_high=ends[1][1],
                at_limit=bool(fit.at_limit[k]),
            )
        )
    with np.errstate(invalid="ignore"):
        correlation = covariance / np.outer(spread, spread)
    return Uncertainty(tuple(estimates), correlation)


def square_per_reading(weights: Array, fit: EffectFit, n_effective: float) -> float:
    """Return s², the expected contribution of one independent reading to Σ r², from these residuals."""
    free = max(n_effective - len(fit.x), 1.0)
    square = max(fit.mean_square(weights), LEAST_SQUARE)  # data without noise have zero residuals
    return square * float(weights.sum()) / free


def parameter_covariance(fitter: Fitter, fit: EffectFit, scale: float) -> Array:
    """Return (k, k) covariance in x; infinite variances if the readings are insensitive to a parameter."""
    normal = fit.information if fit.law is not None else (fit.slopes * fitter.weights[:, None]).T @ fit.slopes
    # forms have a prior, s² of which is in units of Σ r²
    normal += np.diag([scale * one.pull * one.is_form for one in fit.candidate.parameters])
    size = np.sqrt(np.diag(normal))
    size[size == 0] = 1.0
    values, vectors = np.linalg.eigh(normal / np.outer(size, size))
    felt = values > UNFELT * max(float(values.max(initial=0.0)), 1.0)
    inverse = (vectors[:, felt] / values[felt]) @ vectors[:, felt].T
    covariance: Array = scale * inverse / np.outer(size, size)
    lost = (vectors[:, ~felt] ** 2).sum(axis=1) > 1e-9
    covariance[lost, lost] = np.inf
    return covariance


def _end(
    fitter: Fitter, fit: EffectFit, index: int, side: int, spread: float, scale: float | None
) -> tuple[float, bool]:
    """Return one end of the interval in x, and whether it is a bound before which the profile does not rise enough."""
    best = float(fit.x[index])
    bound = float(fit.candidate.limits()[0 if side < 0 else 1][index])
    room = abs(bound - best)
    if room <= 1e-9 * (1.0 + abs(best)):
        return bound, True
    if scale is None:
        reach = NINETY * spread
        return (bound, True) if reach >= room else (best + side * reach, False)
    profile = _Profile(fitter, fit, index, scale, _followers(fitter, fit, index))
    length = _crossing(lambda t: profile.height(best + side * t), min(NINETY * spread, LONGEST), room)
    return (bound, True) if length is None else (best + side * length, False)


@dataclass(eq=False)
class _Profile:
    """√(rise of Σ r² / s²) along one parameter, the others refitted from an extrapolation of the last call.

    `along` (k,) is the first-order change of each parameter with this one.
    """

    fitter: Fitter
    fit: EffectFit
    index: int
    scale: float
    along: Array

    def __post_init__(self) -> None:
        self._cost, self._last = self._squares(self.fit), self.fit.x

    def height(self, x: float) -> float:
        low, high = self.fit.candidate.limits()
        start = np.clip(self._last + (x - self._last[self.index]) * self.along, low, high)
        start[self.index] = x
        refitted = self.fitter.fit(
            Held.hold(self.fit.candidate, self.index, x),
            [start],
            self.fit.parts,
            refine=False,
            law=self.fit.law,
        )
        rise = (self._squares(refitted) - self._cost) / self.scale
        if not math.isfinite(rise):
            return 10 * NINETY
        self._last = refitted.x
        return math.sqrt(max(rise, 0.0))

    def _squares(self, fit: EffectFit) -> float:
        return fit.cost(self.fitter.weights)


def _followers(fitter: Fitter, fit: EffectFit, index: int) -> Array:
    """Return (k,) change of each parameter's best value per change of one; 0 for undetermined ones."""
    covariance = parameter_covariance(fitter, fit, 1.0)
    along = np.zeros(len(fit.x))
    if np.isfinite(covariance[index, index]) and covariance[index, index] > 0.0:
        felt = np.isfinite(np.diag(covariance))
        along[felt] = covariance[index, felt] / covariance[index, index]
    return along


def _crossing(height: Callable[[float], float], step: float, room: float) -> float | None:
    """Return where the height, nearly a straight line from 0, passes `NINETY`; None if not before `room`."""
    low, high, low_height, high_height = 0.0, math.nan, 0.0, math.nan
    at = min(step, room)
    for step_number in range(MOST_STEPS):
        here = height(at)
        if abs(here - NINETY) < CLOSE * NINETY and at < room:
            return at
        if here < NINETY:
            if at >= room:
                return None
            low, low_height = at, here
        else:
            high, high_height = at, here
        if math.isnan(high):
            at = min(at * min(max(NINETY / max(here, 1e-9), 1.2), 4.0), room)
        else:
            share = (NINETY - low_height) / (high_height - low_height)
            share = 0.5 if step_number % 2 else min(max(share, 0.05), 0.95)
            at = low + share * (high - low)
    return at


def rounded(value: float, sd: float, digits: int = 2) -> float:
    """Return the value at the decimal of the sd's last significant digit, or at four digits without an sd."""
    decimals = significant_decimals(value, sd, digits)
    return value if decimals is None else round(value, decimals)
