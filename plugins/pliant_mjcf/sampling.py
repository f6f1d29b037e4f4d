"""Readings at the samples of a recording, from sensors at MuJoCo's own steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array

ROUNDING = 1e-6  # of a step: samples that near to one are at it


@dataclass(frozen=True, eq=False)
class Samples:
    """Where the samples of a run lie between steps.

    Attributes:
        before: (t,) the step at or before each sample.
        share: (t,) how far each sample is towards the next step, in steps, 0 ≤ share < 1.
    """

    before: NDArray[np.int64]
    share: Array

    @staticmethod
    def at(time_s: Array, step_s: float) -> Samples:
        """Return the places of these times, from zero on."""
        steps = time_s / step_s
        nearest = np.round(steps)
        steps = np.where(np.abs(steps - nearest) < ROUNDING, nearest, steps)
        before = np.floor(steps)
        return Samples(before.astype(np.int64), steps - before)

    @property
    def steps(self) -> int:
        """The number of steps that all samples need."""
        return int(np.max(self.before + (self.share > 0.0))) + 1

    def add(self, readings: Array, begin: int, records: Array) -> None:
        """Add what (steps, n) records from the step `begin` on give to (t, n) readings, in place."""
        for index, weight in ((self.before, 1.0 - self.share), (self.before + 1, self.share)):
            there = (index >= begin) & (index < begin + len(records)) & (weight > 0.0)
            readings[there] += weight[there, None] * records[index[there] - begin]

    def after(self, step: int) -> NDArray[np.bool_]:
        """Return (t,) which samples need this step or a later one."""
        return np.asarray(self.before + (self.share > 0.0) >= step)
