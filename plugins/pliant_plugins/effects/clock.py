"""Inputs and loads of a run by another clock, shared by the effects of wrong clocks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pliant.records.design import Array
from pliant.records.history import History


def at_times(history: History, time_s: Array) -> History:
    """Return the run with inputs, loads and base turns at other times (t,), constant beyond the ends.

    Switches (a valve) and slow quantities (a temperature) are not shifted: interpolation would make a valve
    half open.
    """
    assert history.time_s is not None
    clock = history.time_s

    def moved(values: Array) -> Array:
        columns = values.reshape(len(clock), -1).T
        rows = np.stack([np.interp(time_s, clock, column) for column in columns], axis=1)
        return np.asarray(rows.reshape(values.shape))

    return history.with_(
        actuation={name: moved(values) for name, values in history.actuation.items()},
        tip_force_n=moved(history.tip_force_n),
        moment_n_m=moved(history.moment_n_m),
        base_angles_rad=moved(history.base_angles_rad),
        payload_kg=None if history.payload_kg is None else moved(history.payload_kg),
    )


def still_or_untimed(histories: Sequence[History]) -> str:
    """Return why a wrong clock has no effect in these runs; empty if it has one."""
    timed = [history for history in histories if history.time_s is not None]
    if not timed:
        return "no run has a clock"
    moves = any(np.ptp(values) > 0.0 for history in timed for values in history.signals().values())
    return "" if moves else "no input moves while a clock runs"
