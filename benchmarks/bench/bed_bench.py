"""A truth of the evidence bed behind the interface of a bench: other equations and integrators than the candidates'.

The bench gets its truth from a sealed label; the loop sees a study and what the bench reads.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from benchmarks.evidence.protocols import LOAD_N_M, Run
from benchmarks.evidence.robots import PRESSURE_MAX_PA, Array, Robot
from benchmarks.evidence.sets import ALL_ROBOTS, SPECTRA, SetSpec, draw_noise, draw_truth, follow

from pliant.records.history import BASE, REFERENCE_TEMPERATURE_C
from pliant_bench.bench import (
    Bench,
    BenchChannel,
    BenchConfig,
    BenchProtocol,
    BenchRecording,
    BenchSample,
    ChannelCheck,
    ChannelLimits,
    Ending,
    RunStoppedError,
    Watch,
)

LOAD, VALVE = "moment_n_m", "valve_open"
MOST_RUNS = 400


@dataclass
class BedBench(Bench):
    """A robot of the bed with a hidden truth.

    Attributes:
        spec: of the set whose truth it is.
        strengths: of its effects, as scaled for the rich protocol.
        sigma: noise of every output.
        seed: of the noise, another one for each arm of a comparison.
    """

    spec: SetSpec
    strengths: Sequence[float]
    sigma: Mapping[str, float]
    seed: int = 0
    done: list[Run] = field(default_factory=list)
    specimen: int = 1
    is_hardware = False

    def __post_init__(self) -> None:
        self.config = BenchConfig(kind="bed")
        self._truth = draw_truth(self.spec).at(*self.strengths)
        self._slips = np.random.default_rng([self.seed, 1]).standard_normal(MOST_RUNS)

    @staticmethod
    def from_label(label: Mapping[str, Any], seed: int) -> BedBench:
        """Return the bench of an opened label."""
        names = SetSpec.__dataclass_fields__
        spec = SetSpec(**{name: value for name, value in label.items() if name in names})
        return BedBench(spec, label["strengths"], label["sigma"], seed)

    @property
    def robot(self) -> Robot:
        """Return the robot."""
        return ALL_ROBOTS[self.spec.robot]

    @property
    def inputs(self) -> tuple[BenchChannel, ...]:
        """Return the drive, the load, and the valve of a robot with a pressure."""
        drive = BenchChannel(self.robot.drive, ChannelLimits(0.0, self.robot.drive_max))
        load = BenchChannel(LOAD, ChannelLimits(-LOAD_N_M, LOAD_N_M))
        valve = BenchChannel(VALVE, ChannelLimits(0.0, 1.0), 1.0)
        return (drive, load) if self.robot.tendon else (drive, load, valve)

    @property
    def outputs(self) -> tuple[BenchChannel, ...]:
        """Return the first sensor's outputs."""
        return tuple(BenchChannel(name) for name in self.robot.outputs)

    def connect(self) -> None:
        """Do nothing."""

    def check(self) -> tuple[ChannelCheck, ...]:
        """Return the inputs at rest."""
        return tuple(ChannelCheck(one.name, one.rest) for one in self.inputs)

    def run(self, protocol: BenchProtocol, watch: Watch) -> BenchRecording:
        """Follow all runs so far and this one, then give the watch its readings with noise."""
        if protocol.new_specimen and self.done:
            self.specimen += 1
        self.done.append(self._run(protocol))
        slips = self._slips[: len(self.done)]
        ideal = follow(self.spec.engine, self.robot, tuple(self.done), self._truth, slips)[-1]
        rng = np.random.default_rng([self.seed, 2, len(self.done)])
        spectrum = SPECTRA[self.spec.split]
        readings: dict[str, Array] = {
            name: ideal[name] + self.sigma[name] * draw_noise(spectrum, protocol.time_s, rng)
            for name in self.robot.outputs
        }
        ending: Ending = "complete"
        count, reason = 0, ""
        try:
            for index, now in enumerate(protocol.time_s.tolist()):
                read = {name: float(values[index]) for name, values in readings.items()}
                count += 1
                watch(BenchSample(index, now, now, protocol.commands_at(index), read))
        except RunStoppedError as error:
            ending, reason = "stopped", str(error)
        clock = np.asarray(protocol.time_s[:count], float)
        return BenchRecording(
            protocol,
            clock,
            clock,
            {name: values[:count] for name, values in protocol.commands.items()},
            {name: values[:count] for name, values in readings.items()},
            np.zeros(count, bool),
            ending,
            reason,
        )

    def stop(self) -> None:
        """Do nothing: nothing moves between two calls."""

    def close(self) -> None:
        """Do nothing."""

    def _run(self, protocol: BenchProtocol) -> Run:
        """Return the run in the terms of the bed."""
        n = len(protocol)
        columns = {**protocol.conditions, **protocol.commands}

        def row(name: str, otherwise: float) -> Array:
            return np.broadcast_to(np.asarray(columns.get(name, otherwise), float), n).copy()

        roll, pitch, yaw = (float(row(name, 0.0)[0]) for name in BASE)
        return Run(
            protocol.name,
            f"specimen {self.specimen}",
            row(self.robot.drive, 0.0) * (PRESSURE_MAX_PA / self.robot.drive_max),
            row(LOAD, 0.0),
            temperature_c=float(row("temperature_c", REFERENCE_TEMPERATURE_C)[0]),
            base_angles_rad=(roll, pitch, yaw),
            valve_open=row(VALVE, 1.0) if VALVE in columns else None,
            time_s=np.asarray(protocol.time_s, float),
        )


def protocol_from_bed(run: Run, robot: Robot, number: int, new_specimen: bool) -> BenchProtocol:
    """Return a run of a protocol of the bed for the bench."""
    commands = {robot.drive: run.pressure_pa * (robot.drive_max / PRESSURE_MAX_PA), LOAD: run.moment_n_m}
    if not robot.tendon:
        commands[VALVE] = run.valve
    conditions = {"temperature_c": run.temperature_c, **dict(zip(BASE, run.base_angles_rad, strict=True))}
    del conditions["base_yaw_rad"]
    return BenchProtocol(f"run {number}", run.condition, run.time_s, commands, conditions, new_specimen)
