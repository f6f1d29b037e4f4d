"""A first-order lag at the samples of a run, shared by what arrives late and what is read late.

    T y' + y = u

with u a straight line between samples, for which the solution over a step h is exact at any step. With the distance
d = y − u, which is zero at the start,

    d(t + h) = e^(−h/T) d(t) − (1 − e^(−h/T)) T/h Δu

Where nothing flows, as behind a closed valve, y stands still.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array


def lagged(values: Array, time_s: Array, constant_s: float, flows: NDArray[np.bool_] | None = None) -> Array:
    """(t,) what has arrived of `values` (t,) at `time_s` (t,) through a lag of `constant_s` > 0, from balance.

    `flows` (t − 1,) says in which steps anything does; by default in all.
    """
    change = np.diff(values)
    steps = np.diff(time_s) / constant_s
    arrived = -np.expm1(-steps)
    mean = np.divide(arrived, steps, out=np.ones_like(steps), where=steps > 0)
    if flows is not None:
        arrived, mean = np.where(flows, arrived, 0.0), np.where(flows, mean, 1.0)
    # Plain floats: a recurrence cannot be vectorised.
    behind, distances = 0.0, [0.0]
    for kept, moved in zip((1.0 - arrived).tolist(), (mean * change).tolist(), strict=True):
        behind = kept * behind - moved
        distances.append(behind)
    late: Array = values + np.array(distances)
    return late
