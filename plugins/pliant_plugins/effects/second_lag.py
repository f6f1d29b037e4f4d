"""Two first-order lags in a row, of which the first has a time of its own for either direction.

    T y' + y = u,      T = T_r while y ≤ u, T_f while y > u        (`lag.py`)
    T₂ z' + z = y

with u a straight line of slope s. Within a piece in which T does not change, y = u + d with d = −s T + c e^(−t/T), so
with w = z − u, a step h is exact:

    w(t + h) = E₂ w(t) + G (d(t) + s T) − (T + T₂)(1 − E₂) s
    E₂ = e^(−h/T₂),      G = T/(T − T₂) (e^(−h/T) − e^(−h/T₂)),      G → h/T e^(−h/T) where T₂ → T

The second stage is linear: where y passes u within a step, that instant is put between the samples (d = 0 there), and
every piece has one T. Where nothing flows both stages stand still.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array
from pliant_plugins.effects.lag import accumulated, distances_of


def lagged_twice(
    values: Array,
    time_s: Array,
    times_s: tuple[float, float],
    second_s: float,
    flows: NDArray[np.bool_] | None = None,
) -> Array:
    """(t,) what has arrived of `values` (t,) at `time_s` (t,) behind both stages, from balance.

    `times_s` are the first stage's time constants while it rises and while it falls, `second_s` the second one's, all
    above zero. `flows` (t − 1,) says in which steps anything does; by default in all.
    """
    distances, met = distances_of(values, time_s, times_s[0], flows, times_s[1])
    inputs, clock, first = values, time_s, np.array(distances)
    running = np.ones(len(values) - 1, bool) if flows is None else flows
    steps = np.array([k for k, _ in met], int)
    if met:
        since = np.array([reached for _, reached in met])
        at = time_s[steps] + since
        there = values[steps] + np.diff(values)[steps] * since / np.diff(time_s)[steps]
        inputs, clock, first = (
            np.insert(whole, steps + 1, new) for whole, new in ((values, there), (time_s, at), (first, 0.0))
        )
        running = np.insert(running, steps + 1, True)
    late: Array = inputs + np.array(accumulated(*_shares(inputs, clock, first, running, times_s, second_s)))
    return np.delete(late, steps + 1 + np.arange(len(steps)))


def _shares(
    inputs: Array,
    clock: Array,
    first: Array,
    running: NDArray[np.bool_],
    times_s: tuple[float, float],
    second_s: float,
) -> tuple[list[float], list[float]]:
    """What each piece leaves of w, and what it adds to it."""
    change, steps, before = np.diff(inputs), np.diff(clock), first[:-1]
    above = (before > 0.0) | ((before == 0.0) & (change < 0.0))
    one_s = np.where(above, times_s[1], times_s[0])
    one, two = steps / one_s, steps / second_s
    apart = np.abs(two - one)
    mixed = np.exp(-np.minimum(one, two)) * _mean(apart)
    ratio = one_s / second_s
    more = two * mixed * before + change * (ratio * mixed - (1.0 + ratio) * _mean(two))
    return np.where(running, np.exp(-two), 1.0).tolist(), np.where(running, more, -change).tolist()


def _mean(x: Array) -> Array:
    """(1 − e^(−x)) / x, the mean of e^(−t) over [0, x]."""
    mean: Array = np.divide(-np.expm1(-x), x, out=np.ones_like(x), where=x > 0)
    return mean
