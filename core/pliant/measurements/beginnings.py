"""Readings that rest on states which nobody recorded: the first seconds of a run that begins in motion.

A model begins a run at rest under its first inputs. Where these were on their way already, or where a stretch was
dropped while they moved, what lags, creeps or rubs is elsewhere, and forgets it within seconds. These readings are
left out, their inputs stay.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pliant.formatting import number, plural
from pliant.measurements.doubts import DRIVEN, IDLE
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.measurement import Measurement

# What is left out of a run from such an instant on: so many seconds, and at most this share of the run.
FORGOTTEN_S, SHARE = 4.0, 0.25
# A stretch is missing where a step is so many times the usual one, and longer than so many seconds.
TIMES, LONG_S = 5.0, 2.0
# Samples within which an input that moves is seen to.
AT_ONCE = 2


def with_known_states(measurement: Measurement) -> tuple[Measurement, tuple[str, ...]]:
    """The measurement without the readings after unknown states, and a sentence about them; none where all is known."""
    highest = _highest([run.history for run in measurement.runs])
    runs, found, seconds = [], [], 0.0
    for run in measurement.runs:
        unknown = unknown_states(run.history, highest)
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
        f"{of} begin in motion or lack a stretch in which inputs move (run '{found[0]}' first): what the model "
        f"remembers is not known there, and {number(seconds, 3)} s of readings after it are left out.",
    )


def unknown_states(history: History, highest: dict[str, float]) -> NDArray[np.bool_]:
    """(t,) samples that follow, within what is forgotten, an instant at which the state is not known.

    `highest`: the largest size of each input and load over all runs.
    """
    unknown = np.zeros(len(history), bool)
    if history.time_s is None or len(history) < AT_ONCE + 1:
        return unknown
    time, signals = history.time_s, _moving(history)
    length = min(FORGOTTEN_S, SHARE * float(time[-1] - time[0]))
    on = any(abs(v[0]) > DRIVEN * highest[name] for name, v in signals.items())
    if on and _moves(signals, highest, 0, AT_ONCE):
        unknown |= time < time[0] + length
    steps = np.diff(time)
    for k in np.flatnonzero(steps > max(TIMES * float(np.median(steps)), LONG_S)):
        if _moves(signals, highest, int(k), min(int(k) + 1 + AT_ONCE, len(history) - 1)):
            unknown |= (time > time[k]) & (time < time[k + 1] + length)
    return unknown


def _moving(history: History) -> dict[str, Array]:
    forces = {f"tip_force_{k}": values for k, values in enumerate(history.tip_force_n.T)}
    return {**history.actuation, "moment_n_m": history.moment_n_m, **forces}


def _highest(histories: list[History]) -> dict[str, float]:
    tables = [_moving(history) for history in histories]
    return {name: max(float(np.abs(table[name]).max()) for table in tables) for name in tables[0]}


def _moves(signals: dict[str, Array], highest: dict[str, float], first: int, last: int) -> bool:
    return any(
        float(np.ptp(values[first : last + 1])) > IDLE * highest[name] > 0.0
        for name, values in signals.items()
    )
