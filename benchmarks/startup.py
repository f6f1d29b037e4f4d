"""How long the command line takes to answer: `pliant --help`, an error in a study, `make demo` a second time.

    python -m benchmarks.startup
    python -m benchmarks.startup --mistakes    twelve typical mistakes instead, in CPU seconds

Each is timed in turns with `import numpy`, several times, and the smallest times are compared: ratios hold on any
machine, seconds on this one. Modules are compiled by the first run, as an installation compiles them.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.mistakes import table

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "examples" / "first_finger"
PLIANT = (sys.executable, "-m", "pliant")
WRONG = "pliant: 1\nname: wrong\nphysics: {kind: quasistatik}\n"
TURNS = 5
# What is to be reached: times `import numpy`, or seconds.
LIMITS = {
    "pliant --help": (4.0, "×"),
    "an error in a study": (1.0, "s"),
    "make demo, second time": (4.0, "s"),
}


def compiled(folder: Path) -> dict[str, str]:
    """The environment of a run that keeps byte code in the folder, whatever ours says of it."""
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return {**kept, "PYTHONPYCACHEPREFIX": str(folder / "compiled")}


def seconds(*commands: tuple[str, ...], cwd: Path, code: int = 0) -> float:
    """Wall time of commands after one another; raises where one ends with another exit code."""
    begun = time.perf_counter()
    for command in commands:
        done = subprocess.run(
            command, cwd=cwd, env=compiled(cwd), capture_output=True, text=True, check=False
        )
        if done.returncode != code:
            raise SystemExit(f"{' '.join(command)} ended with {done.returncode}:\n{done.stderr}")
    return time.perf_counter() - begun


def demo(folder: Path) -> float:
    """The two runs of `make demo`, with a store in `folder`."""
    runs = [
        (*PLIANT, "run", str(EXAMPLES / study), "--out", name)
        for study, name in (("finger.yaml", "runs/first-finger"), ("loaded.yaml", "runs/loaded-finger"))
    ]
    return seconds(*runs, cwd=folder)


def measured(folder: Path) -> tuple[float, dict[str, float]]:
    """Smallest seconds of `import numpy`, and of each case."""
    (folder / "wrong.yaml").write_text(WRONG, encoding="utf-8")
    demo(folder)  # fills the store
    cases = {
        "pliant --help": lambda: seconds((*PLIANT, "--help"), cwd=folder),
        "an error in a study": lambda: seconds((*PLIANT, "run", "wrong.yaml"), cwd=folder, code=2),
        "make demo, second time": lambda: demo(folder),
    }
    base, times = float("inf"), dict.fromkeys(cases, float("inf"))
    for _ in range(TURNS):
        base = min(base, seconds((sys.executable, "-c", "import numpy"), cwd=folder))
        times = {name: min(times[name], run()) for name, run in cases.items()}
    return base, times


def main() -> None:
    """Print the figures; exit code 1 where one is above its limit."""
    with tempfile.TemporaryDirectory() as folder:
        if "--mistakes" in sys.argv[1:]:
            raise SystemExit(1 if table(Path(folder), compiled(Path(folder)), TURNS) else 0)
        base, times = measured(Path(folder))
    print(f"python -c 'import numpy'   {base:6.3f} s")
    late = False
    for name, took in times.items():
        limit, unit = LIMITS[name]
        over = (took / base if unit == "×" else took) > limit
        late |= over
        print(
            f"{name:<26} {took:6.3f} s {took / base:6.1f} ×   {'above' if over else 'within'} {limit:g} {unit}"
        )
    raise SystemExit(1 if late else 0)


if __name__ == "__main__":
    main()
