"""Learned term: a smooth curve for the error that no listed effect explains, or that corrects the law.

Models that learn one are registered by the hook `pliant_residual_models`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pliant.diagnosis.learned_forms import LearnedForm
from pliant.diagnosis.noise import NoiseView
from pliant.diagnosis.readings import ReadingVector
from pliant.evidence.measured_model import MeasuredModel
from pliant.evidence.prediction import Predictor
from pliant.interfaces.effect import EffectConfig
from pliant.records.design import Array
from pliant.registry.place import imported
from pliant.registry.residual_model import residual_models


@dataclass(frozen=True, eq=False)
class LearnedTerm:
    """A fitted learned term.

    Attributes:
        effect: as in a study.
        form: where it acts, and its covariates.
        value, sd: at its knots, in the order of the effect's `value`.
        covariance: (K, K) of the values.
        before, after: RMS error over the noise floor on left-out runs, without and with it.
        sure: fall of the squared error on left-out runs over its standard error.
        freedom: effective number of values that the readings determine, less than the number of knots.
        residual: (N,) reading − prediction over the scales, with all runs.
        left_out: (N,) with each run left out of the term's fit.
        tried: forms that were fitted.
        drive: name of the chain's input.
        on: what was left out: "runs left out", specimens, or blocks of a single run.
    """

    effect: EffectConfig
    form: LearnedForm
    value: Array
    sd: Array
    covariance: Array
    before: float
    after: float
    sure: float
    freedom: float
    residual: Array
    left_out: Array
    tried: int
    drive: str
    on: str


def learn(
    predictor: MeasuredModel,
    readings: ReadingVector,
    noise: NoiseView,
    conditions: NDArray[np.intp],
    folds: NDArray[np.intp] | None = None,
) -> LearnedTerm | None:
    """Return the learned term of the first registered model that these runs support, or None.

    Args:
        predictor: the model, with all effects that it has; a term is learned for chains of modules alone.
        readings: in units of their scales.
        noise: estimated from the residuals of the model, or of the best explanation.
        conditions: (N,) number of each reading's condition: repeats share one.
        folds: (N,) number of the fold of each reading; the readings' own folds by default.
    """
    if not isinstance(predictor, Predictor):
        return None
    folds = readings.fold if folds is None else folds
    for model in residual_models().values():
        found: LearnedTerm | None = imported(model.learn)(predictor, readings, noise, conditions, folds)
        if found is not None:
            return found
    return None
