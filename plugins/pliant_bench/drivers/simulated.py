"""Driver `simulated`: a bench whose specimen is a study, with the effects that it states and noise of the readings.

The study, `truth`, may have a chain of modules or a user's model. The specimen remembers: all its runs so far are
simulated together, so that softening and set continue from run to run.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from pliant import api
from pliant.errors import UserError, closest
from pliant.evidence.measured_model import MeasuredModel
from pliant.evidence.opening import measured_model
from pliant.experiments.planned_run import unread_run
from pliant.interfaces.model import Channel
from pliant.pipeline.study import build_study_chain
from pliant.records.design import Array
from pliant.records.history import REFERENCE_TEMPERATURE_C, History
from pliant.records.measurement import Measurement
from pliant.units import Ratio, Time, parse_quantity, si_unit
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
from pliant_bench.plans import CONDITIONS, VALVE, protocol_history

STILL = BenchProtocol("still", "all inputs at rest", np.array([0.0, 1.0, 2.0]), {})


class SimulatedBenchConfig(BenchConfig):
    """``bench: {kind: simulated, truth: truth.yaml, noise: {angle_rad: 0.3 deg}}``."""

    kind: Literal["simulated"] = "simulated"
    truth: Path = Field(description="the study that is simulated as the specimen", examples=["truth.yaml"])
    outputs: tuple[str, ...] = Field(
        (), description="what is read; the outputs with noise by default, else those of the truth"
    )
    noise: dict[str, float | str] = Field(
        default_factory=dict, description="standard deviation of the readings by output: {angle_rad: 0.3 deg}"
    )
    correlated_share: Ratio = Field(
        0.0, ge=0, le=1, description="share of the noise's variance that is correlated in time"
    )
    correlation_s: Time = Field(2.0, gt=0, description="time in which the correlation falls to 1/e")
    run_offset: Ratio = Field(
        0.0, ge=0, description="standard deviation of a constant offset of each run, as a share of the noise"
    )
    rig: tuple[str, ...] = Field(
        (),
        description="loads and conditions that the bench drives itself: [moment_n_m, valve_open]; a person sets others",
    )
    seed: int = Field(0, ge=0, description="of the noise")
    speed: float | None = Field(
        None, gt=0, description="how many times faster than a real bench samples come; null: without waiting"
    )


@dataclass(frozen=True)
class ReadingNoise:
    """Noise of readings: a white and a correlated part, and an offset per run.

    Attributes:
        sigma: standard deviation of the white and the correlated part together by output, SI.
        correlated_share, correlation_s, run_offset: as in `SimulatedBenchConfig`.
    """

    sigma: dict[str, float]
    correlated_share: float = 0.0
    correlation_s: float = 2.0
    run_offset: float = 0.0

    def draw(self, name: str, clock: Array, rng: np.random.Generator) -> Array:
        """Return (t,) the noise of an output in a run that is read at these times."""
        n = len(clock)
        keep = np.exp(-np.diff(clock) / self.correlation_s)
        pushes = rng.standard_normal(n)
        correlated = np.empty(n)
        correlated[:1] = pushes[:1]  # the first value has the stationary spread
        for k in range(1, n):
            correlated[k] = keep[k - 1] * correlated[k - 1] + math.sqrt(1.0 - keep[k - 1] ** 2) * pushes[k]
        share = self.correlated_share
        unit = math.sqrt(share) * correlated + math.sqrt(1.0 - share) * rng.standard_normal(n)
        unit += self.run_offset * rng.standard_normal()
        return np.asarray(self.sigma.get(name, 0.0) * unit, float)


@dataclass
class SimulatedSpecimens:
    """The runs that the specimens have behind them.

    Attributes:
        histories: of all runs so far, in their order.
        number: of the specimen that is mounted, from 1.
    """

    histories: list[History] = field(default_factory=list)
    number: int = 1

    @property
    def name(self) -> str:
        """Return the name of the mounted specimen."""
        return f"specimen {self.number}"

    def mount(self, protocol: BenchProtocol) -> None:
        """Take a new specimen if the run needs one and the mounted one was loaded."""
        if protocol.new_specimen and any(one.specimen == self.name for one in self.histories):
            self.number += 1

    def mounted_runs(self) -> list[History]:
        """Return the runs of the mounted specimen."""
        return [one for one in self.histories if one.specimen == self.name]


class SimulatedBench(Bench):
    """A bench without hardware, whose specimen is a study."""

    is_hardware: ClassVar[bool] = False
    config: SimulatedBenchConfig

    def __init__(self, config: SimulatedBenchConfig) -> None:
        super().__init__(config)
        self._model: MeasuredModel | None = None
        self._inputs: tuple[BenchChannel, ...] = ()
        self._outputs: tuple[BenchChannel, ...] = ()
        self._noise = ReadingNoise({})
        self._specimens = SimulatedSpecimens()
        self._stopping = Event()

    @property
    def inputs(self) -> tuple[BenchChannel, ...]:
        """Return the inputs of the truth, then the loads and conditions that the rig drives."""
        return self._inputs

    @property
    def outputs(self) -> tuple[BenchChannel, ...]:
        """Return the outputs that are read."""
        return self._outputs

    def connect(self) -> None:
        """Open the truth.

        Raises:
            UserError: the file is missing or wrong, or the truth lacks an output.
        """
        opened = api.open_study(self.config.truth)
        names = self.config.outputs or tuple(self.config.noise)
        if opened.study.model is not None:
            system = opened.context.build("model", opened.study.model)
            driven = [one.name for one in system.inputs]
            names = names or tuple(one.name for one in system.outputs)
        else:
            chain = build_study_chain(opened.context, opened.study).chain
            driven = [one.input for one in chain.actuators]
            extends = chain.laws[0].joint == "prismatic"
            names = names or (("elongation_strain",) if extends else ("angle_rad",))
        still = protocol_history(STILL, tuple(dict.fromkeys(driven)))
        unread = Measurement((unread_run(still, names),), names, source="the bench")
        model = measured_model(opened.context, opened.study, unread)
        if model.missing:
            raise UserError(
                f"The truth {self.config.truth.name} has no output {', '.join(model.missing)}; "
                "correct 'outputs' or 'noise' of the bench."
            )
        self._model = model
        self._inputs = (*map(_input, model.inputs), *map(_rig_channel, self.config.rig))
        self._outputs = tuple(BenchChannel(name) for name in names)
        self._noise = ReadingNoise(
            {name: self._sigma(name, value, names) for name, value in self.config.noise.items()},
            self.config.correlated_share,
            self.config.correlation_s,
            self.config.run_offset,
        )

    def _sigma(self, name: str, value: float | str, outputs: Sequence[str]) -> float:
        if name not in outputs:
            raise UserError(
                f"'noise' of the bench names '{name}', which is not read{closest(name, list(outputs))}"
            )
        return parse_quantity(value, si_unit(name) or "dimensionless") if isinstance(value, str) else value

    def check(self) -> tuple[ChannelCheck, ...]:
        """Return every channel at rest, without noise."""
        readings = self._predict([protocol_history(STILL, self._driven)])
        inputs = [ChannelCheck(one.name, one.rest) for one in self._inputs]
        return (*inputs, *(ChannelCheck(one.name, float(readings[one.name][-1])) for one in self._outputs))

    def resume(self, done: Sequence[BenchRecording]) -> None:
        """Give the specimens the runs of an interrupted experiment, as they were performed."""
        self._specimens = SimulatedSpecimens()
        for recording in done:
            self._specimens.mount(recording.protocol)
            self._remember(recording.protocol, len(recording))

    def run(self, protocol: BenchProtocol, watch: Watch) -> BenchRecording:
        """Simulate the run, then give it to the watch sample by sample."""
        self._stopping.clear()
        self._specimens.mount(protocol)
        history = protocol_history(protocol, self._driven, self._specimens.name)
        ideal = self._predict([*self._specimens.mounted_runs(), history])
        rng = np.random.default_rng([self.config.seed, len(self._specimens.histories)])
        readings = {
            one.name: ideal[one.name] + self._noise.draw(one.name, protocol.time_s, rng)
            for one in self._outputs
        }
        samples: list[BenchSample] = []
        ending: Ending = "complete"
        reason, started = "", time.perf_counter()
        try:
            for index in range(len(protocol)):
                sample = self._sample(protocol, index, readings, started)
                if self._stopping.is_set():
                    raise RunStoppedError("The bench was told to stop.")
                samples.append(sample)
                watch(sample)
        except RunStoppedError as error:
            ending, reason = "stopped", str(error)
        finally:  # also after Ctrl-C: what was done was done
            self._remember(protocol, len(samples))
        return _recording(protocol, samples, readings, ending, reason)

    def stop(self) -> None:
        """End the run; the next one begins at rest."""
        self._stopping.set()

    def close(self) -> None:
        """End the run; the specimens are kept until the bench is dropped."""
        self._stopping.set()

    @property
    def _driven(self) -> tuple[str, ...]:
        assert self._model is not None, "`connect` comes first"
        return tuple(one.name for one in self._model.inputs)

    def _predict(self, histories: Sequence[History]) -> dict[str, Array]:
        """Return the readings of the last of these runs of one specimen."""
        assert self._model is not None, "`connect` comes first"
        outputs = tuple(one.name for one in self._outputs)
        runs = tuple(unread_run(history, outputs) for history in histories)
        return self._model.for_runs(Measurement(runs, outputs, source="the bench")).predict()[-1]

    def _remember(self, protocol: BenchProtocol, count: int) -> None:
        """Add a run to the mounted specimen, up to the sample at which it ended."""
        if count:
            whole = protocol_history(protocol, self._driven, self._specimens.name)
            self._specimens.histories.append(whole.at_samples(np.arange(count)))

    def _sample(
        self, protocol: BenchProtocol, index: int, readings: dict[str, Array], started: float
    ) -> BenchSample:
        """Wait until the sample is due, if the bench has a pace, and return it.

        The specimen moves at the instants of the protocol, however late the computer is.
        """
        due = float(protocol.time_s[index])
        if self.config.speed is not None:
            self._stopping.wait(max(0.0, started + due / self.config.speed - time.perf_counter()))
        read = {name: float(values[index]) for name, values in readings.items()}
        return BenchSample(index, due, due, protocol.commands_at(index), read)


def _input(channel: Channel) -> BenchChannel:
    low = -np.inf if channel.low is None else channel.low
    return BenchChannel(channel.name, ChannelLimits(low, np.inf if channel.high is None else channel.high))


def _rig_channel(name: str) -> BenchChannel:
    """Return a load, a condition or the valve, which is open at rest, as a channel."""
    known = (*CONDITIONS, VALVE)
    if name not in known:
        raise UserError(
            f"'rig' of the bench names '{name}', which is no load and no condition{closest(name, known)}"
        )
    if name == "temperature_c":
        return BenchChannel(name, rest=REFERENCE_TEMPERATURE_C)
    return BenchChannel(name, ChannelLimits(0.0, 1.0), 1.0) if name == VALVE else BenchChannel(name)


def _recording(
    protocol: BenchProtocol,
    samples: Sequence[BenchSample],
    readings: dict[str, Array],
    ending: Ending,
    reason: str,
) -> BenchRecording:
    n = len(samples)
    return BenchRecording(
        protocol,
        np.array([one.commanded_s for one in samples]),
        np.array([one.read_s for one in samples]),
        {name: np.asarray(values, float)[:n] for name, values in protocol.commands.items()},
        {name: values[:n] for name, values in readings.items()},
        np.array([one.late for one in samples], bool),
        ending,
        reason,
    )
