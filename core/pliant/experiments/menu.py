"""The default menu: runs that most benches can do, as orders in words and as histories.

Levels are shares of what the measurement drove and hung at most (`BenchScale`). `minutes` are of motion and of
setting up: two for any run, more where the specimen, the bench or its temperature is changed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pliant.errors import UserError, closest
from pliant.experiments.scale import BenchScale
from pliant.experiments.waves import Wave, triangles
from pliant.records.history import History

STEP_S = 0.5
# A body that was never loaded before.
NEW = "new"
SET_UP = 2.0


@dataclass(frozen=True, eq=False)
class MenuRun:
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
class Shape:
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
    ) -> MenuRun:
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
        return MenuRun(name, words, history, round(set_up + wave.seconds / 60.0, 1), adds, needs)

    def cycles(self, shape: Shape, period_s: float, amplitudes: Sequence[float]) -> Wave:
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


def named_run(runs: Sequence[MenuRun], name: str) -> MenuRun:
    """By name; raises `UserError` for one that is not there."""
    names = [run.name for run in runs]
    if name not in names:
        raise UserError(f"There is no run '{name}'{closest(name, names)} The runs are {', '.join(names)}.")
    return runs[names.index(name)]
