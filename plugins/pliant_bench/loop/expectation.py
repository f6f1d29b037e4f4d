"""What the explanations that are left predict for a run: mean and standard deviation of every reading."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pliant import api
from pliant.diagnosis.diagnosis import Diagnosis
from pliant.diagnosis.evidence_table import NOTHING, UNKNOWN
from pliant.evidence.measured_model import MeasuredModel
from pliant.evidence.opening import measured_model
from pliant.experiments.planned_run import unread_run
from pliant.interfaces.effect import EffectConfig
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.measurement import Measurement
from pliant_bench.loop.compared import explanation_name
from pliant_bench.watchdog import Expectation

# Explanations that are asked, the most probable ones first.
MOST_EXPLANATIONS = 4
# Error of a model that has not been compared with readings yet, and of one that has, as shares of the largest reading.
UNSEEN, SEEN = 0.5, 0.05


def expect_without_data(opened: api.OpenStudy, outputs: tuple[str, ...], history: History) -> Expectation:
    """Return the study's own prediction of a run, before any reading."""
    unread = Measurement((unread_run(history, outputs, outputs),), outputs, source="the plan")
    mean = _predict(measured_model(opened.context, opened.study, unread), history, ())
    sd = {name: np.full(len(v), UNSEEN * _largest(v)) for name, v in mean.items()}
    return Expectation(mean, sd, mean)


def expect(opened: api.OpenStudy, data: Measurement, diagnosis: Diagnosis, history: History) -> Expectation:
    """Return the prediction of the most probable explanation, and how far the others are from it."""
    model = api.predictor(opened, data)
    left = [
        kinds for kinds in diagnosis.judgement.probability if kinds != UNKNOWN and kinds in diagnosis.fits
    ]
    left = left[:MOST_EXPLANATIONS]
    weight = np.array([max(diagnosis.judgement.probability[kinds], 1e-9) for kinds in left])
    fits = [diagnosis.fits[kinds] for kinds in left]
    predicted = [_predict(model, history, fit.candidate.configs(fit.x)) for fit in fits]
    mean = predicted[0]
    before = mean if left[0] == NOTHING else _predict(model, history, ())
    sd, band = {}, {}
    for name, values in mean.items():
        apart = np.array([one[name] - values for one in predicted])
        spread = np.einsum("k,kt->t", weight / weight.sum(), np.nan_to_num(apart) ** 2)
        noise = diagnosis.scales.get(name, 0.0)
        band[name] = np.sqrt(spread + noise**2)
        sd[name] = np.sqrt(band[name] ** 2 + (SEEN * _largest(values)) ** 2)
    return Expectation(mean, sd, before, band, explanation_name(left[0]))


def _predict(model: MeasuredModel, history: History, effects: Sequence[EffectConfig]) -> dict[str, Array]:
    run = unread_run(history, model.outputs, model.outputs)
    driven = model.for_planned_runs(Measurement((run,), tuple(model.outputs), source="the plan"))
    return dict(driven.evaluate(tuple(effects)).runs[0])


def _largest(values: Array) -> float:
    there = values[np.isfinite(values)]
    return float(np.abs(there).max(initial=0.0))
