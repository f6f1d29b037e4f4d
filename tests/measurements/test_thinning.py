"""Long recordings reduced to part of their samples: the inputs and the model's predictions are preserved."""

from __future__ import annotations

import numpy as np
import pytest
from tests.diagnosis.quick import P, blank, effect, joint, make_measurement, make_predictor

from pliant.measurements import thinning
from pliant.measurements.thinning import downsample
from pliant.records.history import History

CHAIN = joint()


@pytest.fixture(autouse=True)
def short_is_long(monkeypatch):
    monkeypatch.setattr(thinning, "LONG", 800)
    monkeypatch.setattr(thinning, "KEPT", 400)


def steps_and_ramps(samples: int = 4000) -> History:
    """Return ramps between levels, a sudden step, a slow wave of the load, and a valve that closes for a while."""
    time = 0.01 * np.arange(samples)
    ramps = np.interp(time, [0, 6, 9, 12, 20, 20.01, 40], [0, P, P, 0.2 * P, 0.2 * P, 0.8 * P, 0.8 * P])
    closed = np.where((time > 7.0) & (time < 8.0), 0.0, 1.0)
    load = 2e-3 * np.sin(time / 3.0)
    return History.from_arrays({"pressure_pa": ramps}, time, moment_n_m=load, valve_open=closed)


def measured(history: History, read=None):
    """Return the model's angles with damping; readings at the given samples alone, if any."""
    angle = predicted(history, effect("viscous_damping", time_s=0.4))
    if read is not None:
        angle = np.where(read, angle, np.nan)
    return make_measurement([history], [{"angle_rad": angle}])


def predicted(history: History, *effects) -> np.ndarray:
    return make_predictor(CHAIN, blank([history])).predict(effects)[0]["angle_rad"]


def test_a_short_recording_stays_as_it_is():
    measurement = measured(steps_and_ramps(700))
    assert downsample(measurement) == (measurement, ())


def test_inputs_are_the_same_straight_lines_and_switches_stand_where_they_stood():
    history = steps_and_ramps()
    short, said = downsample(measured(history))
    (kept,) = [run.history for run in short.runs]
    assert len(kept) < 800 and "4000 samples" in said[0]
    assert kept.time_s[0] == history.time_s[0] and kept.time_s[-1] == history.time_s[-1]
    for name, values in history.signals().items():
        if name != "valve_open":
            between = np.interp(history.time_s, kept.time_s, kept.signals()[name])
            assert np.abs(between - values).max() <= 0.005 * max(np.ptp(values), 1e-300)
    leads_to = np.searchsorted(kept.time_s, history.time_s)
    assert np.array_equal(kept.valve_open[leads_to], history.valve_open)


@pytest.mark.parametrize(
    "hidden", [{}, {"viscous_damping": {"time_s": 0.4}}, {"supply_lag": {"time_s": 0.5}}]
)
def test_the_model_predicts_the_same_for_what_is_kept(hidden):
    history = steps_and_ramps()
    effects = [effect(kind, **values) for kind, values in hidden.items()]
    short = downsample(measured(history))[0].runs[0].history
    whole, part = predicted(history, *effects), predicted(short, *effects)
    there = np.searchsorted(history.time_s, short.time_s)
    assert np.sqrt(np.mean((part - whole[there]) ** 2)) < 2e-3 * np.ptp(whole)


def test_readings_are_thinned_not_lost_where_a_camera_is_slower_than_the_supply():
    history = steps_and_ramps()
    read = np.arange(len(history)) % 9 == 4
    short, _ = downsample(measured(history, read))
    kept = np.isfinite(short.runs[0].outputs["angle_rad"]).sum()
    assert kept >= read.sum() // 10 - 1


def test_a_recording_whose_inputs_turn_everywhere_stays_whole():
    time = 0.01 * np.arange(4000)
    noise = np.random.default_rng(0).normal(0.0, 0.2 * P, len(time))
    measurement = measured(History.from_arrays({"pressure_pa": np.clip(0.5 * P + noise, 0.0, P)}, time))
    assert downsample(measurement) == (measurement, ())
