"""Readings after states that nobody recorded are left out; a run from rest keeps all of its own."""

from __future__ import annotations

import numpy as np
import pytest
from tests.diagnosis.quick import P, measurement_of

from pliant.measurements.beginnings import FORGOTTEN_S, with_known_states
from pliant.records.history import History

TIME = 0.4 * np.arange(200)


def cycle(start: float = 0.0) -> np.ndarray:
    """Triangles between zero and P of 20 s each, from `start` seconds on."""
    return P * (1.0 - np.abs(((TIME + start) / 10.0) % 2.0 - 1.0))


def left(*histories: History) -> list[np.ndarray]:
    readings = [{"angle_rad": np.ones(len(h))} for h in histories]
    known, _ = with_known_states(measurement_of(histories, readings))
    return [np.isfinite(run.outputs["angle_rad"]) for run in known.runs]


def test_a_run_from_rest_or_from_a_hold_keeps_its_readings() -> None:
    held = np.where(TIME < 10.0, 0.5 * P, P)
    for pressure in (cycle(), held, np.full(len(TIME), P)):
        history = History.of({"pressure_pa": pressure}, TIME)
        measurement = measurement_of([history], [{"angle_rad": np.ones(len(TIME))}])
        assert with_known_states(measurement) == (measurement, ())
    still = History.of({"pressure_pa": cycle(5.0)})  # states of their own, reached slowly
    assert left(still)[0].all()


@pytest.mark.parametrize("start", [3.0, 14.0])
def test_the_first_seconds_of_a_run_that_begins_in_motion_are_left_out(start: float) -> None:
    there = left(History.of({"pressure_pa": cycle(start)}, TIME), History.of({"pressure_pa": cycle()}, TIME))
    assert np.array_equal(there[0], TIME >= FORGOTTEN_S) and there[1].all()


def test_a_load_that_moves_counts_too() -> None:
    load = 1e-3 * np.minimum(0.3 + TIME, 1.0)
    assert np.array_equal(
        left(History.of({"pressure_pa": np.zeros(200)}, TIME, moment_n_m=load))[0], TIME >= 4.0
    )


def test_what_follows_a_dropped_stretch_is_left_out_if_inputs_moved_meanwhile() -> None:
    kept = (TIME < 24.0) | (TIME > 33.0)
    moving = History.of({"pressure_pa": cycle()[kept]}, TIME[kept])
    there, clock = left(moving)[0], TIME[kept]
    assert np.array_equal(there, (clock < 24.0) | (clock >= clock[clock > 33.0][0] + FORGOTTEN_S))
    assert left(History.of({"pressure_pa": np.minimum(cycle(), 0.0)[kept]}, TIME[kept]))[0].all()


def test_the_sentence_names_the_first_run_and_how_much() -> None:
    runs = [History.of({"pressure_pa": cycle(s)}, TIME, run=name) for s, name in ((0.0, "a"), (3.0, "b"))]
    _, said = with_known_states(measurement_of(runs, [{"angle_rad": np.ones(200)}] * 2))
    assert "run 'b' first" in said[0] and "4 s" in said[0] and said[0].startswith("1 of 2 runs")
