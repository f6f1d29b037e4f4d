"""Comparison of a predictor with its own measurement: mistakes of the record first, then prediction and comparison."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pliant.errors import NotReachedError
from pliant.evidence.bookkeeping.findings import find_mistakes
from pliant.evidence.bookkeeping.mistake import Mistake
from pliant.evidence.comparison import Comparison, compare
from pliant.evidence.measured_model import MeasuredModel, RunReadings
from pliant.evidence.prediction import Predictor


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
    """Return the predicted outputs of each run; where no sample has an equilibrium the error names the mistakes."""
    try:
        return predictor.predict()
    except NotReachedError as error:
        if not mistakes:
            raise
        raise NotReachedError(f"{error}. {' '.join(one.sentence for one in mistakes)}") from None
