"""Readings that depend on unrecorded states: the first seconds of a run that begins in motion.

A model begins a run at rest under its first inputs. If these were already moving, or if samples are missing while they
moved, the states of lag, creep and friction are unknown and decay within seconds. These readings are left out, their
inputs are kept. For slower creep a ramp is prepended: the straight line of the first inputs is extrapolated back to its
origin.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pliant.formatting import number, plural
from pliant.measurements.doubts import DRIVEN, IDLE, settling
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.measurement import Measurement

# What is left out of a run from such an instant on: this many seconds, and at most this share of the run.
FORGOTTEN_S, SHARE = 4.0, 0.25
# Samples are missing where a step exceeds the usual one by this factor, and is longer than this many seconds.
TIMES, LONG_S = 5.0, 2.0
# Samples within which the motion of an input is detected.
AT_ONCE = 2


def with_known_states(measurement: Measurement) -> tuple[Measurement, tuple[str, ...]]:
    """Return the measurement without the readings after unknown states, and a sentence about them.

    No sentence is returned if all states are known.
    """
    highest = _highest([run.history for run in measurement.runs])
    runs, found, seconds = [], [], 0.0
    of_outputs = [settling(measurement.runs, name) for name in measurement.outputs]
    settled = {
        run.name: max(one[run.name][2] for one in of_outputs if run.name in one)
        for run in measurement.runs
        if any(run.name in one for one in of_outputs)
    }
    for run in measurement.runs:
        if run.history.let_go is not None:  # its state is known: held there until the release
            runs.append(run)
            continue
        unknown = unknown_states(run.history, highest)
        if run.name in settled and run.history.time_s is not None:
            unknown |= run.history.time_s < settled[run.name]
        if unknown.any():
            found.append(run.name)
            assert run.history.time_s is not None
            steps = np.diff(run.history.time_s, append=run.history.time_s[-1])
            seconds += float(steps[unknown].sum())
            run = run.with_outputs({name: np.where(unknown, np.nan, v) for name, v in run.outputs.items()})
        runs.append(run)
    if not found:
        return measurement, ()
    of = "All runs" if len(found) == len(runs) else f"{len(found)} of {plural(len(runs), 'run')}"
    return replace(measurement, runs=tuple(runs)), (
        f"{of} begin in motion or lack a stretch in which inputs move (run '{found[0]}' first): "
        f"the model's memory is not known there, and {number(seconds, 3)} s of readings after it are left out.",
    )


def prepend_ramp(histories: Sequence[History]) -> list[History]:
    """Return histories with a sample prepended to those that begin in motion.

    Inputs and loads are extrapolated back along the line of the first samples: to zero if they move away from it, else
    to their largest magnitude in any run. Everything else keeps its first value.
    """
    highest = _highest(histories)
    found = []
    for history in histories:
        before = _came_from(history, highest)
        found.append(history if before is None else _with_first(history, *before))
    return found


def _came_from(history: History, highest: dict[str, float]) -> tuple[float, dict[str, float]] | None:
    """Return how long before its first sample a motion began, s, and its initial inputs; None for a run from rest."""
    if history.let_go is not None or not _begins_in_motion(history, highest):
        return None
    assert history.time_s is not None
    span = float(history.time_s[AT_ONCE] - history.time_s[0])
    seconds, ends = 0.0, {}
    for name, values in _moving(history).items():
        first, slope = float(values[0]), float(values[AT_ONCE] - values[0]) / span
        if abs(slope) * span <= IDLE * highest[name]:
            continue
        away = first * slope > 0.0
        ends[name] = 0.0 if away or first == 0.0 else float(np.copysign(highest[name], first))
        seconds = max(seconds, abs((first - ends[name]) / slope))
    return (seconds, ends) if seconds > 0.0 else None


def _with_first(history: History, seconds: float, ends: dict[str, float]) -> History:
    """Return the history with one more sample `seconds` earlier, inputs and loads at `ends`, else first values."""

    def longer(values: Array, first: object = None) -> Array:
        return np.concatenate(
            [values[:1] if first is None else np.atleast_1d(np.asarray(first, float)), values]
        )

    assert history.time_s is not None
    force = [[ends.get(f"tip_force_{k}", value) for k, value in enumerate(history.tip_force_n[0].tolist())]]
    optional = (history.payload_kg, history.valve_open)
    payload, valve = (None if values is None else longer(values) for values in optional)
    return history.with_(
        time_s=longer(history.time_s, history.time_s[0] - seconds),
        actuation={name: longer(values, ends.get(name)) for name, values in history.actuation.items()},
        tip_force_n=np.concatenate([force, history.tip_force_n]),
        moment_n_m=longer(history.moment_n_m, ends.get("moment_n_m")),
        temperature_c=longer(history.temperature_c),
        base_angles_rad=np.concatenate([history.base_angles_rad[:1], history.base_angles_rad]),
        payload_kg=payload,
        valve_open=valve,
        lead=1,
    )


def _begins_in_motion(history: History, highest: dict[str, float]) -> bool:
    if history.time_s is None or len(history) < AT_ONCE + 1:
        return False
    on = {name: v for name, v in _moving(history).items() if abs(v[0]) > DRIVEN * highest[name]}
    return _moves(on, highest, 0, AT_ONCE)  # a pressure that rises from zero under a constant load does not


def unknown_states(history: History, highest: dict[str, float]) -> NDArray[np.bool_]:
    """Return (t,) samples that follow an instant with an unknown state before its influence has decayed.

    `highest`: the largest size of each input and load over all runs.
    """
    unknown = np.zeros(len(history), bool)
    if history.time_s is None or len(history) < AT_ONCE + 1:
        return unknown
    time, signals = history.time_s, _moving(history)
    length = min(FORGOTTEN_S, SHARE * float(time[-1] - time[0]))
    if _begins_in_motion(history, highest):
        unknown |= time < time[0] + length
    steps = np.diff(time)
    for k in np.flatnonzero(steps > max(TIMES * float(np.median(steps)), LONG_S)):
        if _moves(signals, highest, int(k), min(int(k) + 1 + AT_ONCE, len(history) - 1)):
            unknown |= (time > time[k]) & (time < time[k + 1] + length)
    return unknown


def _moving(history: History) -> dict[str, Array]:
    forces = {f"tip_force_{k}": values for k, values in enumerate(history.tip_force_n.T)}
    return {**history.actuation, "moment_n_m": history.moment_n_m, **forces}


def _highest(histories: Sequence[History]) -> dict[str, float]:
    tables = [_moving(history) for history in histories]
    return {name: max(float(np.abs(table[name]).max()) for table in tables) for name in tables[0]}


def _moves(signals: dict[str, Array], highest: dict[str, float], first: int, last: int) -> bool:
    return any(
        float(np.ptp(values[first : last + 1])) > IDLE * highest[name] > 0.0
        for name, values in signals.items()
    )
