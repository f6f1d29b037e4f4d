"""Damaged recordings: every step of the loop answers in words and without a Python warning."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from tests.diagnosis.bench_files import bench, study
from tests.diagnosis.quick import BENCH, REGISTRY, effect, make_measurement
from tests.report.pages import words

from pliant.diagnosis.diagnosis import diagnose
from pliant.diagnosis.extension import Ground, extend
from pliant.diagnosis.improvement import improve
from pliant.evidence.comparison import compare
from pliant.evidence.prediction import Predictor
from pliant.records.design import Array
from pliant.records.measurement import Measurement
from pliant.report.extension import extension_document
from pliant.report.improvement import improvement_document
from pliant.report.render import page

KINDS = ["stiffness", "sensor_bias"]
RNG = np.random.default_rng(5)
DAMAGE: dict[str, Callable[[Array], Array]] = {
    "an encoder of 5°": lambda a: np.radians(5.0 * np.round(np.degrees(a) / 5.0)),
    "a cable that is off": np.zeros_like,
    "half the readings gone": lambda a: np.where(RNG.random(a.shape) < 0.5, np.nan, a),
    "outliers": lambda a: np.where(RNG.random(a.shape) < 0.01, 100.0 * a, a),
    "one reading a run": lambda a: np.where(np.arange(len(a)) == 7, a, np.nan),
}


def damaged(measurement: Measurement, damage: Callable[[Array], Array]) -> Measurement:
    runs = measurement.runs
    return make_measurement(
        [run.history for run in runs], [{"angle_rad": damage(run.outputs["angle_rad"])} for run in runs]
    )


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", DAMAGE)
def test_the_loop_answers(tmp_path, name):
    model = study(tmp_path)
    measurement = damaged(bench(tmp_path, effect("stiffness", factor=1.2)), DAMAGE[name])
    predictor = Predictor.from_study(BENCH, model, measurement)
    assert compare(measurement, predictor.predict()).rmse_over_floor != 0.0
    found = diagnose(predictor, kinds=KINDS)
    assert found.judgement.sentence
    better = improve(BENCH, model, measurement, kinds=KINDS)
    document = improvement_document("damaged", measurement, better, REGISTRY)
    assert "nan" not in words(page(document).html) + document.sentence
    fitted = extend(Ground.from_study(BENCH, model, measurement), (), ["stiffness"], profiles=False)
    assert "nan" not in extension_document("damaged", measurement, fitted, REGISTRY).sentence
