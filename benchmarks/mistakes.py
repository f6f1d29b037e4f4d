"""Twelve typical mistakes at the command line: what each costs and what is answered.

    python -m benchmarks.startup --mistakes

Each is made several times, as is `import numpy`; times are CPU seconds (user and system) of the child process,
which a busy machine does not stretch much, and the smallest of each is kept.
"""

from __future__ import annotations

import resource
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

LIMIT_S = 1.5
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


@dataclass(frozen=True, eq=False)
class Mistake:
    """A command that is wrong.

    Attributes:
        name: in words.
        command: arguments of `pliant`.
        said: what the answer must hold: the remedy, or what is asked for.
        files: what lies in the folder, by name.
        code: the exit code; 0 where the file is read and the doubt is said.
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
    """Make a mistake; CPU seconds and what was answered. Raises `SystemExit` where that is not what it should be."""
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
    """CPU time of a child process, user and system, and what became of it; the environment is all that it has."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        command, cwd=folder, env=dict(environment), capture_output=True, text=True, check=False
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime, done


def table(folder: Path, environment: Mapping[str, str], turns: int) -> bool:
    """Print every mistake with its time and its answer; whether one is above the limit."""
    numpy = (sys.executable, "-c", "import numpy")
    base, late = min(cpu_seconds(numpy, folder, environment)[0] for _ in range(turns + 1)), False
    print(f"{'python -c import numpy':<36} {base:6.3f} s of CPU", flush=True)
    for number, mistake in enumerate(MISTAKES):
        # of the first few the first compiles
        tries = [made(mistake, folder / f"mistake_{number}", environment) for _ in range(turns)]
        took, answer = min(tries)
        late |= took > LIMIT_S
        over = "above" if took > LIMIT_S else "within"
        print(f"{mistake.name:<36} {took:6.3f} s {took / base:6.1f} ×   {over} {LIMIT_S:g} s")
        print(f"    {answer[:MOST_SHOWN]}", flush=True)
    return late
