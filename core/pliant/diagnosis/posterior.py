"""Joint posterior of a fit's parameters: Laplace's approximation, draws, and unidentifiable directions.

In the fit parameters' x (`FitParameter`: of order 1) the prior is a standard normal one. For a log-normal prior and for
forms that is what the plugin declares; for others it is wider (one standard deviation reaches the far end of the
plausible range), so that it decides only if the readings carry no information. About the best fit the posterior is then
normal with the covariance

    C = (JᵀJ / s² + 1)⁻¹

with slopes J in units of the noise floor and s² the expected contribution of one independent reading to Σ r²
(`uncertainty.square_per_reading`, which accounts for autocorrelation), within the parameters' bounds (MacKay,
Information Theory, Inference, and Learning Algorithms, 2003, chapter 27). An eigenvector of JᵀJ / s² with an eigenvalue
λ is a combination of parameters on which the data contain λ times the prior's information.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy

from pliant.diagnosis.candidates import EffectSet
from pliant.diagnosis.effect_fit import EffectFit
from pliant.diagnosis.uncertainty import square_per_reading
from pliant.records.design import Array

# Draws beyond the bounds are replaced from this many times the number of draws, then moved onto the bounds.
SPARE = 8


@dataclass(frozen=True, eq=False)
class Posterior:
    """A normal distribution of a candidate's parameters in x, within their bounds.

    Attributes:
        candidate: the effects with these parameters.
        x: (k,) the best fit.
        covariance: (k, k) of x.
        freedom: independent readings minus fitted parameters: degrees of freedom of the noise estimate.
    """

    candidate: EffectSet
    x: Array
    covariance: Array
    freedom: float

    @property
    def names(self) -> tuple[str, ...]:
        """Return ``kind.parameter`` of each."""
        return tuple(parameter.name for parameter in self.candidate.parameters)

    @property
    def values(self) -> Array:
        """Return (k,) best values in the parameters' own units."""
        return np.array([p.value(float(x)) for p, x in zip(self.candidate.parameters, self.x, strict=True)])

    @property
    def rates(self) -> Array:
        """Return (k,) dv/dx of each parameter's value."""
        return np.array([p.slope(float(x)) for p, x in zip(self.candidate.parameters, self.x, strict=True)])

    @property
    def sd(self) -> Array:
        """Return (k,) standard deviations of the values, in their own units, to first order."""
        return np.asarray(np.abs(self.rates) * np.sqrt(np.diag(self.covariance)))

    @property
    def correlation(self) -> Array:
        """Return (k, k) correlation of the values."""
        spread = np.sqrt(np.diag(self.covariance)) * np.sign(self.rates)
        return np.asarray(self.covariance / np.outer(spread, spread))

    @cached_property
    def seen(self) -> tuple[Array, Array]:
        """Return λ (k,) of each direction, the least informed first, and the directions (k, k) as columns, in x."""
        spread, vectors = np.linalg.eigh(self.covariance)
        return 1.0 / spread[::-1] - 1.0, vectors[:, ::-1]

    def about(self, values: Mapping[str, float]) -> Posterior:
        """Return the posterior about other values by ``kind.parameter``, such as rounded ones."""
        x = [p.x(values[p.name]) for p in self.candidate.parameters]
        return replace(self, x=np.array(x))

    def root(self) -> Array:
        """Return (k, k) L with L Lᵀ the covariance."""
        spread, vectors = np.linalg.eigh(self.covariance)
        return np.asarray(vectors * np.sqrt(np.maximum(spread, 0.0)))

    def draws(self, count: int, seed: int) -> Array:
        """Return (count, k) draws of x within the bounds, evenly spread (quasi-random)."""
        power = int(np.ceil(np.log2(max(SPARE * count, 2))))
        even = scipy.stats.qmc.Sobol(len(self.x), seed=seed).random_base2(power)
        normal = scipy.stats.norm.ppf(np.clip(even, 1e-9, 1.0 - 1e-9))
        drawn = self.x + normal @ self.root().T
        low, high = self.candidate.limits()
        inside = np.all((drawn >= low) & (drawn <= high), axis=1)
        chosen = np.concatenate([np.flatnonzero(inside), np.flatnonzero(~inside)])[:count]
        return np.asarray(np.clip(drawn[chosen], low, high))


def laplace_posterior(fit: EffectFit, weights: Array, n_effective: float) -> Posterior:
    """Return Laplace's approximation at a fit of one parameter or more.

    Args:
        fit: at its optimum.
        weights: (N,) of the readings, as in the fitter.
        n_effective: independent readings of the fit.
    """
    scale = square_per_reading(weights, fit, n_effective)
    known = fit.information if fit.law is not None else (fit.slopes * weights[:, None]).T @ fit.slopes
    information = known / scale
    seen, vectors = np.linalg.eigh(information)
    covariance = (vectors / (np.maximum(seen, 0.0) + 1.0)) @ vectors.T
    return Posterior(fit.candidate, fit.x, covariance, max(n_effective - len(fit.x), 1.0))
