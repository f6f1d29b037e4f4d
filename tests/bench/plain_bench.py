"""A bench of a first-order joint for tests of the loop: fast, without a study behind it, and it can be told to fail."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from pliant_bench.bench import (
    Bench,
    BenchChannel,
    BenchConfig,
    BenchProtocol,
    BenchRecording,
    BenchSample,
    ChannelCheck,
    ChannelLimits,
    ConnectionLostError,
    RunStoppedError,
    Watch,
)


@dataclass
class PlainBench(Bench):
    """A joint that follows its pressure; `before` is called with the index of each sample and may raise."""

    before: Callable[[int], None] = lambda _: None
    is_hardware = False
    vented: list[str] = field(default_factory=list)
    runs: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__(BenchConfig(kind="plain"))

    @property
    def inputs(self) -> tuple[BenchChannel, ...]:
        return (BenchChannel("pressure_pa", ChannelLimits(0.0, 15e3, 10e3)),)

    @property
    def outputs(self) -> tuple[BenchChannel, ...]:
        return (BenchChannel("angle_rad"),)

    def connect(self) -> None:
        pass

    def check(self) -> tuple[ChannelCheck, ...]:
        return (ChannelCheck("pressure_pa", 0.0), ChannelCheck("angle_rad", 0.0))

    def run(self, protocol: BenchProtocol, watch: Watch) -> BenchRecording:
        self.runs.append(protocol.name)
        rng = np.random.default_rng(len(self.runs))
        angle = protocol.commands["pressure_pa"] / 15e3 + 0.01 * rng.standard_normal(len(protocol))
        ending, reason, n = "complete", "", 0
        try:
            for k, time_s in enumerate(protocol.time_s.tolist()):
                self.before(k)
                n = k + 1
                watch(BenchSample(k, time_s, time_s, protocol.commands_at(k), {"angle_rad": float(angle[k])}))
        except RunStoppedError as error:
            ending = "lost" if isinstance(error, ConnectionLostError) else "stopped"
            reason = str(error)
        finally:
            self.vented.append(protocol.name)
        times = protocol.time_s[:n]
        commands = {name: values[:n] for name, values in protocol.commands.items()}
        return BenchRecording(
            protocol, times, times, commands, {"angle_rad": angle[:n]}, np.zeros(n, bool), ending, reason
        )

    def stop(self) -> None:
        pass

    def close(self) -> None:
        self.vented.append("closed")
