"""A first-order lag at the samples of a run, shared by what arrives late and what is read late.

    T y' + y = u,      T = T_r while y ≤ u, T_f while y > u

with u a straight line between samples, for which the solution over a step h is exact at any step. With the distance
d = y − u, which is zero at the start,

    d(t + h) = e^(−h/T) d(t) − (1 − e^(−h/T)) T/h Δu

Where y meets u within a step, at T ln(1 + d h / (T Δu)), the other time rules from there, with d = 0: also exact. It
happens at most once in a step, for d then has the sign of −Δu. Where nothing flows, as behind a closed valve, y
stands still.
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
    """(t,) what has arrived of `values` (t,) at `time_s` (t,) through a lag of `constant_s` > 0, from balance.

    `falling_s` > 0 is the time constant while what has arrived is above the values, by default the same. `flows`
    (t − 1,) says in which steps anything does; by default in all.
    """
    distances, _, _ = distances_of(
        values, time_s, constant_s, flows, constant_s if falling_s is None else falling_s
    )
    late: Array = values + distances
    return late


def distances_of(
    values: Array, time_s: Array, constant_s: float, flows: NDArray[np.bool_] | None, falling_s: float
) -> tuple[Array, NDArray[np.int64], Array]:
    """d (t,) at every sample, and where y met u: the steps (m,) and the times (m,) since their start, s."""
    from pliant_plugins.effects.recurrences import accumulated, distances_of_two

    change, steps = np.diff(values), np.diff(time_s)
    rising = _shares(change, steps, constant_s, flows)
    if falling_s == constant_s:
        return accumulated(*rising), np.zeros(0, np.int64), np.zeros(0)
    falling = _shares(change, steps, falling_s, flows)
    found: tuple[Array, NDArray[np.int64], Array] = distances_of_two(
        change, steps, *rising, *falling, constant_s, falling_s
    )
    return found


def _shares(
    change: Array, steps: Array, constant_s: float, flows: NDArray[np.bool_] | None
) -> tuple[Array, Array]:
    """(t − 1,) what each step leaves of the distance, and what it adds to it."""
    times = steps / constant_s
    arrived = -np.expm1(-times)
    mean = np.divide(arrived, times, out=np.ones_like(times), where=times > 0)
    if flows is not None:
        arrived, mean = np.where(flows, arrived, 0.0), np.where(flows, mean, 1.0)
    return 1.0 - arrived, -mean * change
