"""How sure a fit is of its parameters: standard deviations, correlation, profile intervals.

Residuals r are in units of the noise floor. Noise is coloured: N readings are worth n_eff independent ones, each of
which adds

    s² = Σ r² / (n_eff − k)

to Σ r² by chance, k parameters fitted. The covariance in the parameters' x is s² (JᵀJ)⁻¹, in a parameter's own unit
times dv/dx (delta method), with the prior of forms that vary. A profile interval holds the values of one parameter at
which Σ r², all other parameters refitted, rises by less than s² · 2.706, the 90 % point of χ² with one degree of
freedom (Venzon & Moolgavkar, Applied Statistics 37, 1988): it follows bounds and bent valleys that a standard deviation
does not see.
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
from pliant.formatting import Unit, decimals_of_sd, display_unit, number, quantity, with_sd
from pliant.interfaces.effect import EffectConfig, EffectParameter
from pliant.records.design import Array

# The rise of an end, in standard deviations, is met within this share.
CLOSE = 0.02
MOST_STEPS = 14
# A step away from the best fit is never longer than this in x, where the data feel nothing.
LONGEST = 3.0
# Eigenvalues of JᵀJ below this share of the largest are directions that the data do not feel.
UNFELT = 1e-12


@dataclass(frozen=True)
class Estimate:
    """One fitted parameter, in its own unit.

    Attributes:
        name: ``kind.parameter``.
        parameter: what the effect's plugin says of it.
        value, sd: the best value and its standard deviation; infinite where the data do not feel it.
        low, high: 90 % profile interval.
        open_low, open_high: the profile does not rise enough before the bound, which then stands as the end.
        at_limit: the best value lies on a bound.
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
        """The unit as written behind a number; empty for a pure number."""
        return "" if self.parameter.unit == "1" else self.parameter.unit

    @property
    def plausible(self) -> bool:
        """Within the plausible range or between it and neutral, or not further outside than one sd."""
        low, high = self.parameter.plausible
        neutral, doubt = self.parameter.neutral, self.sd if math.isfinite(self.sd) else 0.0
        return min(low, neutral) - doubt <= self.value <= max(high, neutral) + doubt

    @property
    def includes_neutral(self) -> bool:
        """The interval holds the value at which the effect vanishes (strengths only)."""
        return self.parameter.role == "strength" and self.low <= self.parameter.neutral <= self.high

    @property
    def simpler(self) -> str:
        """That a simpler form is enough, in the effect's own words; empty where the shape is needed or not felt."""
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
        """``0.212 ± 0.014, 90 % between 0.19 and 0.236`` in SI, as a study writes it; with what is to be said of it."""
        return self.told(Unit(self.unit))

    def told(self, unit: Unit) -> str:
        """The same in another unit."""
        low, high = number(unit.factor * self.low, 3), number(unit.factor * self.high, 3)
        between = f"between {low} and {high}"
        if self.open_low or self.open_high:
            between = f"below {high}" if self.open_low else f"above {low}"
        if self.open_low and self.open_high:
            between = "anywhere within its bounds"
        return ", ".join([with_sd(self.value, self.sd, unit), f"90 % {between}", *self.remarks])

    @property
    def doubts(self) -> tuple[str, ...]:
        """What speaks against the value."""
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
        """The doubts, and where a simpler form is enough."""
        return (*self.doubts, self.simpler) if self.simpler else self.doubts


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """All parameters of a fit; `correlation` (k, k) in the order of `estimates`, NaN where a variance is infinite."""

    estimates: tuple[Estimate, ...]
    correlation: Array

    def of(self, name: str) -> Estimate:
        """The estimate of a parameter by its name ``kind.parameter``."""
        return next(one for one in self.estimates if one.name == name)

    def absent(self, kind: str) -> bool:
        """No strength of this effect is told from zero."""
        strengths = [e for e in self.estimates if e.kind == kind and e.parameter.role == "strength"]
        return all(estimate.includes_neutral for estimate in strengths)


@dataclass(frozen=True)
class Held(EffectSet):
    """A candidate one of whose parameters is held at a number."""

    index: int = 0
    at: float = 0.0
    inner: EffectSet = field(default_factory=lambda: EffectSet((), (), ()))

    @staticmethod
    def hold(candidate: EffectSet, index: int, at: float) -> Held:
        return Held(candidate.kinds, candidate.parameters, candidate.models, index, at, candidate)

    def configs(self, x: Array) -> tuple[EffectConfig, ...]:
        """Those of the candidate that is held, which may be of another class."""
        return self.inner.configs(x)

    def limits(self) -> tuple[Array, Array]:
        """Bounds in x, with both ends of the held parameter at its number."""
        low, high = (ends.copy() for ends in self.inner.limits())
        low[self.index] = high[self.index] = self.at
        return low, high


def uncertainty(fitter: Fitter, fit: EffectFit, n_effective: float, profiles: bool = True) -> Uncertainty:
    """Standard deviations and profile intervals; ± 1.645 standard deviations without `profiles`, and where forms vary.

    Args:
        fitter: the fitter that made the fit: its readings and weights count.
        fit: a fit of one parameter or more.
        n_effective: independent readings that the fit rests on.
    """
    scale = square_per_reading(fitter.weights, fit, n_effective)
    covariance = covariance_of(fitter, fit, scale)
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
    """s²: what one independent reading adds to Σ r² by chance, as these residuals show it."""
    free = max(n_effective - len(fit.x), 1.0)
    square = max(fit.mean_square(weights), LEAST_SQUARE)  # data without noise have none to show
    return square * float(weights.sum()) / free


def covariance_of(fitter: Fitter, fit: EffectFit, scale: float) -> Array:
    """(k, k) in x; infinite variances where the readings do not feel a parameter."""
    normal = fit.information if fit.law is not None else (fit.slopes * fitter.weights[:, None]).T @ fit.slopes
    # forms have a prior of their own, s² of which is in units of Σ r²
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
    """One end of the interval in x, and whether it is a bound that the profile does not reach its rise before."""
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
    """√(rise of Σ r² / s²) along one parameter, the others refitted from where the last call would lead them.

    `along` (k,) is how much each parameter follows this one, to first order.
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
    """(k,) change of each parameter's best value per change of one; 0 for those that the readings do not feel."""
    covariance = covariance_of(fitter, fit, 1.0)
    along = np.zeros(len(fit.x))
    if np.isfinite(covariance[index, index]) and covariance[index, index] > 0.0:
        felt = np.isfinite(np.diag(covariance))
        along[felt] = covariance[index, felt] / covariance[index, index]
    return along


def _crossing(height: Callable[[float], float], step: float, room: float) -> float | None:
    """Where the height, nearly a straight line from 0, passes `NINETY`; None if that is not before `room`."""
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
    """The value at the decimal of the sd's last significant digit; four digits of its own without one."""
    decimals = decimals_of_sd(value, sd, digits)
    return value if decimals is None else round(value, decimals)
