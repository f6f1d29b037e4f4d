"""Sampling of a fit's posterior by Markov chains, without any approximation: a check of Laplace's.

emcee's affine-invariant ensemble (Foreman-Mackey, Hogg, Lang & Goodman, Publ. Astron. Soc. Pac. 125, 2013) samples the
likelihood times prior of `posterior.py`, within the parameters' bounds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.diagnosis.effect_fit import EffectFit
from pliant.diagnosis.exploration import MOST_LOST, log_density
from pliant.diagnosis.fitting import Fitter
from pliant.diagnosis.posterior import laplace_posterior
from pliant.diagnosis.uncertainty import square_per_reading
from pliant.errors import MissingDependencyError
from pliant.records.design import Array

WALKERS_EACH, FEWEST_WALKERS = 4, 12
BURN_IN = 0.25


@dataclass(frozen=True, eq=False)
class SampledPosterior:
    """Samples (m, k) of x after the burn-in, and their effective sample size (of the worst parameter)."""

    x: Array
    worth: float


def sample_posterior(
    fitter: Fitter, fit: EffectFit, n_effective: float, steps: int, seed: int = 0
) -> SampledPosterior:
    """Sample the posterior of a fit.

    Args:
        fitter, fit, n_effective: as for `laplace_posterior`.
        steps: of each walker, a quarter of them as burn-in.
        seed: of the walk.

    Raises:
        MissingDependencyError: emcee is not installed.
    """
    try:
        import emcee
    except ImportError:
        raise MissingDependencyError(
            "sampling a posterior needs emcee; install it with: pip install 'pliant[posterior]'"
        ) from None
    scale = square_per_reading(fitter.weights, fit, n_effective)
    laplace = laplace_posterior(fit, fitter.weights, n_effective)
    low, high = fit.candidate.limits()
    model = fitter.predictor.refined(fit.parts)

    def log_probability(x: Array) -> float:
        if np.any(x < low) or np.any(x > high):
            return -np.inf
        prediction = model.evaluate(fit.candidate.configs(x))
        residual = fitter.readings.values - fitter.readings.pack(prediction.runs)
        lost = ~np.isfinite(residual)
        if lost.mean() > MOST_LOST:
            return -np.inf
        squares = float(np.where(lost, 0.0, residual) ** 2 @ fitter.weights)
        return float(log_density(np.array(squares), x, scale))

    k = len(fit.x)
    walkers = max(FEWEST_WALKERS, WALKERS_EACH * k)
    begin = laplace.draws(walkers, seed)
    begin += (
        1e-3 * np.sqrt(np.diag(laplace.covariance)) * np.random.default_rng(seed).standard_normal(begin.shape)
    )
    walk = emcee.EnsembleSampler(walkers, k, log_probability)
    walk.random_state = np.random.RandomState(seed).get_state()
    walk.run_mcmc(np.clip(begin, low, high), steps)
    burnt = int(BURN_IN * steps)
    x = walk.get_chain(discard=burnt, flat=True)
    memory = float(np.max(walk.get_autocorr_time(discard=burnt, tol=0)))
    return SampledPosterior(np.asarray(x), len(x) / max(memory, 1.0))
