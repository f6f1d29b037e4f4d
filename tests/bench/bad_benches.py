"""A bench without hardware, and benches that lie, stall, drop samples, or break their contract in another way."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import Literal

import numpy as np

from pliant_bench.bench import (
    BenchChannel,
    BenchConfig,
    BenchProtocol,
    BenchRecording,
    ChannelLimits,
    ConnectionLostError,
    Watch,
)
from pliant_bench.clock import AcceleratedClock, Clock
from pliant_bench.sampled import SampledBench, recorded

PRESSURE = BenchChannel("pressure_pa", ChannelLimits(0.0, 15e3, 20e3, 1e5))
ANGLE = BenchChannel("angle_rad", ChannelLimits(-2.0, 2.0))
RAD_PER_PA = 4e-5
LAG_S = 0.1


class PlantConfig(BenchConfig):
    """A finger that follows the pressure with a lag."""

    kind: Literal["plant"] = "plant"


class Plant(SampledBench):
    """A finger of first order in an accelerated clock; `sent` is the log of its valve."""

    is_hardware = False

    def __init__(self, config: PlantConfig | None = None) -> None:
        super().__init__(config or PlantConfig())
        self.clock: Clock = AcceleratedClock()
        self.sent: list[tuple[float, float]] = []
        self.vents = 0
        self._angle, self._then_s = 0.0, 0.0

    @property
    def inputs(self) -> tuple[BenchChannel, ...]:
        return (PRESSURE,)

    @property
    def outputs(self) -> tuple[BenchChannel, ...]:
        return (ANGLE,)

    @property
    def is_vented(self) -> bool:
        return bool(self.sent) and self.sent[-1][1] == PRESSURE.rest and self.vents > 0

    def connect(self) -> None:
        pass

    def exchange(self, commands: Mapping[str, float]) -> Mapping[str, float]:
        now = self.clock.now()
        self.sent.append((now, commands["pressure_pa"]))
        share = 1 - np.exp(-(now - self._then_s) / LAG_S)
        self._angle += share * (RAD_PER_PA * commands["pressure_pa"] - self._angle)
        self._then_s = now
        return {"angle_rad": self._angle}

    def vent(self) -> None:
        self.vents += 1
        self.sent.append((self.clock.now(), PRESSURE.rest))

    def close(self) -> None:
        self.vent()


class Liar(Plant):
    """Reads a channel that it does not have."""

    def exchange(self, commands: Mapping[str, float]) -> Mapping[str, float]:
        return {"tip_x_m": super().exchange(commands)["angle_rad"]}


class OtherCommands(Plant):
    """Records other commands than it was given."""

    def run(self, protocol: BenchProtocol, watch: Watch) -> BenchRecording:
        done = super().run(protocol, watch)
        commands = {name: 0.9 * values for name, values in done.commands.items()}
        return BenchRecording(
            protocol, done.commanded_s, done.read_s, commands, done.readings, done.late, done.ending
        )


class Stalling(Plant):
    """Hangs in its fifth exchange, until the test ends it."""

    stall_s = 0.2

    def __init__(self, config: PlantConfig | None = None) -> None:
        super().__init__(config)
        self.released = threading.Event()

    def exchange(self, commands: Mapping[str, float]) -> Mapping[str, float]:
        if len(self.sent) > 5:
            self.released.wait(30)
            raise ConnectionLostError("released")
        return super().exchange(commands)


class Dropping(Plant):
    """Loses every reading after the tenth."""

    def exchange(self, commands: Mapping[str, float]) -> Mapping[str, float]:
        readings = super().exchange(commands)
        return readings if len(self.sent) < 10 else {}


class NotANumber(Plant):
    """Reads NaN from the tenth sample on."""

    def exchange(self, commands: Mapping[str, float]) -> Mapping[str, float]:
        readings = super().exchange(commands)
        return readings if len(self.sent) < 10 else {"angle_rad": np.nan}


class RestartedClock(AcceleratedClock):
    """Begins again at zero when it comes to one second."""

    def now(self) -> float:
        time_s = super().now()
        return time_s if time_s < 1.0 else time_s - 1.0


class Restarting(Plant):
    """Has a clock that restarts within the run."""

    def __init__(self, config: PlantConfig | None = None) -> None:
        super().__init__(config)
        self.clock = RestartedClock()


class Disconnecting(Plant):
    """Loses its connection after ten samples."""

    def exchange(self, commands: Mapping[str, float]) -> Mapping[str, float]:
        if len(self.sent) > 10:
            raise OSError(5, "Input/output error")
        return super().exchange(commands)


class Unlimited(Plant):
    """Performs every run without a check of its limits, and leaves the pressure on."""

    def run(self, protocol: BenchProtocol, watch: Watch) -> BenchRecording:
        for k in range(len(protocol)):
            self.exchange(protocol.commands_at(k))
        return recorded(protocol, [], self.outputs)


class Unventable(Plant):
    """Cannot be vented once the pressure is on."""

    def vent(self) -> None:
        if self.sent and self.sent[-1][1] > 0:
            raise OSError(5, "Input/output error")
        super().vent()
