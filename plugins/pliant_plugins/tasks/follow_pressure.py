"""Follow pressure: actuation in time, motion out; free swings, the answer to a step and to a sine."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from pliant.errors import UserError, closest
from pliant.interfaces.base import FrozenModel
from pliant.interfaces.effect import Readings
from pliant.interfaces.simulation import Simulation
from pliant.interfaces.task import Task
from pliant.measurements.beginnings import prepend_ramp, with_known_states
from pliant.measurements.files import read_measurements
from pliant.mechanics.kinematics import ChainGeometry
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import History, held
from pliant.records.rollout import Equilibrium, Inputs, Rollout, TaskResult
from pliant.units import Time
from pliant_plugins.tasks.levels import MEASURED, Level, levels_result
from pliant_plugins.tasks.ramp import ActuatedConfig
from pliant_plugins.tasks.responses import sine_response, step_response, swings

# Readings of a run that a rollout also has.
READ = ("angle_rad", "elongation_strain", "tip_x_m", "tip_y_m", "tip_z_m")


class RecordingConfig(FrozenModel):
    """``recording: {file: runs.csv, run: 12V}``; see docs/measurement_files.md for what a file may be."""

    file: Path = Field(description="measurement file; columns as in docs/measurement_files.md")
    run: str = Field(default="", description="which run, where the file has several")
    rename: dict[str, str] = Field(
        default_factory=dict, description="the file's column: Pliant's name, e.g. {bend: angle_rad}"
    )
    outputs: tuple[str, ...] = Field(
        default=(), description="which readings to compare with; all that a chain has, by default"
    )
    parts: int = Field(
        default=2,
        ge=1,
        le=100,
        description="equal steps from sample to sample, inputs on straight lines between",
    )


@dataclass(frozen=True, eq=False)
class Recording:
    """One run: `fine` is its history with `parts` steps from sample to sample, with a ramp before if it begins in
    motion.

    `outputs` (t,) are what was read at the samples; NaN where nothing was, or where the state was not known yet.
    """

    fine: History
    parts: int
    outputs: Mapping[str, Array]

    @staticmethod
    def from_config(config: RecordingConfig, chain: ChainModel) -> Recording:
        """Read it.

        Raises:
            UserError: a file that cannot be read, an unknown run, one without times, a base or payload that is not the
                chain's own.
        """
        found = read_measurements(config.file, {"rename": config.rename}, actuation=chain.inputs)
        runs = {run.name: run for run in with_known_states(found)[0].runs}
        name = config.run or next(iter(runs))
        if name not in runs or (not config.run and len(runs) > 1):
            given = f"names run '{name}'{closest(name, sorted(runs))}" if config.run else "names no run."
            raise UserError(
                f"task 'recording' {given} {config.file} has {', '.join(runs)}: give one as 'run'."
            )
        history = runs[name].history
        if history.time_s is None or len(history) < 2:
            raise UserError(f"{config.file}, run '{name}' has no times, which a motion needs: give 'time_s'.")
        if history.base_angles_rad.any() or history.payload_kg is not None:
            raise UserError(
                f"{config.file}, run '{name}' turns the base or changes the payload, which this task leaves "
                "alone: give them in 'chain', and leave the columns out."
            )
        read = runs[name].outputs
        if unknown := [output for output in config.outputs if output not in read]:
            raise UserError(f"{config.file} has no {unknown[0]}{closest(unknown[0], sorted(read))}")
        outputs = {output: read[output] for output in config.outputs or read}
        return Recording(held(prepend_ramp([history])[0]).refined(config.parts), config.parts, outputs)

    @property
    def read_at(self) -> slice:
        """The samples of `fine` that were recorded."""
        return slice(self.fine.lead * self.parts, None, self.parts)

    def errors(
        self, chain: ChainModel, rollout: Rollout, reported: Callable[[Readings], Readings]
    ) -> dict[str, float]:
        """Return the RMS of measured − model of each output, such as `angle_rmse_rad`, and the largest, `…_worst_…`.

        Args:
            rollout: the motion at the recorded samples.
            reported: the sensors' readings from true ones.
        """
        true = {
            name: values for name, values in true_readings(chain, rollout).items() if name in self.outputs
        }
        seen = reported({**true, "time_s": rollout.time_s, "actuation": rollout.actuation.sum(axis=1)})
        numbers = {}
        for name in true:
            missed = self.outputs[name] - np.asarray(seen[name], float)
            missed = missed[np.isfinite(missed)]
            if len(missed):
                stem, unit = _named(name)
                numbers[f"{stem}_rmse_{unit}"] = float(np.sqrt(np.mean(missed**2)))
                numbers[f"{stem}_worst_{unit}"] = float(np.abs(missed).max())
        return numbers


def error_names() -> tuple[str, ...]:
    """Return the names of the errors that `Recording.errors` may return."""
    parts = [_named(name) for name in READ]
    return tuple(f"{stem}_{what}_{unit}" for stem, unit in parts for what in ("rmse", "worst"))


def true_readings(chain: ChainModel, rollout: Rollout) -> dict[str, Any]:
    """Return (t,) true values of each name in `READ` that the chain has."""
    geometry = ChainGeometry.from_chain(chain)
    total = rollout.joint_angles[:, :, geometry.main].sum(axis=1)
    tip = dict(zip(READ[2:], rollout.markers_m[:, -1].T, strict=True))
    if geometry.kind == "prismatic":
        return {"elongation_strain": total / chain.length_m, **tip}
    return {"angle_rad": total, **tip}


def _named(output: str) -> tuple[str, str]:
    stem, _, unit = output.rpartition("_")
    return stem, unit


# Keys that a recording leaves no room for.
BESIDE = {
    *("pressure_pa", "tendon_force_n", "inputs", "waveform"),
    *("times_s", "shares", "period_s", "duration_s", "record_s"),
}
# Modes that are reported.
MODES = 2
MOST_SAMPLES = 100_000


class FollowPressureConfig(ActuatedConfig):
    """``task: {kind: follow_pressure, pressure: 15 kPa, waveform: step, duration: 2 s, record: 2 ms}``.

    Or `recording` instead of all that. The chain settles at the first value, then time runs.
    """

    kind: Literal["follow_pressure"] = "follow_pressure"
    waveform: Literal["step", "release", "sine", "table"] = Field(
        default="step",
        description="of the actuation: from 0 to its full value at once, from there to 0, "
        "(1 − cos(2πt/period))/2 of it, or the 'shares' of it at 'times'",
    )
    times_s: tuple[Time, ...] = Field(default=(), description="of the table, increasing")
    shares: tuple[float, ...] = Field(
        default=(),
        description="of the full actuation at these times, straight lines between, the last one held",
    )
    period_s: Time = Field(default=1.0, gt=0.0, description="of the sine")
    duration_s: Time = Field(default=2.0, gt=0.0, description="of the motion")
    record_s: Time = Field(
        default=0.01, gt=0.0, description="from sample to sample; the actuation changes at samples"
    )

    recording: RecordingConfig | None = Field(
        default=None, description="instead of a waveform: inputs, loads and times of a measured run"
    )

    def is_driven_otherwise(self) -> bool:
        return self.recording is not None

    @model_validator(mode="after")
    def _table(self) -> FollowPressureConfig:
        said = self.model_fields_set & BESIDE
        if self.recording is not None and said:
            raise ValueError(f"'recording' says what acts: leave {', '.join(sorted(said))} out")
        given = (bool(self.times_s), bool(self.shares))
        if given != (self.waveform == "table",) * 2:
            raise ValueError("give 'times' and 'shares' with 'waveform: table', and only there")
        if len(self.times_s) != len(self.shares):
            raise ValueError(
                f"{len(self.times_s)} 'times' have {len(self.shares)} 'shares': give one for each"
            )
        if any(b <= a for a, b in pairwise(self.times_s)):
            raise ValueError("'times' should increase")
        if self.recording is None and self.duration_s / self.record_s > MOST_SAMPLES:
            raise ValueError(
                f"{self.duration_s / self.record_s:.0f} samples are more than {MOST_SAMPLES}: give a longer 'record' "
                "or a shorter 'duration'"
            )
        return self

    def clock(self) -> Array:
        """Return times (t,) in s from 0."""
        return np.asarray(self.record_s * np.arange(max(1, round(self.duration_s / self.record_s)) + 1))

    def shares_at(self, time_s: Array) -> Array:
        """Return (t,) shares of the full actuation; the chain has settled at the first."""
        if self.waveform == "sine":
            return np.asarray(0.5 * (1.0 - np.cos(2 * np.pi * time_s / self.period_s)))
        if self.waveform == "table":
            return np.interp(time_s, self.times_s, self.shares)
        later = (time_s > 0.0).astype(float)
        return later if self.waveform == "step" else 1.0 - later


class FollowPressure(Task):
    """A drive of the chain in time; its bend is measured (the sum of main coordinates; extension on prismatic chains).

    Metrics in addition to those of the last sample: after a step or a release `mode_1_frequency_hz`,
    `mode_1_damping_ratio`, the same of mode 2 (where the chain swings), `rise_time_s`, `settling_time_s`,
    `overshoot_share`; of a sine `gain_share` (swing of the bend over that of a slow run between the same levels),
    `phase_rad` (negative lags) and `not_sine_share`; of a recording the errors of what was read, such as
    `angle_rmse_rad` and `angle_worst_rad`.
    """

    config: FollowPressureConfig

    @property
    def mounts(self) -> bool:
        return self.config.recording is None

    def measures(self) -> tuple[str, ...]:
        modes = [f"mode_{k + 1}_{name}" for k in range(MODES) for name in ("frequency_hz", "damping_ratio")]
        steps = ("rise_time_s", "settling_time_s", "overshoot_share")
        return (*MEASURED, *modes, *steps, "gain_share", "phase_rad", "not_sine_share", *error_names())

    def run(self, simulation: Simulation) -> TaskResult:
        config, chain = self.config, simulation.chain
        if config.recording is not None:
            return _recorded(simulation, Recording.from_config(config.recording, chain))
        full, times = config.actuation(chain), config.clock()
        shares = config.shares_at(times)
        levels = [
            Level(t, Inputs({name: share * value for name, value in full.items()}), f"{t:g} s")
            for t, share in zip(times.tolist(), shares.tolist(), strict=True)
        ]
        slow = self._slow_span(simulation, full) if config.waveform == "sine" else 0.0
        found = _motion(simulation, levels)
        result = levels_result(chain, levels, found)
        bend = _bend(chain, np.array([one.joint_angles for one in found]))
        return replace(result, metrics={**result.metrics, **self._numbers(times, bend, slow)})

    def against_readings(
        self, chain: ChainModel, result: TaskResult, reported: Callable[[Readings], Readings]
    ) -> Mapping[str, float]:
        if self.config.recording is None or result.rollout is None:
            return {}
        return Recording.from_config(self.config.recording, chain).errors(chain, result.rollout, reported)

    def _numbers(self, times: Array, bend: Array, slow: float) -> dict[str, Any]:
        config = self.config
        if config.waveform == "sine":
            swing, left = sine_response(times, bend, 1.0 / config.period_s)
            # the command is −cos: its first harmonic has phase π
            numbers = {"phase_rad": float(np.angle(-swing)), "not_sine_share": left / max(abs(swing), 1e-300)}
            return numbers | ({"gain_share": 2.0 * abs(swing) / abs(slow)} if slow else {})
        if config.waveform == "table":
            return {}
        found = swings(config.record_s, bend[1:])[:MODES]
        numbers = step_response(times, bend)
        for k, (frequency, ratio) in enumerate(found, start=1):
            numbers |= {f"mode_{k}_frequency_hz": frequency, f"mode_{k}_damping_ratio": ratio}
        return numbers

    def _slow_span(self, simulation: Simulation, full: dict[str, float]) -> float:
        """Change of the bend from no to full actuation where the chain has all the time it needs."""
        start, ends = simulation.snapshot(), []
        for share in (0.0, 1.0):
            simulation.apply(Inputs({name: share * value for name, value in full.items()}))
            ends.append(simulation.settle().joint_angles)
        simulation.restore(start)
        low, high = _bend(simulation.chain, np.array(ends))
        return float(high - low)


def _recorded(simulation: Simulation, recording: Recording) -> TaskResult:
    """Simulate the chain under a run's inputs and loads at the recorded samples."""
    history = recording.fine
    assert history.time_s is not None
    levels = [Level(t, history.at(k), f"{t:g} s") for k, t in enumerate(history.time_s.tolist())]
    found = _motion(simulation, levels)
    return levels_result(simulation.chain, levels[recording.read_at], found[recording.read_at])


def _bend(chain: ChainModel, coordinates: Array) -> Array:
    """Return the (t,) sum of main coordinates of (t, n, a)."""
    return np.asarray(coordinates[:, :, ChainGeometry.from_chain(chain).main].sum(axis=1))


def _motion(simulation: Simulation, levels: list[Level]) -> list[Equilibrium]:
    """Simulate the chain at each level's time: settled at the first, moving from then on.

    A moving chain is not in equilibrium, so its residual is not a number. Laws are checked under what is commanded.
    """
    chain = simulation.chain
    simulation.apply(levels[0].inputs)
    found, efforts = [simulation.settle()], ChainStatics(chain).efforts
    for before, level in pairwise(levels):
        simulation.apply(level.inputs)
        held = simulation.advance(level.time_s - before.time_s) and found[0].converged
        q = simulation.snapshot().position.copy()
        loads = Loads.from_inputs(chain, level.inputs)
        outside = efforts.outside_domain(q, loads.actuation, level.time_s)
        seen, carrier = simulation.markers(), simulation.carrier()
        found.append(Equilibrium(q, seen, float("nan"), held, None, 1, 0.0, tuple(outside), carrier))
    return found
