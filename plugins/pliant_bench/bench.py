"""Bench: what performs runs on a specimen and records them.

A driver subclasses `SampledBench` where it can set the inputs and read the outputs at any time (one method more than
connecting, venting and closing), or `Bench` where it performs whole runs, such as a laboratory's own software.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from pliant.interfaces.base import ComponentConfig, Configured
from pliant.records.design import Array

# Why a run ended: all of it was done, the watchdog or the user stopped it, or the connection was lost.
Ending = Literal["complete", "stopped", "lost"]


class BenchConfig(ComponentConfig):
    """Base of the block `bench`."""


@dataclass(frozen=True)
class ChannelLimits:
    """Limits of an input, SI; infinite without a limit.

    Attributes:
        low, high: range of the value.
        rate: largest magnitude of the change per second.
        acceleration: largest magnitude of the change of the rate per second.
        dwell_s: least time between the end of one change of the value and the beginning of the next one.
    """

    low: float = -np.inf
    high: float = np.inf
    rate: float = np.inf
    acceleration: float = np.inf
    dwell_s: float = 0.0

    def both(self, other: ChannelLimits) -> ChannelLimits:
        """Return the limits that keep both."""
        return ChannelLimits(
            max(self.low, other.low),
            min(self.high, other.high),
            min(self.rate, other.rate),
            min(self.acceleration, other.acceleration),
            max(self.dwell_s, other.dwell_s),
        )


@dataclass(frozen=True)
class BenchChannel:
    """An input or an output of a bench.

    Attributes:
        name: as in measurement files, with the SI unit at its end: ``pressure_pa``, ``angle_rad``.
        limits: of an input the range and speed, of an output the range that the sensor can read.
        rest: value of an input at rest, to which it is vented.
    """

    name: str
    limits: ChannelLimits = ChannelLimits()
    rest: float = 0.0


@dataclass(frozen=True, eq=False)
class BenchProtocol:
    """A run to perform.

    Attributes:
        name: of the run in the recording.
        words: the run in words.
        time_s: (t,) from 0, increasing: instants at which the inputs are set and the outputs read.
        commands: (t,) of each input, SI; linear between the instants.
        conditions: what a person sets before the run, by the name of its column: ``payload_kg``, ``base_pitch_rad``.
        new_specimen: whether the run needs a specimen that was never loaded.
    """

    name: str
    words: str
    time_s: Array
    commands: Mapping[str, Array]
    conditions: Mapping[str, float] = field(default_factory=dict)
    new_specimen: bool = False

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def duration_s(self) -> float:
        """Return the time of the last instant."""
        return float(self.time_s[-1])

    def commands_at(self, index: int) -> dict[str, float]:
        """Return the value of every input at an instant."""
        return {name: float(values[index]) for name, values in self.commands.items()}


@dataclass(frozen=True, eq=False)
class BenchSample:
    """One performed instant of a run.

    Attributes:
        index: of the instant in the protocol.
        commanded_s, read_s: when the inputs were set and the outputs were read, on the bench's clock from the run's
            start; NaN where this did not happen.
        commands: values that were set, SI.
        readings: values that were read, SI; an output that was not read is missing or NaN.
        late: whether the inputs were set, or the outputs read, later than one sampling period after they were due.
    """

    index: int
    commanded_s: float
    read_s: float
    commands: Mapping[str, float]
    readings: Mapping[str, float]
    late: bool = False


@dataclass(frozen=True, eq=False)
class BenchRecording:
    """A performed run with its readings.

    Attributes:
        protocol: what was asked for.
        commanded_s, read_s: (t,) as in `BenchSample`.
        commands: (t,) of each input that was set, SI.
        readings: (t,) of each output, SI; NaN without a reading.
        late: (t,) samples that were late.
        ending, reason: how the run ended, and in a sentence why it was not complete.
    """

    protocol: BenchProtocol
    commanded_s: Array
    read_s: Array
    commands: Mapping[str, Array]
    readings: Mapping[str, Array]
    late: NDArray[np.bool_]
    ending: Ending = "complete"
    reason: str = ""

    def __len__(self) -> int:
        return len(self.read_s)


# Called with every sample while it comes in; it raises `RunStoppedError` to end the run, after which the bench vents.
Watch = Callable[[BenchSample], None]


class RunStoppedError(Exception):
    """A reason to end a run at once; its text is a sentence."""


class ConnectionLostError(RunStoppedError):
    """The bench no longer answers; the run ends as `lost`."""


@dataclass(frozen=True)
class ChannelCheck:
    """Result of the handshake of one channel: its value at rest, and a sentence where something is wrong."""

    name: str
    value: float
    problem: str = ""


class Bench(Configured[BenchConfig]):
    """A bench with its specimen.

    `connect` comes first, `close` last, `stop` at any time and from any thread. After `run` the inputs are at rest,
    however it ended.

    `is_hardware` is false where nothing can move or burst. `study_limits` are those of the study, by input: the loop
    sets them, and a run keeps the narrower ones.
    """

    is_hardware: ClassVar[bool] = True
    study_limits: Mapping[str, ChannelLimits] = MappingProxyType({})

    @property
    def limited_inputs(self) -> tuple[BenchChannel, ...]:
        """Return the inputs with the limits of the driver and of the study."""
        return tuple(
            replace(one, limits=one.limits.both(self.study_limits.get(one.name, ChannelLimits())))
            for one in self.inputs
        )

    @property
    @abstractmethod
    def inputs(self) -> tuple[BenchChannel, ...]:
        """Return the inputs with the driver's own limits; after `connect`."""

    @property
    @abstractmethod
    def outputs(self) -> tuple[BenchChannel, ...]:
        """Return the outputs; after `connect`."""

    @abstractmethod
    def connect(self) -> None:
        """Open the connection.

        Raises:
            UserError: the bench does not answer, or has other channels than the config states.
        """

    @abstractmethod
    def check(self) -> tuple[ChannelCheck, ...]:
        """Return the result of a slow handshake of every channel, with the inputs at rest."""

    def resume(self, done: Sequence[BenchRecording]) -> None:
        """Continue an interrupted experiment after these runs; after `connect`. A real specimen remembers them."""
        return

    @abstractmethod
    def run(self, protocol: BenchProtocol, watch: Watch) -> BenchRecording:
        """Perform the run and return its recording, also of a run that was stopped.

        Args:
            protocol: within the limits; a driver that sets each sample checks them again before it.
            watch: called with every sample, as it comes in where the driver can.

        Raises:
            UserError: the run cannot be begun.
        """

    def reconnect(self) -> bool:
        """Connect again after a run that ended as `lost`; return whether the bench answers, vented."""
        return False

    @abstractmethod
    def stop(self) -> None:
        """End the run and vent."""

    @abstractmethod
    def close(self) -> None:
        """Vent and close the connection; also after an error, and twice."""
