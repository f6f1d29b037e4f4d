"""The default menu: runs that most benches can do, as orders in words and as histories.

Levels are shares of what the measurement drove and hung at most (`BenchScale`). `minutes` are of motion and of
setting up: two for any run, more where the specimen, the bench or its temperature is changed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.errors import UserError, closest
from pliant.experiments.scale import BenchScale
from pliant.experiments.waves import Wave, corners, dense_steps, steps, triangles
from pliant.records.design import Array
from pliant.records.history import History

STEP_S, SLOW_STEP_S, FINE_STEP_S = 0.5, 1.0, 0.02
MEDIUM_S, SLOW_S, FAST_S = 20.0, 80.0, 4.0
WARMER_K = 15.0
# A body that was never loaded before.
NEW = "new"
SET_UP, LOADING, TURNING, MOUNTING, HEATING = 2.0, 3.0, 5.0, 10.0, 15.0
MOST_ANGLES = 12


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


def menu(scale: BenchScale) -> tuple[MenuRun, ...]:
    """All runs of the default menu that make sense for this chain."""
    make = RunMaker(scale)
    return tuple(run for run in (*_cycles(make), *_conditions(make), *_loads(make), *_air(make)) if run)


def named_run(runs: Sequence[MenuRun], name: str) -> MenuRun:
    """By name; raises `UserError` for one that is not there."""
    names = [run.name for run in runs]
    if name not in names:
        raise UserError(f"There is no run '{name}'{closest(name, names)} The runs are {', '.join(names)}.")
    return runs[names.index(name)]


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
        history = History.of(scale.actuation(wave.share), wave.time_s, run=name, **{**usual, **conditions})
        return MenuRun(name, words, history, round(set_up + wave.seconds / 60.0, 1), adds, needs)

    def cycles(self, period_s: float, amplitudes: Sequence[float], step_s: float = STEP_S) -> Wave:
        """Triangles, every second one the other way where opposed chambers are driven."""
        turns = [a * (-1.0) ** k if self.scale.both_ways else a for k, a in enumerate(amplitudes)]
        return triangles(period_s, turns, step_s)


def _cycles(make: RunMaker) -> list[MenuRun]:
    inner = (0.0, 1.0, 0.4, 0.8, 0.3, 0.7, 0.0, 0.6, 0.2, 0.5, 0.0)
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(inner)))]) * MEDIUM_S / 2
    loops = corners(list(zip(np.round(way * 2) / 2, inner, strict=True)), STEP_S)
    rising = make.cycles(MEDIUM_S, [0.3, 0.3, 0.6, 0.6, 1.0, 1.0])
    vents = [
        (0.0, 0.0),
        (10.0, 1.0),
        (20.0, 0.0),
        (50.0, 0.0),
        (60.0, 1.0),
        (90.0, 1.0),
        (100.0, 0.0),
        (160.0, 0.0),
    ]
    dense = dense_steps((0.6, 0.0, 1.0, 0.0), 4.0, 0.1, FINE_STEP_S, 1.0, 0.2)
    return [
        make.run(
            "slow_cycles", "cycle slowly, 80 s per cycle, twice", make.cycles(SLOW_S, [1.0, 1.0], SLOW_STEP_S)
        ),
        make.run(
            "fast_cycles", "cycle quickly, 4 s per cycle, fifteen times", make.cycles(FAST_S, [1.0] * 15)
        ),
        make.run(
            "small_loops", "small loops inside a large one at a medium rate: turn back before the ends", loops
        ),
        make.run(
            "holds",
            "raise the drive in steps, hold each for a minute, release and keep recording",
            steps((0.4, 0.8, 1.0, 0.0), 60.0, SLOW_STEP_S),
        ),
        make.run(
            "virgin",
            "a new specimen, amplitude rising from cycle to cycle, each amplitude twice",
            rising,
            MOUNTING,
            specimen=NEW,
            needs="a second specimen of the same make",
        ),
        make.run(
            "vented_zero",
            "cycle, release and read the zero for half a minute; hold the top for half a minute, release and read "
            "the zero for a minute",
            corners(vents, STEP_S),
        ),
        make.run(
            "step_response",
            "steps as fast as the supply can, sampled densely (50 Hz) for a second after each",
            dense,
            needs="a recorder of 50 Hz",
        ),
    ]


def _conditions(make: RunMaker) -> list[MenuRun]:
    wave, roll, pitch = make.cycles(MEDIUM_S, [1.0, 1.0]), np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
    turned = "a bench whose base can be turned"
    lists = [
        ("level", "the base horizontal, two medium cycles", pitch * np.pi / 2),
        ("upside_down", "upside down, two medium cycles", pitch * np.pi),
        (
            "sideways",
            "the base rolled to its side, out of the plane of bending, two medium cycles",
            roll * np.pi / 2,
        ),
    ]
    warm = make.scale.temperature_c + WARMER_K
    return [
        *(
            make.run(name, words, wave, TURNING, base_angles_rad=angles, needs=turned)
            for name, words, angles in lists
        ),
        make.run(
            "warm",
            f"{WARMER_K:g} K warmer, two medium cycles",
            wave,
            HEATING,
            temperature_c=warm,
            needs="a warm chamber and a thermometer",
        ),
        make.run(
            "second_sensor",
            "a medium cycle with the tip's position and every joint's angle read too",
            wave,
            MOUNTING,
            adds=second_outputs(make.scale),
            needs="a camera or a tracker",
        ),
    ]


def second_outputs(scale: BenchScale) -> tuple[str, ...]:
    """The tip's position, and the angles of the joints where there are several."""
    n = scale.chain.n_joints
    angles = [f"joint_{k + 1}_angle_rad" for k in range(n)] if 1 < n <= MOST_ANGLES else []
    bends = scale.chain.laws[0].joint != "prismatic"
    return ("tip_x_m", "tip_y_m", "tip_z_m", *(angles if bends else ()))


def _loads(make: RunMaker) -> list[MenuRun | None]:
    scale = make.scale
    pushes = steps((0.0, 1.0, 0.0, -1.0, 0.5, 0.0), MEDIUM_S, STEP_S)

    def loaded(name: str, words: str, share: float) -> MenuRun:
        drive = replace(pushes, share=np.full(len(pushes), share))
        pushed: dict[str, Any] = scale.loads(pushes.share)
        return make.run(name, words, drive, LOADING, needs="weights or a lever", **pushed)

    return [
        loaded("passive_load_steps", "no pressure, load steps of both signs", 0.0),
        loaded("load_steps", "constant pressure, load steps of both signs", 0.6),
        _blocked(make),
    ]


def _blocked(make: RunMaker) -> MenuRun | None:
    wave = steps((0.25, 0.5, 0.75, 1.0, 0.0), 15.0, STEP_S, rise_s=5.0)
    moment = make.scale.blocking_moment(make.scale.actuation(wave.share))
    if moment is None:
        return None
    words = "at four levels of the drive, the load that brings the angle back to zero; read what is left of the angle"
    return make.run("blocked", words, wave, TURNING, moment_n_m=moment, needs="a lever with a load cell")


def _air(make: RunMaker) -> list[MenuRun]:
    if not all(name.startswith("pressure") for name in make.scale.inputs):
        return []
    points = [
        (0.0, 0.0),
        (2.0, 0.6),
        (62.0, 0.6),
        (64.0, 0.0),
        (74.0, 0.0),
        (76.0, 1.0),
        (136.0, 1.0),
        (140.0, 0.0),
    ]
    wave = corners(points, STEP_S)
    closed = _between(wave.time_s, 2.0, 62.0) | _between(wave.time_s, 76.0, 136.0)
    words = "fill to two levels, close the valve at each and record for a minute"
    return [
        make.run(
            "closed_valve",
            words,
            wave,
            valve_open=np.where(closed, 0.0, 1.0),
            needs="a valve at the specimen",
        )
    ]


def _between(time_s: Array, low: float, high: float) -> NDArray[np.bool_]:
    inside: NDArray[np.bool_] = (time_s > low) & (time_s <= high)
    return inside
