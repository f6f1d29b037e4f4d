"""The sketch, compiled for this computer: it keeps its limits, and vents when the computer is gone."""

import os
import signal
import subprocess
import time
from importlib import resources

import numpy as np
import pytest
from tests.bench.conftest import PERIOD_S, pressure
from tests.bench.mangler import Mangler

from pliant.errors import UserError
from pliant_bench.bench import RunStoppedError
from pliant_bench.clock import AcceleratedClock
from pliant_bench.drivers.line_config import SerialConfig
from pliant_bench.drivers.line_protocol import encode
from pliant_bench.emulator import Emulator
from pliant_bench.ramps import shaped

pytest.importorskip("serial")
from pliant_bench.drivers.serial_line import SerialBench

SOURCES = resources.files("pliant_bench") / "microcontroller"
SILENCE_S = 0.5
LOW, HIGH, RATE = 0.0, 15e3, 20e3
SLOW = pytest.mark.slow
# `PLIANT_BENCH_TRIALS=5` makes 10 000 random protocols, 1 500 on bad lines and 100 kills: quarter of an hour.
MANY = int(os.environ.get("PLIANT_BENCH_TRIALS", "1"))

# Arduino's functions, so that the sketch can be compiled here.
ARDUINO = """
#include <stdint.h>
#define OUTPUT 1
#define A0 14
int analogRead(int); void analogWrite(int, int); void pinMode(int, int); unsigned long millis();
struct Port { void begin(long); int read(); void write(uint8_t); };
extern Port Serial;
"""


@pytest.mark.usefixtures("emulator_program")
@pytest.mark.parametrize("name", ["pliant_bench.c", "emulator.c", "pliant_bench.ino"])
def test_the_sources_compile_without_a_warning(name, tmp_path):
    language, options = ("c", ["-std=c99", "-D_DEFAULT_SOURCE"])
    if name.endswith(".ino"):
        (tmp_path / "Arduino.h").write_text(ARDUINO)
        language, options = "c++", ["-std=c++11", "-include", str(tmp_path / "Arduino.h"), f"-I{SOURCES}"]
    command = [
        "cc",
        "-x",
        language,
        *options,
        "-Wall",
        "-Wextra",
        "-Werror",
        "-fsyntax-only",
        str(SOURCES / name),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if "cannot execute" in done.stderr:
        pytest.skip("no C++ compiler")
    assert done.returncode == 0, done.stderr


def test_the_core_uses_no_heap_and_no_printf():
    text = (SOURCES / "pliant_bench.c").read_text()
    assert not any(word in text for word in ("malloc", "printf", "calloc", "alloca"))


class CountingBench(SerialBench):
    """Counts how often it is vented, or began anew."""

    vents = 0

    def vent(self):
        super().vent()
        self.vents += 1


def raw_path(rng):
    """Return levels, jumps and noise, beyond the limits in half of all cases."""
    high = rng.choice([HIGH, 2 * HIGH])
    longest = rng.choice([9, 200], p=[0.95, 0.05])
    path = np.repeat(rng.uniform(-0.2 * high * (high > HIGH), high, 4), rng.integers(1, longest, 4))
    return path + rng.choice([0.0, 300.0]) * rng.standard_normal(len(path))


def perform(bench, rng):
    """Perform one random protocol: shaped, as it is, or past the checks of the computer; return its fate."""
    raw, way = pressure(raw_path(rng)), rng.integers(3)
    if way == 0:
        assert bench.run(shaped(raw, bench.inputs), lambda sample: None).ending == "complete"
        return "shaped"
    if way == 1:
        try:
            bench.run(raw, lambda sample: None)
        except UserError:
            return "refused"
        return "allowed"
    for value in raw.commands["pressure_pa"]:
        try:
            bench.exchange({"pressure_pa": float(value)})
        except RunStoppedError as refused:
            assert "outside its range" in str(refused)
    bench.vent()
    return "attacked"


def assert_limits_were_kept(device, vents):
    """Raise unless every change of the valve keeps range and rate, but for one jump to rest at most per venting."""
    times, values = device.valve()
    assert values.min() >= LOW and values.max() <= HIGH
    steps, gaps = np.diff(values), np.diff(times)
    too_fast = np.abs(steps) > RATE * gaps * 1.0001 + 0.01
    assert (values[1:][too_fast] == 0.0).all()
    assert too_fast.sum() <= vents


@pytest.mark.parametrize("count", [200, pytest.param(2_000 * MANY, marks=SLOW)])
def test_the_valve_never_exceeds_its_limits_under_random_protocols(emulator_program, tmp_path, count):
    rng, fates = np.random.default_rng(count), []
    with Emulator(emulator_program, tmp_path / "valve.log", step_ms=round(1000 * PERIOD_S)) as device:
        bench = CountingBench(SerialConfig(port=device.port, timeout_s=1.0))  # on a busy computer too
        bench.connect()
        bench.clock = AcceleratedClock()
        for _ in range(count):
            fates.append(perform(bench, rng))
        bench.close()
        device.close()
        assert_limits_were_kept(device, bench.vents)
    assert min(fates.count(fate) for fate in ("shaped", "refused", "attacked")) > count / 5
    assert device.valve()[1].max() > 0.9 * HIGH


class MangledBench(CountingBench):
    """The same over a line that is mangled, as fast as a test needs."""

    def open_line(self):
        self.mangler = Mangler(super().open_line(), delay_s=0.01)
        return self.mangler


@pytest.mark.parametrize("count", [40, pytest.param(300 * MANY, marks=SLOW)])
def test_limits_hold_under_random_protocols_on_a_bad_line(emulator_program, tmp_path, count):
    rng = np.random.default_rng(count)
    with Emulator(emulator_program, tmp_path / "valve.log", step_ms=round(1000 * PERIOD_S)) as device:
        bench = MangledBench(SerialConfig(port=device.port, timeout_s=0.005))
        bench.connect()
        bench.clock = AcceleratedClock()
        for _ in range(count):
            perform(bench, rng)
        counts = bench.counts
        bench.close()
        device.close()
        assert_limits_were_kept(device, bench.vents + counts.repeated)
    assert counts.old > count and counts.damaged > count
    assert device.valve()[1].max() > 0.2 * HIGH


def run_until_killed(port, seed):
    """Perform random runs in a process that ends by SIGKILL only."""
    rng = np.random.default_rng(seed)
    bench = SerialBench(SerialConfig(port=port))
    bench.connect()
    while True:
        raw = np.repeat(rng.uniform(8e3, HIGH, 4), 80)
        bench.run(shaped(pressure(raw), bench.inputs), lambda sample: None)


def venting_delay(device, killed_s):
    """Return how long after the kill the valve was vented, without the time in which the emulator was not run."""
    deadline_s = time.monotonic() + 20
    while device.valve()[1][-1] != 0.0 or time.monotonic() < killed_s + SILENCE_S:
        assert time.monotonic() < deadline_s, "the valve was not vented"
        time.sleep(0.02)
    vented_s = device.valve()[0][-1]
    ends, gaps = device.pauses()
    paused_s = np.minimum(gaps, np.maximum(ends - killed_s, 0.0))[ends <= vented_s + 1e-3].sum()
    return vented_s - killed_s - paused_s


@pytest.mark.parametrize("count", [3, pytest.param(20 * MANY, marks=SLOW)])
def test_the_valve_is_vented_in_time_when_the_computer_is_killed(emulator_program, tmp_path, count):
    rng, pressures, delays = np.random.default_rng(count), [], []
    for k in range(count):
        with Emulator(emulator_program, tmp_path / f"valve_{k}.log") as device:
            child = os.fork()
            if child == 0:
                try:
                    run_until_killed(device.port, k)
                finally:
                    os._exit(1)
            time.sleep(rng.uniform(0.3, 2.0))
            os.kill(child, signal.SIGKILL)
            killed_s = time.monotonic()
            assert os.WTERMSIG(os.waitpid(child, 0)[1]) == signal.SIGKILL
            delays.append(venting_delay(device, killed_s))
            times, values = device.valve()
            pressures.append(values[np.searchsorted(times, killed_s, side="right") - 1])
    assert max(pressures) > 0.5 * HIGH
    assert max(delays) <= SILENCE_S + 0.05, f"vented {max(delays):.3f} s after the kill"
    print(f"{count} kills: vented {np.median(delays):.3f} s after, at most {max(delays):.3f} s")


def test_no_bytes_make_the_sketch_fail_or_move(tmp_path):
    """Garbage, damaged lines and lines with absurd contents, under the compiler's checks of memory and arithmetic."""
    files = [str(SOURCES / name) for name in ("emulator.c", "pliant_bench.c")]
    checks = [
        "-fsanitize=address,undefined",
        "-fno-sanitize-recover=all",
        "-D_DEFAULT_SOURCE",
        "-std=c99",
        "-g",
    ]
    program = tmp_path / "checked"
    built = subprocess.run(
        ["cc", *checks, *files, "-o", str(program), "-lm"], capture_output=True, check=False
    )
    if built.returncode:
        pytest.skip("no C compiler with checks")
    rng, lines = np.random.default_rng(6), []
    bodies = [
        "X",
        "X 1",
        "X 1 2 3 4 5 6",
        "X -5 nan",
        "X 9 1e99",
        "X 99999999999 -1e-99",
        "I",
        "I 999999",
        "O -1",
        "H",
        "Z",
    ]
    for k in range(4000):
        body = str(rng.choice([*bodies, "H 5", "V", "S", "X 10 " + "9" * int(rng.integers(6, 150))]))
        line = bytearray(encode(k % 65536, body))
        if rng.random() < 0.3:
            line[int(rng.integers(len(line)))] = int(rng.integers(256))
        lines.append(bytes(line) + (rng.bytes(int(rng.integers(400))) if rng.random() < 0.1 else b""))
    log = tmp_path / "valve.log"
    done = subprocess.run(
        [str(program), str(log), "1"], input=b"".join(lines), capture_output=True, check=False
    )
    assert done.returncode == 0, done.stderr.decode()
    assert done.stdout.count(b"\n") > 500
    assert {line.split()[1] for line in log.read_text().splitlines()} == {"0.000000"}
