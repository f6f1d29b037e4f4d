"""Follow pressure: actuation in time, motion out; free swings, the answer to a step and to a sine."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from pliant.interfaces.effect import Readings
from pliant.interfaces.physics import Simulation
from pliant.interfaces.task import Task
from pliant.mechanics.kinematics import ChainGeometry
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.rollout import Equilibrium, Inputs, TaskResult
from pliant.units import Time
from pliant_plugins.tasks.levels import MEASURED, Level, result_of
from pliant_plugins.tasks.ramp import ActuatedConfig
from pliant_plugins.tasks.recordings import Recording, RecordingConfig, error_names
from pliant_plugins.tasks.responses import sine_response, step_response, swings

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
        """(t,) s, from 0 on."""
        return np.asarray(self.record_s * np.arange(max(1, round(self.duration_s / self.record_s)) + 1))

    def shares_at(self, time_s: Array) -> Array:
        """(t,) of the full actuation; the first is what the chain has settled at."""
        if self.waveform == "sine":
            return np.asarray(0.5 * (1.0 - np.cos(2 * np.pi * time_s / self.period_s)))
        if self.waveform == "table":
            return np.interp(time_s, self.times_s, self.shares)
        later = (time_s > 0.0).astype(float)
        return later if self.waveform == "step" else 1.0 - later


class FollowPressure(Task):
    """Drives the chain in time and measures its bend (the sum of main coordinates; extension on prismatic chains).

    Metrics beside those of the last sample: after a step or a release `mode_1_frequency_hz`, `mode_1_damping_ratio`,
    the same of mode 2 (where the chain swings), `rise_time_s`, `settling_time_s`, `overshoot_share`; of a sine
    `gain_share` (swing of the bend over that of a slow run between the same levels), `phase_rad` (negative lags) and
    `not_sine_share`; of a recording the errors of what was read, such as `angle_rmse_rad` and `angle_worst_rad`.
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
            return _recorded(simulation, Recording.of(config.recording, chain))
        full, times = config.actuation(chain), config.clock()
        shares = config.shares_at(times)
        levels = [
            Level(t, Inputs({name: share * value for name, value in full.items()}), f"{t:g} s")
            for t, share in zip(times.tolist(), shares.tolist(), strict=True)
        ]
        slow = self._slow_span(simulation, full) if config.waveform == "sine" else 0.0
        found = _motion(simulation, levels)
        result = result_of(chain, levels, found)
        bend = _bend(chain, np.array([one.joint_angles for one in found]))
        return replace(result, metrics={**result.metrics, **self._numbers(times, bend, slow)})

    def against_readings(
        self, chain: ChainModel, result: TaskResult, reported: Callable[[Readings], Readings]
    ) -> Mapping[str, float]:
        if self.config.recording is None or result.rollout is None:
            return {}
        return Recording.of(self.config.recording, chain).errors(chain, result.rollout, reported)

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
    """The chain under a run's inputs and loads, at the samples that were recorded."""
    history = recording.fine
    assert history.time_s is not None
    levels = [Level(t, history.at(k), f"{t:g} s") for k, t in enumerate(history.time_s.tolist())]
    found = _motion(simulation, levels)
    return result_of(simulation.chain, levels[recording.read_at], found[recording.read_at])


def _bend(chain: ChainModel, coordinates: Array) -> Array:
    """(t,) the sum of main coordinates of (t, n, a)."""
    return np.asarray(coordinates[:, :, ChainGeometry.of(chain).main].sum(axis=1))


def _motion(simulation: Simulation, levels: list[Level]) -> list[Equilibrium]:
    """The chain at each level's time: settled at the first, moved from there on.

    A moving chain is not in equilibrium, so its residual is not a number. Laws are checked under what is commanded.
    """
    chain = simulation.chain
    simulation.apply(levels[0].inputs)
    found, efforts = [simulation.settle()], ChainStatics(chain).efforts
    for before, level in pairwise(levels):
        simulation.apply(level.inputs)
        held = simulation.advance(level.time_s - before.time_s) and found[0].converged
        q = simulation.snapshot().position.copy()
        loads = Loads.of(chain, level.inputs)
        outside = efforts.outside_domain(q, loads.actuation, level.time_s)
        seen, carrier = simulation.markers(), simulation.carrier()
        found.append(Equilibrium(q, seen, float("nan"), held, None, 1, 0.0, tuple(outside), carrier))
    return found
