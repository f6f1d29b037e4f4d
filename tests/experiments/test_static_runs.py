"""The menu of a bench that recorded no time."""

from __future__ import annotations

import numpy as np
import pytest
from tests.diagnosis.quick import measurement_of, predictor_of
from tests.experiments.test_menu import CHAIN, OPPOSED

from pliant.diagnosis.next_run import catalogue_of
from pliant.experiments.experiment_catalogue import static_catalogue
from pliant.experiments.planned_run import BenchScale, named_run
from pliant.records.history import History

SCALE = BenchScale.of_chain(CHAIN, 15e3)
TIMED = ("slow_cycles", "fast_cycles", "small_loops", "holds", "vented_zero", "closed_valve", "step_response")


def test_no_run_depends_on_time():
    runs = static_catalogue(SCALE)
    assert not {run.name for run in runs} & set(TIMED)
    assert all(run.history.time_s is None and run.motion_minutes == 0.0 for run in runs)
    assert all(run.minutes >= 2.0 for run in runs)
    assert not any(word in run.words for run in runs for word in ("cycle", "Hz", " s ", "hold"))


def test_loads_and_the_drive_reach_as_far_as_the_bench_did():
    passive, loaded = (
        named_run(static_catalogue(SCALE), name).history for name in ("passive_load_steps", "load_steps")
    )
    assert not passive.actuation["pressure_pa"].any()
    assert passive.moment_n_m.max() == -passive.moment_n_m.min() == pytest.approx(SCALE.load[0])
    assert np.ptp(loaded.actuation["pressure_pa"]) == 0.0 < loaded.actuation["pressure_pa"][0]
    assert named_run(static_catalogue(SCALE), "level").history.actuation["pressure_pa"].max() == 15e3


def test_the_blocking_load_is_the_drives_torque():
    history = named_run(static_catalogue(SCALE), "blocked").history
    torque = SCALE.blocking_moment(history.actuation)
    assert torque is not None
    assert np.allclose(history.moment_n_m, torque)
    assert history.moment_n_m[-1] > 0.0 == history.moment_n_m[0]


def test_opposed_chambers_are_driven_both_ways():
    history = named_run(static_catalogue(BenchScale.of_chain(OPPOSED, 15e3)), "level").history
    assert all(values.max() == 15e3 for values in history.actuation.values())
    assert len(history) == 9


def test_states_without_a_clock_are_followed_by_states_without_a_clock():
    """What `diagnose` offers follows what was measured."""
    for clock in (None, np.arange(5.0)):
        history = History.of({"pressure_pa": 3e3 * np.arange(5.0)}, clock, run="a")
        measured = measurement_of([history], [{"angle_rad": np.zeros(5)}])
        timed = [run for run in catalogue_of(predictor_of(CHAIN, measured)) if run.history.time_s is not None]
        assert bool(timed) == (clock is not None)
