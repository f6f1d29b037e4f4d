"""A candidate at its best parameters, with the estimate of the law's own error."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pliant.diagnosis.candidates import EffectSet
from pliant.diagnosis.law_posterior import LawError, LawErrorPrior, Whitener, estimate
from pliant.records.design import Array


@dataclass(frozen=True, eq=False)
class EffectFit:
    """A candidate at its best parameters.

    Attributes:
        candidate: what was fitted.
        x: (k,) parameters.
        residual: (N,) reading − prediction over the noise floor, with all runs; minus the estimated change by the law's
            own error, if that is part of the hypothesis.
        slopes: (N, k) d prediction / dx over the noise floor.
        converged: the last step gained almost nothing.
        at_limit: (k,) the parameter ended on a bound.
        parts: steps of the integration from each sample to the next.
        law: the estimate of the law's own error with the candidate; None if the law is taken as exact.
    """

    candidate: EffectSet
    x: Array
    residual: Array
    slopes: Array
    converged: bool
    at_limit: tuple[bool, ...]
    parts: int = 1
    law: LawError | None = None

    @property
    def raw(self) -> Array:
        """Return (N,) reading − prediction with the unchanged law."""
        return self.residual if self.law is None else self.residual + self.law.change

    @property
    def information(self) -> Array:
        """Return (k, k) JᵀJ of the parameters, with the law's own error marginalised."""
        return self.slopes.T @ self.slopes if self.law is None else self.law.reduce(self.slopes)

    @property
    def law_price(self) -> float:
        """Return the log-odds penalty of the law's own error."""
        return 0.0 if self.law is None else self.law.price

    def whitened(self, values: Array) -> Array:
        """Return (N,) or (N, k) in units of the readings with the possible changes by the law's error removed."""
        if self.law is None:
            return values
        return Whitener.from_sensitivities(self.law.columns, self.law.precision).apply(values)

    @property
    def values(self) -> dict[str, float]:
        """Return parameter values by ``kind.name``."""
        return self.candidate.values(self.x)

    @property
    def named(self) -> dict[str, float]:
        """Return x by ``kind.name``."""
        return {one.name: float(x) for one, x in zip(self.candidate.parameters, self.x, strict=True)}

    def mean_square(self, weights: Array | None = None) -> float:
        """Return the mean squared residual, in units of the noise floor's square; infinite without an equilibrium."""
        if weights is None:
            square = float(self.residual @ self.residual) / len(self.residual)
        else:
            square = float(weights @ self.residual**2) / float(weights.sum())
        return square if np.isfinite(square) else np.inf

    def cost(self, weights: Array) -> float:
        """Return the sum of squared residuals, plus the penalty of the law's error."""
        penalty = 0.0 if self.law is None else self.law.penalty
        return self.mean_square(weights) * float(weights.sum()) + penalty

    def with_law(self, prior: LawErrorPrior, n_effective: float) -> EffectFit:
        """Return the fit with the law's error estimated again for another noise."""
        if self.law is None or not np.isfinite(self.residual).all():
            return self
        return add_law_error(replace(self, residual=self.raw, law=None), self.law.columns, prior, n_effective)


def add_law_error(fit: EffectFit, columns: Array, prior: LawErrorPrior, n_effective: float) -> EffectFit:
    """Return a fit without a law's error with the estimate of it from its readings."""
    free = ~np.array(fit.at_limit, bool)
    pulls = np.array([parameter.pull for parameter in fit.candidate.parameters])
    found = estimate(fit.residual, fit.slopes[:, free], pulls[free], columns, prior, n_effective)
    return replace(fit, residual=fit.residual - found.change, law=found)
