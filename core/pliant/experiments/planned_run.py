"""Runs that most benches can do: drives over time, and the run as an order in words and as a history.

A drive consists of straight lines between corners. Levels are shares of what the measurement drove and hung at most
(`BenchScale`). `minutes` are of motion and of setting up: two for any run, more where the specimen, the bench or its
temperature is changed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pliant.errors import UserError, closest
from pliant.experiments.scale import BenchScale
from pliant.records.design import Array
from pliant.records.history import History

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


STEP_S = 0.5
# A body that was never loaded before.
NEW = "new"
SET_UP = 2.0


@dataclass(frozen=True, eq=False)
class PlannedRun:
    """A run that the bench can do.

    Attributes:
        name: short, as in effects' `exciting`.
        words: an order to the bench.
        history: its inputs; the specimen is the one that was measured, or `NEW`.
        minutes: of motion and of setting up.
        adds: outputs to read beyond those that were measured.
        needs: equipment beyond the supply and the sensor.
    """

    name: str
    words: str
    history: History
    minutes: float
    adds: tuple[str, ...] = ()
    needs: str = ""

    @property
    def motion_minutes(self) -> float:
        time_s = self.history.time_s
        return 0.0 if time_s is None else float(time_s[-1] - time_s[0]) / 60.0

    @property
    def new_specimen(self) -> bool:
        return self.history.specimen == NEW


@dataclass(frozen=True)
class RunShape:
    """What may differ from the menu's own run; None and () keep the menu's. Levels are shares of the largest."""

    period_s: float | None = None
    amplitudes: tuple[float, ...] = ()
    cycles: int | None = None
    levels: tuple[float, ...] = ()
    hold_s: float | None = None
    load_n_m: float | None = None
    temperature_c: float | None = None


@dataclass(frozen=True)
class RunMaker:
    """Makes runs of waves at a bench's scale."""

    scale: BenchScale

    def run(
        self,
        name: str,
        words: str,
        wave: Wave,
        set_up: float = SET_UP,
        *,
        adds: tuple[str, ...] = (),
        needs: str = "",
        **conditions: Any,
    ) -> PlannedRun:
        """A run of this drive; `conditions` are those of `History.of`."""
        scale = self.scale
        usual = {
            "specimen": scale.specimen,
            "temperature_c": scale.temperature_c,
            "base_angles_rad": scale.base_angles_rad,
            "payload_kg": scale.payload_kg,
        }
        inputs = scale.actuation(wave.share)
        history = History.of(inputs, wave.time_s, run=name, **{**usual, **conditions})
        return PlannedRun(name, words, history, round(set_up + wave.seconds / 60.0, 1), adds, needs)

    def cycles(self, shape: RunShape, period_s: float, amplitudes: Sequence[float]) -> Wave:
        """Triangles, every second one the other way where opposed chambers are driven."""
        heights = shape.amplitudes or (
            tuple(amplitudes) if shape.cycles is None else (max(amplitudes),) * shape.cycles
        )
        turns = [a * (-1.0) ** k if self.scale.both_ways else a for k, a in enumerate(heights)]
        period = shape.period_s or period_s
        return triangles(period, turns, step_of(period))


def step_of(period_s: float) -> float:
    """Sampling of a motion of this period: half a second, a hundredth of slow ones, an eighth of quick ones."""
    return float(np.clip(period_s / 80.0, min(STEP_S, period_s / 8.0), 1.0))


def named_run(runs: Sequence[PlannedRun], name: str) -> PlannedRun:
    """By name; raises `UserError` for one that is not there."""
    names = [run.name for run in runs]
    if name not in names:
        raise UserError(f"There is no run '{name}'{closest(name, names)} The runs are {', '.join(names)}.")
    return runs[names.index(name)]
