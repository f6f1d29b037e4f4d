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

import math

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
    distances, _ = distances_of(
        values, time_s, constant_s, flows, constant_s if falling_s is None else falling_s
    )
    late: Array = values + np.array(distances)
    return late


def distances_of(
    values: Array, time_s: Array, constant_s: float, flows: NDArray[np.bool_] | None, falling_s: float
) -> tuple[list[float], list[tuple[int, float]]]:
    """d at every sample, and where y met u: the step and the time since its start, s."""
    change, steps = np.diff(values), np.diff(time_s)
    rising = _shares(change, steps, constant_s, flows)
    if falling_s == constant_s:
        return accumulated(*rising), []
    falling = _shares(change, steps, falling_s, flows)
    return _distances_of_two(change, steps, rising, falling, (constant_s, falling_s))


def _shares(
    change: Array, steps: Array, constant_s: float, flows: NDArray[np.bool_] | None
) -> tuple[list[float], list[float]]:
    """What each step leaves of the distance, and what it adds to it: plain floats, as a recurrence has no vectors."""
    times = steps / constant_s
    arrived = -np.expm1(-times)
    mean = np.divide(arrived, times, out=np.ones_like(times), where=times > 0)
    if flows is not None:
        arrived, mean = np.where(flows, arrived, 0.0), np.where(flows, mean, 1.0)
    return (1.0 - arrived).tolist(), (-mean * change).tolist()


def accumulated(kept: list[float], added: list[float]) -> list[float]:
    """d at every sample, from 0: each step keeps a share of it and adds to it."""
    d, distances = 0.0, [0.0]
    for share, more in zip(kept, added, strict=True):
        d = share * d + more
        distances.append(d)
    return distances


def _distances_of_two(
    change: Array,
    steps: Array,
    rising: tuple[list[float], list[float]],
    falling: tuple[list[float], list[float]],
    times_s: tuple[float, float],
) -> tuple[list[float], list[tuple[int, float]]]:
    """d at every sample, with one time below the values and another above them, and where they met."""
    d, distances, met = 0.0, [0.0], []
    rows = zip(*rising, *falling, change.tolist(), steps.tolist(), strict=True)
    for k, (kept, added, kept_above, added_above, moved, step) in enumerate(rows):
        above = d > 0.0 or (d == 0.0 and moved < 0.0)
        after = kept_above * d + added_above if above else kept * d + added
        if d * after < 0.0 and kept < 1.0:
            before_s, after_s = (times_s[1], times_s[0]) if above else times_s
            reached = min(before_s * math.log1p(d * step / (before_s * moved)), step)
            met.append((k, reached))
            rest = step - reached
            after = moved * (after_s / step) * math.expm1(-rest / after_s)
        d = after
        distances.append(d)
    return distances, met
