"""Readings after unrecorded states are left out; a run that starts from rest keeps all its readings."""

from __future__ import annotations

import numpy as np
import pytest
from tests.diagnosis.quick import P, blank, effect, make_measurement, make_predictor

from pliant.measurements.beginnings import FORGOTTEN_S, prepend_ramp, with_known_states
from pliant.records.history import History
from pliant.testing.samples import sample_chain

TIME = 0.4 * np.arange(200)


def cycle(start: float = 0.0) -> np.ndarray:
    """Return triangles between zero and P of 20 s each, from `start` seconds on."""
    return P * (1.0 - np.abs(((TIME + start) / 10.0) % 2.0 - 1.0))


def left(*histories: History) -> list[np.ndarray]:
    readings = [{"angle_rad": np.ones(len(h))} for h in histories]
    known, _ = with_known_states(make_measurement(histories, readings))
    return [np.isfinite(run.outputs["angle_rad"]) for run in known.runs]


def test_a_run_from_rest_or_from_a_hold_keeps_its_readings() -> None:
    held = np.where(TIME < 10.0, 0.5 * P, P)
    for pressure in (cycle(), held, np.full(len(TIME), P)):
        history = History.from_arrays({"pressure_pa": pressure}, TIME)
        measurement = make_measurement([history], [{"angle_rad": np.ones(len(TIME))}])
        assert with_known_states(measurement) == (measurement, ())
    still = History.from_arrays({"pressure_pa": cycle(5.0)})  # separate states, reached slowly
    assert left(still)[0].all()


@pytest.mark.parametrize("start", [3.0, 14.0])
def test_the_first_seconds_in_a_run_that_begins_in_motion_are_left_out(start: float) -> None:
    there = left(
        History.from_arrays({"pressure_pa": cycle(start)}, TIME),
        History.from_arrays({"pressure_pa": cycle()}, TIME),
    )
    assert np.array_equal(there[0], TIME >= FORGOTTEN_S) and there[1].all()


def test_a_load_that_moves_counts_too() -> None:
    load = 1e-3 * np.minimum(0.3 + TIME, 1.0)
    assert np.array_equal(
        left(History.from_arrays({"pressure_pa": np.zeros(200)}, TIME, moment_n_m=load))[0], TIME >= 4.0
    )


def test_a_pressure_that_rises_from_zero_under_a_load_that_stands_begins_at_rest() -> None:
    loaded = History.from_arrays({"pressure_pa": cycle()}, TIME, moment_n_m=1e-3)
    assert left(loaded)[0].all() and prepend_ramp([loaded]) == [loaded]


def test_what_follows_a_dropped_stretch_is_left_out_if_inputs_moved_meanwhile() -> None:
    kept = (TIME < 24.0) | (TIME > 33.0)
    moving = History.from_arrays({"pressure_pa": cycle()[kept]}, TIME[kept])
    there, clock = left(moving)[0], TIME[kept]
    assert np.array_equal(there, (clock < 24.0) | (clock >= clock[clock > 33.0][0] + FORGOTTEN_S))
    assert left(History.from_arrays({"pressure_pa": np.minimum(cycle(), 0.0)[kept]}, TIME[kept]))[0].all()


def test_the_sentence_names_the_first_run_and_how_much() -> None:
    runs = [
        History.from_arrays({"pressure_pa": cycle(s)}, TIME, run=name) for s, name in ((0.0, "a"), (3.0, "b"))
    ]
    _, said = with_known_states(make_measurement(runs, [{"angle_rad": np.ones(200)}] * 2))
    assert "run 'b' first" in said[0] and "4 s" in said[0] and said[0].startswith("1 of 2 runs")


def test_a_run_is_led_in_on_the_line_that_it_begins_on() -> None:
    """A cycle recorded from 3 s on started at zero 3 s before; a falling one came from the largest pressure."""
    rising, falling = (History.from_arrays({"pressure_pa": cycle(s)}, TIME) for s in (3.0, 14.0))
    rest = History.from_arrays({"pressure_pa": cycle()}, TIME)
    led = prepend_ramp([rising, falling, rest])
    assert [one.lead for one in led] == [1, 1, 0] and led[2] is rest
    assert led[0].time_s[0] == pytest.approx(-3.0) and led[0].actuation["pressure_pa"][0] == 0.0
    assert led[1].time_s[0] == pytest.approx(-4.0) and led[1].actuation["pressure_pa"][0] == pytest.approx(P)
    for one, other in zip(led, (rising, falling, rest), strict=True):
        assert all(np.array_equal(v[one.lead :], other.signals()[k]) for k, v in one.signals().items())


def test_what_creeps_is_remembered_by_a_run_that_is_led_in() -> None:
    whole = History.from_arrays({"pressure_pa": cycle()}, TIME)
    cut = History.from_arrays({"pressure_pa": cycle()[10:]}, TIME[10:])
    creep = [effect("viscoelastic", share=0.4, time_s=12.0)]
    chain = sample_chain(modules=1)
    truth = make_predictor(chain, blank([whole])).predict(creep)[0]["angle_rad"][10:]
    found = make_predictor(chain, blank([cut])).predict(creep)[0]["angle_rad"]
    settled = make_predictor(chain, blank([cut]))
    settled._histories = [cut]
    assert len(found) == len(truth)
    assert np.abs(found - truth).max() < 0.05 * np.abs(settled.predict(creep)[0]["angle_rad"] - truth).max()


def test_a_run_that_settles_under_inputs_that_stand_still_keeps_what_follows() -> None:
    held = History.from_arrays({"pressure_pa": np.full(200, P)}, TIME, run="late")
    whole = History.from_arrays({"pressure_pa": cycle()}, TIME, run="whole")
    readings = [{"angle_rad": 0.5 * (1.0 - np.exp(-TIME / 3.0))}, {"angle_rad": 0.5 * cycle() / P}]
    known, said = with_known_states(make_measurement([held, whole], readings))
    there = np.isfinite(known.runs[0].outputs["angle_rad"])
    assert 7.0 < TIME[there][0] < 11.0 and there[-1] and "run 'late' first" in said[0]  # 3 s · ln 20
    assert np.isfinite(known.runs[1].outputs["angle_rad"]).all()
