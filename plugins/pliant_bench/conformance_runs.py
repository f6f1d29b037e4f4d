"""Small runs for the checks of a `Bench`: within its limits, under a watchdog, and what their recordings show."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from pliant.errors import UserError
from pliant.testing import CheckSkipped, Subject, agree, require
from pliant.units import si_unit
from pliant_bench.bench import Bench, BenchChannel, BenchProtocol, BenchRecording, BenchSample
from pliant_bench.ramps import shaped
from pliant_bench.sampled import SampledBench
from pliant_bench.watchdog import Watchdog, WatchdogConfig

PERIOD_S, HOLD_S = 0.02, 0.6
SHARE = 0.1  # of the range of an input
SILENCE_S = 0.5
# Changes of an input without a range, which only a simulated bench may have.
SMALL, SMALL_OTHERWISE = {"Pa": 1e3, "N": 1.0}, 1e-2


def connected(subject: Subject) -> Bench:
    """Return the bench of the config, connected; skip the check without one."""
    bench: Bench = subject.build()
    try:
        bench.connect()
    except UserError as error:
        raise CheckSkipped(f"there is no bench: {error}") from None
    return bench


def with_bench(subject: Subject, act: Callable[[Bench], None]) -> None:
    """Call a function with the connected bench, and close it."""
    bench = connected(subject)
    if bench.is_hardware and not isinstance(bench, SampledBench):
        bench.close()
        raise CheckSkipped(f"{subject.component.label} lets other software perform its runs")
    try:
        act(bench)
    except BaseException:
        with suppress(Exception):  # the first error says more
            bench.close()
        raise
    bench.close()


def small_run(bench: Bench, share: float = SHARE, hold_s: float = HOLD_S) -> BenchProtocol:
    """Return a run in which every input goes to a share of its range and back to rest, within its limits."""
    time_s = PERIOD_S * np.arange(round(2 * hold_s / PERIOD_S), dtype=float)
    commands = {}
    for channel in bench.inputs:
        limits = channel.limits
        if np.isfinite(limits.low) and np.isfinite(limits.high):
            far = max((limits.low, limits.high), key=lambda end: abs(end - channel.rest))
            level = channel.rest + share * (far - channel.rest)
        else:
            level = channel.rest + SMALL.get(si_unit(channel.name), SMALL_OTHERWISE)
        commands[channel.name] = np.where(time_s < hold_s, level, channel.rest)
    return shaped(BenchProtocol("small", "a tenth of every range", time_s, commands), bench.inputs)


@dataclass(frozen=True, eq=False)
class Performed:
    """A run, its recording and what the watch saw."""

    protocol: BenchProtocol
    recording: BenchRecording
    samples: tuple[BenchSample, ...]


def performed(bench: Bench, protocol: BenchProtocol | None = None) -> Performed:
    """Perform a run to its end, under a watchdog; raise `Finding` if it does not get there."""
    asked = small_run(bench) if protocol is None else protocol
    watchdog, seen = Watchdog(asked, WatchdogConfig(SILENCE_S)), list[BenchSample]()

    def watch(sample: BenchSample) -> None:
        seen.append(sample)
        watchdog(sample)

    recording = bench.run(asked, watch)
    require(
        recording.ending == "complete",
        f"the run ended as '{recording.ending}' after {len(recording)} of {len(asked)} samples: {recording.reason}",
    )
    return Performed(asked, recording, tuple(seen))


def require_rest(bench: Bench) -> None:
    """Raise `Finding` unless every input is at rest."""
    values = {one.name: one.value for one in bench.check()}
    for channel in bench.inputs:
        agree(
            values[channel.name],
            channel.rest,
            f"{channel.name} is not at rest after the run",
            atol=rounding_error(channel),
        )


def rounding_error(channel: BenchChannel) -> float:
    """Return the error of a value that is no error of the driver."""
    span = channel.limits.high - channel.limits.low
    return 1e-3 * (span if np.isfinite(span) else SMALL.get(si_unit(channel.name), SMALL_OTHERWISE))
