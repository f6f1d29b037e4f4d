"""A first-order lag at the samples of a run, shared by the effects of late inputs and late readings.

    T y' + y = u,      T = T_r while y ≤ u, T_f while y > u

with u a straight line between samples, for which the solution over a step h is exact at any step. With the distance
d = y − u, which is zero at the start,

    d(t + h) = e^(−h/T) d(t) − (1 − e^(−h/T)) T/h Δu

Where y meets u within a step, at T ln(1 + d h / (T Δu)), the other time constant applies from there, with d = 0: also
exact. It happens at most once in a step, since d then has the sign of −Δu. Without flow, as behind a closed valve, y is
constant.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array


def lagged(
    values: Array,
    time_s: Array,
    constant_s: float,
    flows: NDArray[np.bool_] | None = None,
    falling_s: float | None = None,
) -> Array:
    """Return (t,) the response at `time_s` (t,) to `values` (t,) through a lag of `constant_s` > 0, from balance.

    `falling_s` > 0 is the time constant while what has arrived is above the values, by default the same. `flows`
    (t − 1,) marks steps with flow; by default all.
    """
    from pliant_plugins.effects.recurrences import lagging

    falling_s = constant_s if falling_s is None else falling_s
    late: Array = values + lagging(*step_changes(values, time_s, flows), constant_s, falling_s)
    return late


def step_changes(
    values: Array, time_s: Array, flows: NDArray[np.bool_] | None
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return (t − 1,) change and duration (s) of each step, and whether anything flows."""
    return np.diff(values), np.diff(time_s), np.ones(len(values) - 1, bool) if flows is None else flows
