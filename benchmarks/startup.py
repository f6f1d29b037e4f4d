"""How long the command line takes to answer: `pliant --help`, an error in a study, `make demo` a second time.

    python -m benchmarks.startup
    python -m benchmarks.startup --mistakes    twelve typical mistakes: what each costs and what is answered

Each is timed in turns with `import numpy`, several times, and the smallest times are compared: ratios hold on any
machine, seconds on this one. Modules are compiled by the first run, as an installation compiles them. Mistakes are
timed in CPU seconds (user and system) of the child process, which a busy machine does not stretch much.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "examples" / "first_finger"
PLIANT = (sys.executable, "-m", "pliant")
WRONG = "pliant: 1\nname: wrong\nphysics: {kind: quasistatik}\n"
TURNS = 5
# Targets: times `import numpy`, or seconds.
LIMITS = {
    "pliant --help": (4.0, "×"),
    "an error in a study": (1.0, "s"),
    "make demo, second time": (4.0, "s"),
}
# Of the mistakes.
MISTAKE_LIMIT_S = 1.5  # of CPU
MOST_SHOWN = 240  # letters of an answer
STUDY = """\
pliant: 1
name: joint
surrogate:
  kind: polynomial
  form: study
  odd: true
  coefficients: {k_n: 1.637e-6, m_a: -1.704e-6, m_e: 0.1012, b_e: 0.0245}
chain: {modules: 1, module_length: 11 mm, module_mass: 1.5 g}
"""
TAIL = "physics: quasistatic\n"
READINGS = "\n".join(f"{k / 10:.1f},{500 * k},{0.01 * k:.3f}" for k in range(30))
COLUMNS = "time_s,pressure_pa,angle_rad"


def compiled(folder: Path) -> dict[str, str]:
    """Return the environment of a run that keeps byte code in the folder, whatever ours is."""
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return {**kept, "PYTHONPYCACHEPREFIX": str(folder / "compiled")}


def seconds(*commands: tuple[str, ...], cwd: Path, code: int = 0) -> float:
    """Return the wall time of consecutive commands; raise if one ends with another exit code."""
    begun = time.perf_counter()
    for command in commands:
        done = subprocess.run(
            command, cwd=cwd, env=compiled(cwd), capture_output=True, text=True, check=False
        )
        if done.returncode != code:
            raise SystemExit(f"{' '.join(command)} ended with {done.returncode}:\n{done.stderr}")
    return time.perf_counter() - begun


def demo(folder: Path) -> float:
    """Return the two runs of `make demo`, with a store in `folder`."""
    runs = [
        (*PLIANT, "run", str(EXAMPLES / study), "--out", name)
        for study, name in (("finger.yaml", "runs/first-finger"), ("loaded.yaml", "runs/loaded-finger"))
    ]
    return seconds(*runs, cwd=folder)


def measured(folder: Path) -> tuple[float, dict[str, float]]:
    """Return smallest seconds of `import numpy`, and of each case."""
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


@dataclass(frozen=True, eq=False)
class Mistake:
    """A command with a mistake.

    Attributes:
        name: in words.
        command: arguments of `pliant`.
        said: text that the answer must contain: the remedy, or the requested value.
        files: contents of the folder, by name.
        code: the exit code; 0 if the file is read with a warning.
    """

    name: str
    command: tuple[str, ...]
    said: str
    files: Mapping[str, str | bytes]
    code: int = 2


def _with_data(text: str | bytes, name: str = "bench.csv") -> dict[str, str | bytes]:
    return {"joint.yaml": f"{STUDY}{TAIL}measurements: {{file: {name}}}\n", name: text}


def _study(text: str) -> dict[str, str | bytes]:
    return {"joint.yaml": text}


COMPARE = ("compare", "joint.yaml")
DEGREES = "\n".join(f"{k / 10:.1f},{500 * k},{k}" for k in range(30))
HOLDS = "\n".join(f"{k / 10:.1f},{15000 * (k > 5)},{0.36 * (1 - 0.9**k):.4f}" for k in range(60))
MISTAKES = (
    Mistake("a command misspelt", ("comprae", "joint.yaml"), "compare", _study(STUDY + TAIL)),
    Mistake(
        "a kind misspelt", COMPARE, "did you mean 'quasistatic'", _study(STUDY + "physics: quasistatik\n")
    ),
    Mistake(
        "a key misspelt",
        COMPARE,
        "did you mean 'module_length'",
        _study(STUDY.replace("module_length", "modul_length") + TAIL),
    ),
    Mistake("a unit of another kind", COMPARE, "kPa", _study(STUDY.replace("11 mm", "11 kPa") + TAIL)),
    Mistake("no measurements", COMPARE, "--data", _study(STUDY + TAIL)),
    Mistake(
        "an effect misspelt",
        ("diagnose", "joint.yaml", "--effect", "viscoelastik"),
        "did you mean 'viscoelastic'",
        _with_data(f"{COLUMNS}\n{READINGS}\n"),
    ),
    Mistake(
        "a column misspelt",
        COMPARE,
        '"angel_deg": angle_deg',
        _with_data(f"time_s,pressure_pa,angel_deg\n{READINGS}\n"),
    ),
    Mistake("no header", COMPARE, "header", _with_data(f"{READINGS}\n")),
    Mistake(
        "decimal commas between commas",
        COMPARE,
        "semicolons",
        _with_data(f"{COLUMNS}\n" + "\n".join(f"0,{k},{k}00,0,0{k}" for k in range(1, 9))),
    ),
    Mistake(
        "an old spreadsheet", COMPARE, ".xlsx", _with_data(b"\xd0\xcf\x11\xe0" + bytes(600), "bench.xls")
    ),
    Mistake(
        "degrees called radians",
        ("import", "bench.csv"),
        "angle_rad: deg",
        _with_data(f"{COLUMNS}\n{DEGREES}\n"),
        code=0,
    ),
    Mistake(
        "a moving recording as a free curve",
        ("calibrate", "joint.yaml", "--data", "bench.csv"),
        "rest",
        _with_data(f"{COLUMNS}\n{HOLDS}\n"),
    ),
)


def made(mistake: Mistake, folder: Path, environment: Mapping[str, str]) -> tuple[float, str]:
    """Run a mistaken command; return CPU seconds and its message. Raises `SystemExit` for an unexpected message."""
    folder.mkdir(exist_ok=True)
    for name, content in mistake.files.items():
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    took, done = cpu_seconds((sys.executable, "-m", "pliant", *mistake.command), folder, environment)
    answer = done.stderr if mistake.code else done.stdout
    if done.returncode != mistake.code or mistake.said not in answer or "Traceback" in done.stderr:
        raise SystemExit(
            f"{mistake.name}: ended with {done.returncode} and without '{mistake.said}':\n{answer}"
        )
    return took, " ".join(answer.split())


def cpu_seconds(
    command: tuple[str, ...], folder: Path, environment: Mapping[str, str]
) -> tuple[float, subprocess.CompletedProcess[str]]:
    """Return CPU time of a child process, user and system, and its result; its environment is that given."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        command, cwd=folder, env=dict(environment), capture_output=True, text=True, check=False
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime, done


def mistakes(folder: Path, environment: Mapping[str, str], turns: int) -> bool:
    """Print every mistake with its time and its answer; whether one is above the limit."""
    numpy = (sys.executable, "-c", "import numpy")
    base, late = min(cpu_seconds(numpy, folder, environment)[0] for _ in range(turns + 1)), False
    print(f"{'python -c import numpy':<36} {base:6.3f} s of CPU", flush=True)
    for number, mistake in enumerate(MISTAKES):
        # of the first few the first compiles
        tries = [made(mistake, folder / f"mistake_{number}", environment) for _ in range(turns)]
        took, answer = min(tries)
        late |= took > MISTAKE_LIMIT_S
        over = "above" if took > MISTAKE_LIMIT_S else "within"
        print(f"{mistake.name:<36} {took:6.3f} s {took / base:6.1f} ×   {over} {MISTAKE_LIMIT_S:g} s")
        print(f"    {answer[:MOST_SHOWN]}", flush=True)
    return late


def main() -> None:
    """Print the figures; exit code 1 where one is above its limit."""
    with tempfile.TemporaryDirectory() as folder:
        if "--mistakes" in sys.argv[1:]:
            raise SystemExit(1 if mistakes(Path(folder), compiled(Path(folder)), TURNS) else 0)
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
