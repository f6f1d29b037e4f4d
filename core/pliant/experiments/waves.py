"""Drives over time, as shares of the largest: straight lines between corners."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pliant.records.design import Array

RISE_S = 1.0


@dataclass(frozen=True, eq=False)
class Wave:
    """time_s (t,) from 0, share (t,) of the largest."""

    time_s: Array
    share: Array

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def seconds(self) -> float:
        return float(self.time_s[-1])


def corners(points: Sequence[tuple[float, float]], step_s: float) -> Wave:
    """Straight lines through (time in s, share), sampled every `step_s` from the first corner to the last."""
    times, shares = np.array(points, float).T
    grid = step_s * np.arange(round(times[-1] / step_s) + 1)
    return Wave(grid, np.interp(grid, times, shares))


def triangles(period_s: float, amplitudes: Sequence[float], step_s: float) -> Wave:
    """Cycles from zero to each amplitude and back, `period_s` each."""
    points = [(0.0, 0.0)]
    for k, amplitude in enumerate(amplitudes):
        points += [((k + 0.5) * period_s, amplitude), ((k + 1) * period_s, 0.0)]
    return corners(points, step_s)


def steps(levels: Sequence[float], hold_s: float, step_s: float, rise_s: float = RISE_S) -> Wave:
    """Levels reached from zero along straight lines of `rise_s`, each then held for the rest of `hold_s`."""
    points = [(0.0, 0.0)]
    for k, level in enumerate(levels):
        points += [(k * hold_s + rise_s, level), ((k + 1) * hold_s, level)]
    return corners(points, step_s)


def dense_steps(
    levels: Sequence[float], hold_s: float, rise_s: float, fine_s: float, fine_for_s: float, step_s: float
) -> Wave:
    """Steps along half a cosine of `rise_s`, sampled every `fine_s` for `fine_for_s` after each, then every `step_s`.

    A kink would make a body swing that has a frequency of its own.
    """
    times, shares, before = [0.0], [0.0], 0.0
    for k, level in enumerate(levels):
        start = k * hold_s
        local = np.concatenate(
            [np.arange(fine_s, fine_for_s, fine_s), np.arange(fine_for_s, hold_s + 0.5 * step_s, step_s)]
        )
        times += list(start + local)
        risen = 0.5 - 0.5 * np.cos(np.pi * np.minimum(1.0, local / rise_s))
        shares += list(before + (level - before) * risen)
        before = level
    return Wave(np.array(times), np.array(shares))
