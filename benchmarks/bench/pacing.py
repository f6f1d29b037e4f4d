"""How punctual the loop of a sampled bench is at 100 Hz, and what it costs.

    python -m benchmarks.bench.pacing
    python -m benchmarks.bench.pacing --quick     a minute instead of an hour, ten seconds instead of a minute

An hour in a clock that skips the waits but counts the work, with a bench in memory and with the emulated
microcontroller behind a pseudo-terminal; then a minute in real time of both. A sample is late when a command or reading
comes more than one period after it was due. On a busy machine samples are later, because the programs wait for a
processor; Linux counts these waits, and the share that is late without them is given beside (`late_without_waits`).
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from benchmarks.output import Bar, make_parser, write

from pliant.records.design import Array
from pliant_bench.bench import BenchChannel, BenchConfig, BenchProtocol, BenchRecording, ChannelLimits
from pliant_bench.clock import AcceleratedClock, Clock, RealClock
from pliant_bench.drivers.line_config import SerialConfig
from pliant_bench.drivers.serial_line import SerialBench
from pliant_bench.emulator import Emulator, compile_emulator
from pliant_bench.sampled import SampledBench

PERIOD_S = 0.01
LATE_SHARE = 1e-3
ATTEMPTS = 4  # a computer that does not run this program for half a second makes the microcontroller vent


class MemoryBench(SampledBench):
    """A bench that costs nothing: its angle is proportional to the pressure."""

    is_hardware = False

    @property
    def inputs(self) -> tuple[BenchChannel, ...]:
        return (BenchChannel("pressure_pa", ChannelLimits(0.0, 15e3, 20e3, 1e5)),)

    @property
    def outputs(self) -> tuple[BenchChannel, ...]:
        return (BenchChannel("angle_rad"),)

    def connect(self) -> None:
        pass

    def exchange(self, commands: Mapping[str, float]) -> Mapping[str, float]:
        return {"angle_rad": 4e-5 * commands["pressure_pa"]}

    def vent(self) -> None:
        pass

    def close(self) -> None:
        pass


def protocol(duration_s: float) -> BenchProtocol:
    """Return slow waves of pressure at 100 Hz."""
    time_s = PERIOD_S * np.arange(round(duration_s / PERIOD_S) + 1, dtype=float)
    waves = max(1, round(duration_s / 10))
    path = 4e3 * (1 - np.cos(2 * np.pi * waves * time_s / time_s[-1]))
    path[-1] = 0.0
    return BenchProtocol("pacing", "slow waves", time_s, {"pressure_pa": path})


def waited_s(others: Sequence[int]) -> float:
    """Return how long the threads of this and other processes have waited for a processor; 0 where nobody counts."""
    places = [Path("/proc/self/task"), *(Path(f"/proc/{number}/task") for number in others)]
    try:
        files = [thread / "schedstat" for place in places for thread in place.iterdir()]
        return sum(int(file.read_text().split()[1]) for file in files) * 1e-9
    except (OSError, IndexError):
        return 0.0


def without_waits(lateness_s: Array, waits_s: Array) -> Array:
    """Return how late samples are, less the waits for a processor since the last sample that was not late."""
    before, own = 0.0, np.empty(len(lateness_s))
    for k, late_s in enumerate(lateness_s.tolist()):
        own[k] = late_s - (waits_s[k] - before)
        if late_s <= PERIOD_S:
            before = waits_s[k]
    return own


def measured(
    bench: SampledBench, duration_s: float, clock: Clock, others: Sequence[int] = ()
) -> dict[str, float]:
    """Return the figures of a run; `others` are the processes that take part."""
    bench.clock = clock
    asked = protocol(duration_s)
    waits: list[float] = []
    for attempt in range(ATTEMPTS):
        wall_s, cpu_s = time.monotonic(), time.process_time()
        waits.clear()
        done: BenchRecording = bench.run(asked, lambda sample: waits.append(waited_s(others)))
        if done.ending == "complete":
            break
        print(f"attempt {attempt + 1} ended as {done.ending} after {len(done)} samples: {done.reason}")
    else:
        raise SystemExit("no run was complete; is the computer too busy?")
    lateness_s = np.maximum(done.commanded_s, done.read_s) - asked.time_s
    is_late = lateness_s > PERIOD_S
    return {
        "samples": len(done),
        "stopped_before": attempt,
        "late_share": float(is_late.mean()),
        "late_without_waits": float((without_waits(lateness_s, np.array(waits)) > PERIOD_S).mean()),
        "late_unmarked": int((is_late & ~done.late).sum()),
        "lost_share": float(np.isnan(done.readings["angle_rad"]).mean()),
        "lateness_median_ms": 1e3 * float(np.median(lateness_s)),
        "lateness_999_ms": 1e3 * float(np.quantile(lateness_s, 0.999)),
        "lateness_largest_ms": 1e3 * float(lateness_s.max()),
        "wall_s": time.monotonic() - wall_s,
        "cpu_s": time.process_time() - cpu_s,
    }


def through_terminal(folder: Path, program: Path, duration_s: float, accelerated: bool) -> dict[str, float]:
    """Return the figures of a run on the emulated microcontroller."""
    step_ms = round(1000 * PERIOD_S) if accelerated else 0
    with Emulator(program, folder / f"valve_{step_ms}.log", step_ms=step_ms) as device:
        bench = SerialBench(SerialConfig(port=device.port))
        bench.connect()
        try:
            clock = AcceleratedClock(counts_work=True) if accelerated else RealClock()
            return measured(bench, duration_s, clock, device.process_ids)
        finally:
            bench.close()


def main() -> None:
    """Measure, print, write benchmarks/out/bench_pacing.json."""
    quick = make_parser(__doc__, "shorter runs").parse_args().quick
    long_s, short_s = (60.0, 10.0) if quick else (3600.0, 60.0)
    with tempfile.TemporaryDirectory() as parent:
        folder = Path(parent)
        program = compile_emulator(folder)
        memory = MemoryBench(BenchConfig(kind="memory"))
        results = {
            "memory, accelerated": measured(memory, long_s, AcceleratedClock(counts_work=True)),
            "terminal, accelerated": through_terminal(folder, program, long_s, True),
            "memory, real time": measured(memory, short_s, RealClock()),
            "terminal, real time": through_terminal(folder, program, short_s, False),
        }
    for name, figures in results.items():
        print(name, {key: round(value, 5) for key, value in figures.items()})
    bars = [
        Bar(f"late samples, {name}", figures["late_share"], LATE_SHARE, "%", scale=100)
        for name, figures in results.items()
    ]
    bars += [
        Bar(
            f"the same without waits for a processor, {name}",
            figures["late_without_waits"],
            LATE_SHARE,
            "%",
            scale=100,
        )
        for name, figures in results.items()
    ]
    bars.append(Bar("late samples without a mark", sum(f["late_unmarked"] for f in results.values()), 0, ""))
    write("bench_pacing", results, bars)


if __name__ == "__main__":
    main()
