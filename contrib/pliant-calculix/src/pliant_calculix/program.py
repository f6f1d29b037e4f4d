"""Runs `ccx` on a deck in a separate folder and reads its output."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pliant.errors import MissingDependencyError
from pliant.records.design import Array

JOB = "deck"
HEADER = re.compile(r"^\s*(displacements|forces) \(.*\) for set (\S+) and time\s+(\S+)\s*$", re.IGNORECASE)


class RunFailedError(ArithmeticError):
    """The program did not reach every point; the message is its last output."""


@dataclass(frozen=True, eq=False)
class Answer:
    """Displacements (mm) and internal nodal forces at one point, (n, 3), zero where not printed."""

    displacement: Array
    force: Array


@dataclass(frozen=True, eq=False)
class Answers:
    """One answer for each point of the path, and the iterations of the run."""

    points: tuple[Answer, ...]
    iterations: int


def find(program: str) -> str:
    """Return the path of the program. Raises `MissingDependencyError`."""
    path = shutil.which(program)
    if path is None:
        raise MissingDependencyError(
            f"fem 'calculix' needs the program {program}: apt install calculix-ccx (the deck alone can be "
            "written with 'pliant-calculix-deck STUDY.yaml --pressure … --angle … --out FILE.inp')."
        )
    return path


def run(
    program: str, deck: Sequence[str], points: int, nodes: int, timeout_s: float, keep: Path | None = None
) -> Answers:
    """Solve a deck whose one step passes `points` points of a path, and whose node numbers do not exceed `nodes`.

    Raises `RunFailedError`, and `MissingDependencyError` where the program is missing.
    """
    path = find(program)
    with _folder(keep) as folder:
        (folder / f"{JOB}.inp").write_text("\n".join(deck) + "\n")
        try:
            done = subprocess.run(
                [path, "-i", JOB],
                cwd=folder,
                env={"OMP_NUM_THREADS": "1", **os.environ},
                capture_output=True,
                text=True,
                errors="replace",
                timeout=timeout_s,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise RunFailedError(f"{program} was stopped after {timeout_s:g} s (key 'timeout')") from None
        (folder / f"{JOB}.log").write_text(done.stdout + done.stderr)
        found = read_answers(folder / f"{JOB}.dat", nodes)
        iterations = _iterations(folder / f"{JOB}.sta")
    if done.returncode != 0 or len(found) < points:
        raise RunFailedError(f"{program} reached {len(found)} of {points} points: {_last_words(done.stdout)}")
    return Answers(tuple(found[:points]), iterations)


def read_answers(file: Path, nodes: int) -> list[Answer]:
    """Return the answers of a `.dat` file at the times 1, 2, …."""
    if not file.exists():
        return []
    tables: dict[float, dict[str, Array]] = {}
    current: Array | None = None
    for line in file.read_text().splitlines():
        if head := HEADER.match(line):
            at = tables.setdefault(float(head[3]), {})
            current = at.setdefault(head[1].lower(), np.zeros((nodes, 3)))
        elif current is not None and (words := line.split()):
            current[int(words[0]) - 1] = [float(w) for w in words[1:4]]
    ends = [time for time in sorted(tables) if abs(time - round(time)) < 1e-6]
    return [Answer(t["displacements"], t["forces"]) for end in ends if len(t := tables[end]) == 2]


@contextmanager
def _folder(keep: Path | None) -> Iterator[Path]:
    """Provide a folder for one run: temporary, or a new one in `keep`."""
    if keep is None:
        with tempfile.TemporaryDirectory(prefix="pliant-calculix-") as name:
            yield Path(name)
        return
    keep.mkdir(parents=True, exist_ok=True)
    yield Path(tempfile.mkdtemp(prefix="state-", dir=keep))


def _iterations(file: Path) -> int:
    """Return Newton iterations of all attempts, from a `.sta` file."""
    rows = [line.split() for line in file.read_text().splitlines()] if file.exists() else []
    return sum(int(row[3]) for row in rows if len(row) == 7 and row[0].isdigit())


def _last_words(output: str) -> str:
    """Return the program's last error, or its last sentence."""
    lines = [" ".join(line.split()) for line in output.splitlines() if line.strip()]
    errors = [k for k, line in enumerate(lines) if "*ERROR" in line]
    if errors:
        return " ".join(lines[errors[-1] : errors[-1] + 2]).replace("*ERROR", "error").strip()
    return lines[-1] if lines else "it said nothing"
