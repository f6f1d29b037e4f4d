"""Repeats that differ in proportion to what they read."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.diagnosis.tables import table

from pliant.diagnosis.noise import Drift, drift_between
from pliant.diagnosis.verdict import THRESHOLDS, judge
from pliant.measurements.repeats import repeat_groups
from pliant.records.history import History
from pliant.records.measurement import MeasuredRun, Measurement

SIGMA = 0.01
N = 60


def measured(change: float, offset: float = 0.0, conditions: int = 8, seed: int = 1) -> Measurement:
    """Each condition twice, all first runs before all second ones, which read `change` more of an angle."""
    rng = np.random.default_rng(seed)
    runs = []
    for again in range(2):
        for k in range(conditions):
            angle = (0.2 + 0.05 * k) * np.sin(np.linspace(0.0, np.pi, N)) * (1.0 + again * change)
            angle = angle + offset * rng.standard_normal() + SIGMA * rng.standard_normal(N)
            pressure = 1e3 * (k + 1) * np.sin(np.linspace(0.0, np.pi, N))
            history = History.of({"pressure_pa": pressure}, np.arange(N, dtype=float), run=f"r{again}{k}")
            runs.append(MeasuredRun(history, {"angle_rad": angle}, {}, np.ones(N), np.arange(N)))
    return Measurement(tuple(runs), ("angle_rad",))


def found(measurement: Measurement, explained: bool = False) -> Drift | None:
    residuals = [
        {"angle_rad": np.zeros(N) if explained else run.outputs["angle_rad"]} for run in measurement.runs
    ]
    return drift_between(measurement, residuals, {"angle_rad": SIGMA}, repeat_groups(measurement))


def test_a_change_of_scale_is_found_with_its_size() -> None:
    drift = found(measured(0.1))
    assert drift is not None
    assert drift.share == pytest.approx(0.1 / 1.05, rel=0.05)  # of the mean of both
    readings = np.concatenate(
        [run.outputs["angle_rad"] - run.outputs["angle_rad"].mean() for run in measured(0.1).runs]
    )
    assert drift.size == pytest.approx(drift.share * readings.std() / SIGMA, rel=0.05)


@pytest.mark.parametrize("seed", range(5))
def test_noise_and_offsets_of_runs_are_no_drift(seed: int) -> None:
    assert found(measured(0.0, offset=0.03, seed=seed)) is None


def test_what_a_model_explains_is_no_drift_and_few_groups_tell_nothing() -> None:
    assert found(measured(0.1), explained=True) is None
    assert found(measured(0.1, conditions=4)) is None


def test_a_large_drift_is_the_verdict_and_a_small_one_is_not() -> None:
    plain = table({(): 3.0, ("a",): 1.0, ("b",): 2.9})
    for size, verdict in (
        (2 * THRESHOLDS.drift, "not_repeatable"),
        (0.5 * THRESHOLDS.drift, "missing_effect"),
    ):
        noise = replace(plain.noise, drift=Drift("angle_rad", -0.04, size, -9.0))
        judged = judge(replace(plain, noise=noise), THRESHOLDS, 2)
        assert judged.verdict == verdict
        assert ("4.0% less angle_rad" in " ".join(judged.reasons)) is (verdict == "not_repeatable")
