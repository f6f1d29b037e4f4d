"""Cycle numbers counted from the actuation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pliant.records.design import Array
from pliant.records.history import History

LOADED, RETURNED = (
    0.6,
    0.25,
)  # of a run's own range: a cycle has been above the first and comes below the second
SMALLEST = 0.1  # of the range of all runs: less than that is no cycle
AT_REST = 0.05  # of the range above the lowest point: still waiting


def cycles(history: History, spans: Mapping[str, float] | None = None) -> Array:
    """(t,) the cycle of each sample, from 1.

    A cycle is a rise of the actuation (the largest of all inputs, each over its span) above 60 % of the run's range
    after a return below 25 %: the two thresholds keep noise and small reversals from counting. The number
    changes where the rise begins.

    Args:
        history: the run.
        spans: range of each input over all runs; a run that moves less than a tenth of it has one cycle.
    """
    signal = np.zeros(len(history))
    for name, values in history.actuation.items():
        span = (spans or {}).get(name, float(np.ptp(values)))
        signal = np.maximum(signal, np.abs(values) / span) if span > 0 else signal
    span = float(np.ptp(signal)) if signal.size else 0.0
    number = np.ones(len(history), int)
    if span < SMALLEST:
        return number
    height = (signal - signal.min()) / span
    state = np.where(height > LOADED, 1, np.where(height < RETURNED, -1, 0))
    marked = np.flatnonzero(state)
    turns = marked[1:][np.diff(state[marked]) > 0]  # first samples that are loaded again
    if state[marked[0]] < 0:
        turns = turns[1:]  # the first rise belongs to cycle 1
    for turn in turns:
        number[_begin(height, int(turn)) :] += 1
    return number


def _begin(height: Array, loaded: int) -> int:
    """The last sample before the rise that is still as low as the valley."""
    above = np.flatnonzero(height[:loaded] > LOADED)
    first = int(above[-1]) + 1
    valley = height[first:loaded]
    return first + int(np.flatnonzero(valley <= valley.min() + AT_REST)[-1])


def spans(histories: Sequence[History]) -> dict[str, float]:
    """Range of each input over all histories."""
    names = {name for history in histories for name in history.actuation}
    spread = {}
    for name in names:
        values = [h.actuation[name] for h in histories if name in h.actuation and len(h)]
        spread[name] = float(max(v.max() for v in values) - min(v.min() for v in values)) if values else 0.0
    return spread
