"""Comparison of a predictor with its own measurement: mistakes of the record first, then prediction and comparison."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pliant.errors import NotReachedError, UserError
from pliant.evidence.bookkeeping.findings import find_mistakes
from pliant.evidence.bookkeeping.mistake import Mistake
from pliant.evidence.comparison import Comparison, compare
from pliant.evidence.measured_model import MeasuredModel, RunReadings
from pliant.evidence.prediction import Predictor
from pliant.records.measurement import Measurement

# Share of the samples without a finite reading from which a model of one's own cannot be compared.
MOST_LOST = 0.5


def compare_model(predictor: MeasuredModel) -> tuple[tuple[RunReadings, ...], Comparison]:
    """Return the model's readings in each run, and their comparison with the measured ones.

    Raises:
        UserError: no output in common, or no reading that can be compared.
        NotReachedError: no sample of any run has an equilibrium.
    """
    mistakes = find_mistakes(predictor)
    predicted = predict_knowing(predictor, mistakes)
    found = compare(predictor.measurement, predicted, bookkeeping=mistakes)
    if not isinstance(predictor, Predictor):  # what a chain lacks is said where its outputs are chosen
        found = replace(found, remarks=(*found.remarks, *predictor.remarks))
    return predicted, found


def predict_knowing(predictor: MeasuredModel, mistakes: Sequence[Mistake]) -> tuple[RunReadings, ...]:
    """Return the predicted outputs of each run.

    Raises:
        NotReachedError: no sample has an equilibrium; the error names the mistakes.
        UserError: a model of one's own has no finite reading in most samples.
    """
    try:
        predicted = predictor.predict()
    except NotReachedError as error:
        if not mistakes:
            raise
        raise NotReachedError(f"{error}. {' '.join(one.sentence for one in mistakes)}") from None
    if not isinstance(predictor, Predictor):
        _check_finite(predictor.measurement, predicted)
    return predicted


def _check_finite(measurement: Measurement, predicted: Sequence[RunReadings]) -> None:
    """Raise `UserError` if most samples have no finite reading."""
    lost = {
        run.name: int(np.any([~np.isfinite(values) for values in readings.values()], axis=0).sum())
        for run, readings in zip(measurement.runs, predicted, strict=True)
    }
    count, every = sum(lost.values()), sum(map(len, measurement.runs))
    if count > MOST_LOST * every:
        raise UserError(
            f"{measurement.source}: the model has no finite reading in {count} of {every} samples, most of them in run "
            f"'{max(lost, key=lambda name: lost[name])}': it diverges there, or returns NaN. Look at that run's inputs "
            "and first readings, and at the model's time step."
        )
