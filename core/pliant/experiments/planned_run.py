"""Runs that are possible in most laboratories: drives over time, and the run as an order in words and as a history.

A drive consists of straight lines between corners. Levels are shares of the largest drive and load of the measurement
(`BenchScale`). `minutes` are of motion and of setting up: two for any run, more if the specimen, the rig or its
temperature is changed.

Runs of the menu drive and load as strongly as the measurement did, or as the law allows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pliant.errors import UserError, closest
from pliant.mechanics.kinematics import ChainGeometry, main_axis
from pliant.mechanics.prescribed import HELD
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import REFERENCE_TEMPERATURE_C, History
from pliant.records.measurement import MeasuredRun, Measurement

# If no load was measured, loads are this share of the torque (or force) at the largest actuation.
LOAD_OF_PEAK = 0.15
# An input below this share of the largest counts as not driven.
DRIVEN = 0.05


@dataclass(frozen=True, eq=False)
class BenchScale:
    """The largest drives and loads of a test rig, done or allowed, and the conditions of its runs.

    Attributes:
        chain: the chain that is driven.
        top: largest value of each input, SI; 0 for one that is not driven.
        load: (4,) the load at share 1: end moment in N·m, then the force at the tip in N, world frame.
        temperature_c, base_angles_rad, payload_kg: conditions of a plain run.
        specimen: the body that was measured last; empty without one.
    """

    chain: ChainModel
    top: Mapping[str, float]
    load: Array
    temperature_c: float = REFERENCE_TEMPERATURE_C
    base_angles_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)
    payload_kg: float | None = None
    specimen: str = ""

    @staticmethod
    def from_measurement(chain: ChainModel, measurement: Measurement) -> BenchScale:
        """Return the largest actuation and load of the measurement; a share of the law's torque if it has no load.

        For a joint that is held by the rig, return the largest coordinate, and no load.
        """
        histories = [run.history for run in measurement.runs]
        last = histories[-1]
        held = [name for name in last.actuation if name in HELD.values()]
        driven = held or list(last.actuation)
        top = {name: max(_largest(h.actuation[name]) for h in histories) for name in driven}
        moment = max(_largest(h.moment_n_m) for h in histories)
        force = _strongest(histories)
        load = np.array([moment, *(np.zeros(3) if moment > 0.0 else force)])
        payload = last.payload_kg
        return BenchScale(
            chain,
            top,
            load if load.any() or held else _default_load(chain, top),
            float(np.median(last.temperature_c)),
            tuple(float(angle) for angle in histories[0].base_angles_rad[0]),  # type: ignore[arg-type]
            None if payload is None else float(payload[0]),
            last.specimen,
        )

    @staticmethod
    def from_chain(chain: ChainModel, largest: float | None = None) -> BenchScale:
        """Return the scale of the end of the laws' domain, or of `largest` for every input.

        Raises:
            UserError: the law states no domain, and no largest value is given.
        """
        ends = [float(np.max(chain.laws[joint.law].domain.actuation)) for joint in chain.joints]
        end = min(ends) if largest is None else largest
        if not np.isfinite(end):
            raise UserError(
                "The study's law states no domain, so that the largest admissible drive is unknown: give "
                "'surrogate: {domain: {actuation: [0, 15000]}}', a task with a pressure, or measurements."
            )
        top = dict.fromkeys((actuator.input for actuator in chain.actuators), end)
        return BenchScale(chain, top, _default_load(chain, top))

    @property
    def both_ways(self) -> bool:
        """Return whether inputs bend in both directions: opposed chambers, or laws of several opposing actuations."""
        return len({np.sign(self._sign(name)) for name in self.driven}) > 1

    @property
    def is_held(self) -> bool:
        """Return whether the joint's coordinate is prescribed and the reaction is read."""
        return not set(HELD.values()).isdisjoint(self.top)

    @property
    def drive(self) -> str:
        """Return the name of the inputs in an order."""
        if self.is_held:
            return "imposed motion"
        return "pressure" if all(name.startswith("pressure") for name in self.top) else "drive"

    @property
    def usual(self) -> dict[str, Any]:
        """Return the conditions of a plain run, for `History.from_arrays`."""
        names = ("specimen", "temperature_c", "base_angles_rad", "payload_kg")
        return {name: getattr(self, name) for name in names}

    def actuation(self, share: Array) -> dict[str, Array]:
        """Return (t,) of each input: positive shares drive those that pull with the strongest, negative the opposed."""
        driven = self.driven
        lead = self._sign(max(driven, key=lambda name: self.top[name]))
        return {
            name: self.top[name] * np.maximum(share if self._sign(name) == lead else -share, 0.0)
            if name in driven
            else np.zeros(len(share))
            for name in self.top
        }

    def loads(self, share: Array) -> dict[str, Array]:
        """Return the end moment (t,) and the force at the tip (t, 3) at these shares of the load."""
        return {"moment_n_m": self.load[0] * share, "tip_force_n": np.outer(share, self.load[1:])}

    def blocking_moment(self, actuation: Mapping[str, Array]) -> Array | None:
        """Return (t,) the end moment that keeps a joint at zero against this actuation; None for an extension."""
        if self.is_held or self.chain.laws[0].joint == "prismatic":
            return None
        return total_effort(self.chain, actuation)

    @property
    def driven(self) -> list[str]:
        """Return the inputs that are driven."""
        most = max(self.top.values())
        return [name for name, value in self.top.items() if value >= DRIVEN * most]

    def _sign(self, name: str) -> float:
        """Return the bending sign of an input: its actuator's; in a law of several, its effort's when straight."""
        place = next((k for k, a in enumerate(self.chain.actuators) if a.input == name), None)
        if place is None:
            return 1.0
        joint = next(j for j in self.chain.joints if place in range(*self.chain.actuator_range(j)))
        law, (first, _) = self.chain.laws[joint.law], self.chain.actuator_range(joint)
        if len(law.actuations) == 1:
            return self.chain.actuators[place].sign
        alone = law.unactuated(2)
        alone[1, place - first] = self.top[name]
        at_rest, pushed = law.evaluate(alone, np.zeros((2, len(law.axes)))).tau[:, main_axis(law.axes)]
        return -1.0 if pushed < at_rest else 1.0


def total_effort(chain: ChainModel, actuation: Mapping[str, Array]) -> Array:
    """Return (t,) effort of the first joint's law about its main axis at zero deformation, under all its inputs."""
    law, main = chain.laws[chain.joints[0].law], ChainGeometry.from_chain(chain).main
    total = np.zeros(len(next(iter(actuation.values()))))
    acting = chain.actuators[slice(*chain.actuator_range(chain.joints[0]))]
    if len(law.actuations) > 1:
        levels = np.column_stack([actuation[actuator.input] for actuator in acting])
        return law.evaluate(levels, np.zeros((len(levels), len(chain.axes)))).tau[:, main]
    for actuator in acting:
        values = np.asarray(actuation[actuator.input], float)
        total += actuator.sign * law.evaluate(values, np.zeros((len(values), len(chain.axes)))).tau[:, main]
    return total


def _default_load(chain: ChainModel, top: Mapping[str, float]) -> Array:
    """Return a share of the largest torque as end moment; of the largest force along the chain for an extension."""
    most = max(top, key=lambda name: top[name])
    alone = {name: np.array([top[name] if name == most else 0.0]) for name in top}
    peak = LOAD_OF_PEAK * float(total_effort(chain, alone)[0])
    if chain.laws[0].joint == "prismatic":
        return np.array([0.0, *(peak * chain.base_rotation[:, 0])])
    return np.array([peak, 0.0, 0.0, 0.0])


def _largest(values: Array) -> float:
    return float(np.abs(values).max(initial=0.0))


def _strongest(histories: list[History]) -> Array:
    """Return (3,) the largest tip force of all samples."""
    forces = np.concatenate([h.tip_force_n for h in histories])
    strongest: Array = forces[int(np.argmax(np.linalg.norm(forces, axis=1)))]
    return strongest


RISE_S = 1.0


@dataclass(frozen=True, eq=False)
class Wave:
    """A drive over time: time_s (t,) from 0, share (t,) of the largest."""

    time_s: Array
    share: Array

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def seconds(self) -> float:
        return float(self.time_s[-1])


def corners(points: Sequence[tuple[float, float]], step_s: float) -> Wave:
    """Return straight lines through (time in s, share), sampled every `step_s` from the first corner to the last."""
    times, shares = np.array(points, float).T
    grid = step_s * np.arange(round(times[-1] / step_s) + 1)
    return Wave(grid, np.interp(grid, times, shares))


def triangles(period_s: float, amplitudes: Sequence[float], step_s: float) -> Wave:
    """Return cycles from zero to each amplitude and back, `period_s` each."""
    points = [(0.0, 0.0)]
    for k, amplitude in enumerate(amplitudes):
        points += [((k + 0.5) * period_s, amplitude), ((k + 1) * period_s, 0.0)]
    return corners(points, step_s)


def steps(levels: Sequence[float], hold_s: float, step_s: float, rise_s: float = RISE_S) -> Wave:
    """Return levels reached along straight lines of `rise_s` from zero, each held for the rest of `hold_s`."""
    points = [(0.0, 0.0)]
    for k, level in enumerate(levels):
        points += [(k * hold_s + rise_s, level), ((k + 1) * hold_s, level)]
    return corners(points, step_s)


def dense_steps(
    levels: Sequence[float], hold_s: float, rise_s: float, fine_s: float, fine_for_s: float, step_s: float
) -> Wave:
    """Return half-cosine steps of `rise_s`, sampled every `fine_s` for `fine_for_s` after each, then every `step_s`.

    A kink would excite the natural frequency of the body.
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
    """A run that can be done in the laboratory.

    Attributes:
        name: short, as in effects' `recommended_experiments`.
        words: an order to the experimenter.
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
    """Deviations from the menu's own run; None and () keep the menu's. Levels are shares of the largest."""

    period_s: float | None = None
    amplitudes: tuple[float, ...] = ()
    cycles: int | None = None
    levels: tuple[float, ...] = ()
    hold_s: float | None = None
    load_n_m: float | None = None
    temperature_c: float | None = None


@dataclass(frozen=True)
class RunMaker:
    """A builder of runs from waves at the scale of a test rig."""

    scale: BenchScale

    def run(
        self,
        name: str,
        words: str,
        wave: Wave | Array,
        set_up: float = SET_UP,
        *,
        adds: tuple[str, ...] = (),
        needs: str = "",
        inputs: Mapping[str, Array] | None = None,
        **conditions: Any,
    ) -> PlannedRun:
        """Return a run of this drive, without a clock for plain shares; `conditions`: as in `History.from_arrays`.

        `inputs` replace those of the drive's shares.
        """
        timed = wave if isinstance(wave, Wave) else None
        share = wave.share if isinstance(wave, Wave) else wave
        clock = None if timed is None else timed.time_s
        history = History.from_arrays(
            inputs or self.scale.actuation(share), clock, run=name, **{**self.scale.usual, **conditions}
        )
        minutes = set_up if timed is None else round(set_up + timed.seconds / 60.0, 1)
        return PlannedRun(name, words, history, minutes, adds, needs)

    def cycles(
        self, shape: RunShape, period_s: float, amplitudes: Sequence[float], one_way: bool = False
    ) -> Wave:
        """Return triangles, every second one reversed if inputs bend both ways, unless `one_way`."""
        heights = shape.amplitudes or (
            tuple(amplitudes) if shape.cycles is None else (max(amplitudes),) * shape.cycles
        )
        turns = [
            a * (-1.0) ** k if self.scale.both_ways and not one_way else a for k, a in enumerate(heights)
        ]
        period = shape.period_s or period_s
        return triangles(period, turns, sampling_step(period))


def sampling_step(period_s: float) -> float:
    """Return the sampling step of a motion: half a second, a hundredth of slow periods, an eighth of quick ones."""
    return float(np.clip(period_s / 80.0, min(STEP_S, period_s / 8.0), 1.0))


def named_run(runs: Sequence[PlannedRun], name: str) -> PlannedRun:
    """Return the run by name; raise `UserError` for an unknown one."""
    names = [run.name for run in runs]
    if name not in names:
        raise UserError(f"There is no run '{name}'{closest(name, names)} The runs are {', '.join(names)}.")
    return runs[names.index(name)]


def unread_run(history: History, outputs: Sequence[str] = (), read: Sequence[str] = ()) -> MeasuredRun:
    """Return the run before it is done: zeros for the outputs that will be read in it, NaN for the others."""
    values = {name: np.full(len(history), 0.0 if name in read else np.nan) for name in outputs}
    return MeasuredRun(history, values, {}, np.ones(len(history)), np.zeros(0))
