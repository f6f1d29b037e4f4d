"""Large recordings through the command line: 10 million rows compared, 2 million diagnosed; seconds and memory.

    python -m benchmarks.large_files            prints, and writes benchmarks/out/large_files.json
    python -m benchmarks.large_files --quick    a tenth of the rows

The baseline is `csv.reader` of the standard library over the file of 10 million, which turns no cell into a number.
The joint is that of examples/hidden_effect; the readings are those of a joint with another gain, with noise.
"""

from __future__ import annotations

import csv
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from benchmarks.output import ROOT, Bar, make_parser, write

STUDY = ROOT / "examples" / "hidden_effect" / "finger.yaml"
ROWS = {"compare": 10_000_000, "diagnose": 2_000_000}
COMMANDS: dict[str, tuple[str, ...]] = {"compare": (), "diagnose": ("--effect", "stiffness")}
MOST_S, MOST_BYTES = 25.0, 500e6
BLOCK = 500_000
STEP_S, SWING_S = 1e-3, 9.0
PRESSURE_PA, GAIN, NOISE_RAD = 15e3, 6e-5, 2e-3


def main() -> None:
    quick = make_parser(__doc__, "a tenth of the rows").parse_args().quick
    rows = {verb: n // 10 if quick else n for verb, n in ROWS.items()}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        used = {}
        for verb, n in rows.items():
            file = recorded(folder / f"{verb}.csv", n)
            if verb == "compare":
                plain_s = read_plainly(file)
            used[verb] = run(verb, file, folder)
            file.unlink()
    bars = [
        bar
        for verb, (seconds, size) in used.items()
        for bar in (
            Bar(f"{verb} of {rows[verb]} rows", seconds, MOST_S, "s"),
            Bar(f"its memory, {verb}", size, MOST_BYTES, "MB", scale=1e-6),
        )
    ]
    over = used["compare"][0] / plain_s
    print(f"compare takes {over:.1f} times as long as csv.reader over the same file ({plain_s:.1f} s)")
    found = {"rows": rows, "seconds": {verb: s for verb, (s, _) in used.items()}, "over_csv_reader": over}
    write("large_files", {**found, "bytes": {verb: size for verb, (_, size) in used.items()}}, bars)


def recorded(path: Path, n: int) -> Path:
    """Return a slow swing of the pressure in `n` rows."""
    noise = np.random.default_rng(0)
    with path.open("w") as file:
        file.write("time_s,pressure_pa,angle_rad\n")
        for first in range(0, n, BLOCK):
            clock = STEP_S * np.arange(first, min(first + BLOCK, n))
            pressure = PRESSURE_PA * (0.5 - 0.5 * np.cos(clock / SWING_S))
            angle = GAIN * pressure + noise.normal(0.0, NOISE_RAD, len(clock))
            rows = zip(clock.tolist(), pressure.tolist(), angle.tolist(), strict=True)
            file.writelines(f"{t:.3f},{p:.2f},{u:.5f}\n" for t, p, u in rows)
    return path


def read_plainly(path: Path) -> float:
    """Return the seconds that the standard library needs to split the file into cells."""
    begun = time.perf_counter()
    with path.open(newline="") as file:
        for _ in csv.reader(file):
            pass
    return time.perf_counter() - begun


def run(verb: str, file: Path, folder: Path) -> tuple[float, float]:
    """Return wall time and largest memory (bytes) of a command in a separate process; raise if it fails."""
    command = [sys.executable, "-m", "pliant", verb, str(STUDY), "--data", str(file), *COMMANDS[verb]]
    begun = time.perf_counter()
    child = os.posix_spawn(
        sys.executable,
        [*command, "--out", str(folder / verb), "--store", str(folder / "store")],
        dict(os.environ),
        file_actions=[(os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)],
    )
    _, status, used = os.wait4(child, 0)
    if os.waitstatus_to_exitcode(status):
        raise SystemExit(f"{' '.join(command)} ended with {os.waitstatus_to_exitcode(status)}")
    return time.perf_counter() - begun, 1024.0 * used.ru_maxrss


if __name__ == "__main__":
    main()
