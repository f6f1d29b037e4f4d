"""Bands of predicted readings on a run: the parameters' posterior, the laws' error bars, the noise of a reading.

The three are independent, and their variances add. A reading scatters about the model by the noise floor and by the
laws' error bars, if they are stated; if the fit left a larger error on its own runs, a reading scatters by that error.
The half-width at a level is that quantile of Student's t with the degrees of freedom of the noise estimate.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from pliant.config.study import Study
from pliant.diagnosis.exploration import SEED, draws_for
from pliant.diagnosis.extension import Ground
from pliant.diagnosis.kept_posterior import kept_posterior
from pliant.diagnosis.posterior import Posterior
from pliant.diagnosis.scatter import ReadingScatter
from pliant.errors import UserError
from pliant.evidence.measured_model import MeasuredModel, RunReadings
from pliant.evidence.prediction import Predictor
from pliant.pipeline.simulate import drawn_chains
from pliant.pipeline.workbench import RunContext
from pliant.records.design import Array
from pliant.records.measurement import Measurement

LEVEL = 0.9


@dataclass(frozen=True, eq=False)
class Bands:
    """Bands of a model's readings per run.

    Attributes:
        level: probability that a reading is inside.
        centre: per run by output (t,), SI: the mean over draws.
        low, high: the same for the band's ends; NaN if an output's scatter is unknown.
    """

    level: float
    centre: tuple[RunReadings, ...]
    low: tuple[RunReadings, ...]
    high: tuple[RunReadings, ...]

    def held(self, measurement: Measurement) -> dict[str, float]:
        """Return by output the share of its readings within the band; outputs without band or readings are left out."""
        found = {}
        for name in self.low[0]:
            inside = [
                ((run.outputs[name] >= low[name]) & (run.outputs[name] <= high[name]))[
                    np.isfinite(run.outputs[name]) & np.isfinite(low[name])
                ]
                for run, low, high in zip(measurement.runs, self.low, self.high, strict=True)
                if name in run.outputs
            ]
            held = np.concatenate([np.zeros(0), *inside])
            if held.size:
                found[name] = float(held.mean())
        return found

    def half_width(self) -> dict[str, float]:
        """Return by output the median half-width, SI; outputs without a band are left out."""
        found = {}
        for name in self.low[0]:
            widths = [(high[name] - low[name]) / 2 for low, high in zip(self.low, self.high, strict=True)]
            whole = np.concatenate(widths)
            if np.isfinite(whole).any():
                found[name] = float(np.nanmedian(whole))
        return found

    def select_runs(self, runs: Sequence[int]) -> Bands:
        """Return the bands of some of the runs."""
        ends = (self.centre, self.low, self.high)
        return Bands(self.level, *(tuple(end[k] for k in runs) for end in ends))


def bands(
    predictor: MeasuredModel,
    posterior: Posterior,
    scatter: Mapping[str, ReadingScatter],
    level: float = LEVEL,
    count: int | None = None,
) -> Bands:
    """Return the bands of the model's readings on the predictor's runs.

    Args:
        predictor: the model without the effects of `posterior.candidate`, driven by the runs in question.
        posterior: of the effects' parameters.
        scatter: by output, of the fit.
        level: probability that a reading is inside.
        count: draws.
    """
    runs, best = predictor.measurement.runs, posterior.candidate.configs(posterior.x)
    parts = predictor.steps_between_samples(best)
    readings = parts * len(predictor.outputs) * sum(map(len, runs))
    draws = posterior.draws(count or draws_for(readings), SEED)
    models = _models(predictor, len(draws))
    fine = predictor.refined(parts)
    of_draws = [fine.evaluate(posterior.candidate.configs(x)).runs for x in draws]
    mean, parameters = _moments(of_draws)
    laws: list[dict[str, Array]] = [{name: np.zeros(len(run)) for name in predictor.outputs} for run in runs]
    if models is not None:
        laws = _moments([model.refined(parts).evaluate(best).runs for model in models])[1]
    quantile = float(scipy.stats.t.ppf((1.0 + level) / 2.0, posterior.freedom))
    low: list[RunReadings] = []
    high: list[RunReadings] = []
    for centre, of_parameters, of_laws in zip(mean, parameters, laws, strict=True):
        low.append({})
        high.append({})
        for name in predictor.outputs:
            known = scatter.get(name, ReadingScatter(np.nan, np.nan))
            single = np.maximum(known.floor**2 + of_laws[name], known.left**2)
            half = quantile * np.sqrt(of_parameters[name] + single)
            low[-1][name], high[-1][name] = centre[name] - half, centre[name] + half
    return Bands(level, tuple(mean), tuple(low), tuple(high))


def _models(predictor: MeasuredModel, count: int) -> list[Predictor] | None:
    """Return the predictor with drawn laws; None where no law states an error, or the model has none."""
    if not isinstance(predictor, Predictor) or all(law.error is None for law in predictor.chain.laws):
        return None
    chains = drawn_chains(predictor.chain, count, SEED)
    return [Predictor(predictor.context, predictor.backend, chain, predictor.measurement) for chain in chains]


def _moments(
    of_draws: Sequence[Sequence[Mapping[str, Array]]],
) -> tuple[list[dict[str, Array]], list[dict[str, Array]]]:
    """Return per run by output (t,) mean and variance over draws; draws without an equilibrium there do not count."""
    means, variances = [], []
    for run in range(len(of_draws[0])):
        stacked = {name: np.array([draw[run][name] for draw in of_draws]) for name in of_draws[0][run]}
        count = {name: np.isfinite(values).sum(axis=0) for name, values in stacked.items()}
        mean = {
            name: np.where(count[name] > 0, np.nansum(values, axis=0) / np.maximum(count[name], 1), np.nan)
            for name, values in stacked.items()
        }
        means.append(mean)
        variances.append(
            {
                name: np.nansum((values - mean[name]) ** 2, axis=0) / np.maximum(count[name] - 1, 1)
                for name, values in stacked.items()
            }
        )
    return means, variances


def study_bands(context: RunContext, study: Study, measurement: Measurement) -> tuple[Bands | None, str]:
    """Return bands of a study's model on measured runs, or None and a sentence on why its block is not used.

    Args:
        context, study, measurement: as for `Predictor.from_study`.
    """
    try:
        kept = kept_posterior(context.registry, study)
    except UserError as error:
        return None, str(error)
    if kept is None:
        return None, ""
    return bands(Ground.from_study(context, study, measurement).predictor, kept.posterior, kept.scatter), ""
