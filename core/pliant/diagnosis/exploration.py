"""Exploration of a posterior by draws: a check of Laplace's approximation, and the sensitivity of the prediction.

Check. Draws come from a normal distribution that is wider than the approximation, to cover what it may miss. A draw x
has the weight w = p(x) / q(x), with its density q and the likelihood times prior p without any approximation; D draws
have the effective sample size (Σ w)² / Σ w² (Kong, Liu & Wong 1994). Weighted mean and spread are those of the
posterior, and the approximation is accepted if its own are close to them. A hundred draws do not resolve the tail of a
curved valley; the profile intervals do (`asymmetric_parameter`), and if one of their sides differs in length from the
normal one the error bars are rough, too.

Shares. The shares of the prediction's variance over the posterior that a parameter accounts for: `first`, the expected
reduction if it became known, including what it implies about the others, and `total`, the remaining share if all
others became known. For independent parameters these are Sobol's indices; dependent ones are drawn one after another
from independent numbers, with the parameter in question first or last (Mara & Tarantola, Reliab. Eng. Syst. Saf. 107,
2012; Kucherenko, Tarantola & Annoni, Comput. Phys. Commun. 183, 2012). The indices of many readings are their mean
weighted by variance (Gamboa et al., Electron. J. Stat. 8, 2014), over principal components of the readings, each a
second-degree polynomial fitted to the draws.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from pliant.diagnosis.candidates import NINETY
from pliant.diagnosis.fitting import Fitter
from pliant.diagnosis.law_posterior import LawError, Whitener
from pliant.diagnosis.posterior import Posterior
from pliant.diagnosis.readings import ReadingVector
from pliant.diagnosis.uncertainty import Uncertainty
from pliant.records.design import Array

MOST_DRAWS, FEWEST_DRAWS = 128, 16
# The most where a draw costs as much as a slope, unless there are many parameters.
COSTLY_DRAWS = 48
# Maximum number of predicted readings: fewer draws for long recordings.
MOST_PREDICTED = 8_000_000
# Draws are spread by this factor more than the approximation.
WIDER = 1.4
# The approximation is accepted if no mean is off by more than this share of its standard deviation, and no standard
# deviation by more than this factor, with at least this effective number of draws.
OFF, FACTOR, ENOUGH = 0.3, 1.25, 12.0
ASYMMETRIC = 1.35
SEED = 0
# Share of the readings without an equilibrium that is allowed in a draw, as in a fit.
MOST_LOST = 0.02
# Share of the variance kept in the principal components.
HELD = 0.999
SOBOL_POINTS = 1024


@dataclass(frozen=True)
class Share:
    """Shares of a prediction's variance that a parameter accounts for, see above."""

    first: float
    total: float


@dataclass(frozen=True, eq=False)
class Exploration:
    """The predicted readings at draws of a posterior.

    Attributes:
        x: (D, k) draws.
        weights: (D,) of each, with sum 1; all 0 if none has an equilibrium.
        off: (k,) weighted mean minus the approximation's, in its standard deviations; NaN without weights.
        factor: (k,) weighted standard deviation over the approximation's.
        spread: by output the standard deviation of its readings due to the parameters, root mean square, SI.
        shares: by output and parameter; empty for outputs whose readings no parameter changes.
    """

    x: Array
    weights: Array
    off: Array
    factor: Array
    spread: Mapping[str, float]
    shares: Mapping[str, Mapping[str, Share]] = field(default_factory=dict)

    @property
    def worth(self) -> float:
        """Return the effective number of draws from the posterior itself."""
        squares = float(self.weights @ self.weights)
        return 1.0 / squares if squares > 0.0 else 0.0

    @property
    def good(self) -> bool:
        """Return whether the normal approximation is close."""
        sizes = np.maximum(self.factor, 1.0 / np.maximum(self.factor, 1e-9))
        close = bool(np.all(np.abs(self.off) <= OFF) and np.all(sizes <= FACTOR))
        return self.worth >= ENOUGH and close


def explore(
    fitter: Fitter,
    posterior: Posterior,
    scale: float,
    parts: int = 1,
    count: int | None = None,
    law: LawError | None = None,
) -> Exploration:
    """Predict the fitter's readings at draws of the posterior.

    Args:
        fitter: that of the fit.
        posterior: of the fit.
        scale: s², the expected contribution of one independent reading to Σ r².
        parts: steps of the integration from sample to sample, as in the fit.
        count: draws; as many as `MOST_PREDICTED` readings allow by default.
        law: the law's own error as part of the fit.
    """
    wide = replace(posterior, covariance=WIDER**2 * posterior.covariance)
    most = draws_for(parts * len(fitter.readings))
    if fitter.predictor.costly_slopes:  # twice what a second-degree polynomial has coefficients, at least
        size = len(posterior.x)
        most = min(most, max(COSTLY_DRAWS, (size + 1) * (size + 2)))
    x = wide.draws(count or most, SEED)
    model, pack = fitter.predictor.refined(parts), fitter.readings.pack
    predicted = np.array([pack(model.evaluate(posterior.candidate.configs(point)).runs) for point in x])
    residual = fitter.readings.values - predicted
    lost = ~np.isfinite(residual)
    there = lost.mean(axis=1) <= MOST_LOST
    known = np.where(lost, 0.0, residual)
    if law is not None:
        known = Whitener.from_sensitivities(law.columns, law.precision).apply(known.T).T
    squares = known**2 @ fitter.weights
    logs = np.where(there, log_density(squares, x, scale) - _log_normal(wide, x), -np.inf)
    weights = np.zeros(len(x)) if not there.any() else np.exp(logs - logs.max())
    weights /= max(float(weights.sum()), 1e-300)
    sd = np.sqrt(np.diag(posterior.covariance))
    mean = weights @ x
    return Exploration(
        x=x,
        weights=weights,
        off=(mean - posterior.x) / sd if there.any() else np.full(len(sd), np.nan),
        factor=np.sqrt(weights @ (x - mean) ** 2) / sd,
        spread=_spread(fitter.readings, predicted[there], weights[there]),
        shares=_shares(fitter.readings, posterior, x[there], predicted[there]),
    )


@dataclass(frozen=True)
class AsymmetricParameter:
    """A parameter with one side of its 90 % interval `ratio` times as long as for a normal distribution."""

    name: str
    upwards: bool
    ratio: float


def asymmetric_parameter(posterior: Posterior, uncertainty: Uncertainty) -> AsymmetricParameter | None:
    """Return the side of a profile interval that differs most from the normal one, if by more than `ASYMMETRIC`.

    Args:
        posterior: defines the x in which the distribution is normal.
        uncertainty: profile intervals of the same parameters; sides that end at a bound are ignored.
    """
    sides = []
    for parameter, x, rate, one in zip(
        posterior.candidate.parameters, posterior.x, posterior.rates, uncertainty.estimates, strict=True
    ):
        normal = NINETY * one.sd / abs(rate) if rate else np.inf
        for upwards, end, is_open in ((False, one.low, one.open_low), (True, one.high, one.open_high)):
            if not is_open and np.isfinite(normal) and normal > 0.0:
                sides.append(
                    AsymmetricParameter(one.name, upwards, abs(parameter.x(end) - float(x)) / normal)
                )
    most = max(sides, key=lambda side: abs(np.log(max(side.ratio, 1e-9))), default=None)
    return most if most is not None and not 1.0 / ASYMMETRIC < most.ratio < ASYMMETRIC else None


def draws_for(readings: int) -> int:
    """Return the number of draws for a number of readings."""
    return int(np.clip(MOST_PREDICTED // max(readings, 1), FEWEST_DRAWS, MOST_DRAWS))


def log_density(squares: Array, x: Array, scale: float) -> Array:
    """Return (D,) log of likelihood times prior at x (D, k) with weighted squared residuals (D,), up to a constant."""
    return np.asarray(-0.5 * (squares / scale + np.sum(x**2, axis=-1)))


def _log_normal(posterior: Posterior, x: Array) -> Array:
    away = np.linalg.solve(posterior.covariance, (x - posterior.x).T)
    return np.asarray(-0.5 * np.sum((x - posterior.x).T * away, axis=0))


def _spread(readings: ReadingVector, predicted: Array, weights: Array) -> dict[str, float]:
    if not weights.any():
        return {}
    values = np.nan_to_num(predicted)
    variance = weights @ (values - weights @ values) ** 2
    return {
        name: float(np.sqrt(np.mean(variance[readings.output == k]))) * readings.scales[name]
        for k, name in enumerate(readings.outputs)
    }


def _shares(
    readings: ReadingVector, posterior: Posterior, x: Array, predicted: Array
) -> dict[str, dict[str, Share]]:
    found: dict[str, dict[str, Share]] = {}
    if len(x) < FEWEST_DRAWS:
        return found
    for k, name in enumerate(readings.outputs):
        of_output = np.nan_to_num(predicted[:, readings.output == k])
        centred = of_output - of_output.mean(axis=0)
        if centred.size and np.sqrt(np.mean(centred**2)) > 1e-9 * max(float(np.abs(of_output).max()), 1e-300):
            found[name] = _output_shares(posterior, x, centred)
    return found


def _output_shares(posterior: Posterior, x: Array, centred: Array) -> dict[str, Share]:
    names = posterior.names
    if len(names) == 1:
        return {names[0]: Share(1.0, 1.0)}
    left, size, _ = np.linalg.svd(centred, full_matrices=False)
    count = int(np.searchsorted(np.cumsum(size**2), HELD * float(size @ size))) + 1
    emulator = _Emulator.fit(posterior, x, left[:, :count] * size[:count])
    first, total = np.zeros(len(names)), np.zeros(len(names))
    for begin in range(len(names)):
        order = np.roll(np.arange(len(names), dtype=np.intp), -begin)
        shares = _indices(posterior, emulator, order)
        first[order[0]], total[order[-1]] = shares[0][0], shares[1][-1]
    return {name: Share(float(first[k]), float(total[k])) for k, name in enumerate(names)}


@dataclass(frozen=True, eq=False)
class _Emulator:
    """Principal components (c,) of readings as polynomials of x; of first degree for few draws."""

    posterior: Posterior
    coefficients: Array

    @staticmethod
    def fit(posterior: Posterior, x: Array, components: Array) -> _Emulator:
        terms = _terms(posterior, x, 2)
        if 2 * terms.shape[1] > len(x):
            terms = _terms(posterior, x, 1)
        return _Emulator(posterior, np.asarray(np.linalg.lstsq(terms, components, rcond=None)[0], float))

    def __call__(self, x: Array) -> Array:
        """Return (n, c) components at x (n, k)."""
        k = x.shape[1]
        degree = 1 if len(self.coefficients) == 1 + k else 2
        return np.asarray(_terms(self.posterior, x, degree) @ self.coefficients)


def _terms(posterior: Posterior, x: Array, degree: int) -> Array:
    """Return (n, terms) of a polynomial in x, scaled by its standard deviations."""
    z = (x - posterior.x) / np.sqrt(np.diag(posterior.covariance))
    terms = [np.ones(len(z)), *z.T]
    if degree == 2:
        k = z.shape[1]
        terms += [z[:, a] * z[:, b] for a in range(k) for b in range(a, k)]
    return np.stack(terms, axis=1)


def _indices(posterior: Posterior, emulator: _Emulator, order: NDArray[np.intp]) -> tuple[Array, Array]:
    """Return (k,) first-order and total indices of independent numbers that draw the parameters in this order."""
    root = np.linalg.cholesky(posterior.covariance[np.ix_(order, order)])
    low, high = posterior.candidate.limits()

    def components(normal: Array) -> Array:
        x = np.empty_like(normal)
        x[order] = posterior.x[order, None] + root @ normal
        return emulator(np.clip(x.T, low, high)).T

    k = len(order)
    even = scipy.stats.qmc.Sobol(2 * k, seed=SEED).random_base2(int(math.log2(SOBOL_POINTS)))
    normal = scipy.stats.norm.ppf(np.clip(even, 1e-9, 1.0 - 1e-9)).T
    a, b = normal[:k], normal[k:]
    mixed = np.repeat(a[None], k, axis=0)
    mixed[np.arange(k), np.arange(k)] = b
    sampled = {
        "f_A": components(a),
        "f_B": components(b),
        "f_AB": np.stack([components(one) for one in mixed]),
    }
    found = scipy.stats.sobol_indices(func=sampled, n=SOBOL_POINTS)
    weight = np.var(np.concatenate([sampled["f_A"], sampled["f_B"]], axis=1), axis=1)
    share = weight / weight.sum()
    return (
        np.clip(share @ np.reshape(found.first_order, (-1, k)), 0.0, 1.0),
        np.clip(share @ np.reshape(found.total_order, (-1, k)), 0.0, 1.0),
    )
