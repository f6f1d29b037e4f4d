"""One search of a study as a part: the `optimize` result, timed beside the reference kernel."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.output import machine, seconds_of
from rich.console import Console

from pliant import __version__, api
from pliant.cli.bars import TerminalProgress
from pliant.cli.session import plain
from pliant.errors import NotReachedError
from pliant.pipeline.study import DEFAULT_PHYSICS
from pliant.records.search import STATUSES, SearchResult
from pliant.report.search_files import search_json
from pliant.search.run.search import nothing_found
from pliant.search.stage import search_study

# The reference kernel: a fixed piece of numpy work, to compare times of different machines.
SIZE, SOLVES, ROUNDS = 400, 50, 5
KERNEL = f"{SOLVES} solutions of a dense linear system of {SIZE} unknowns by numpy, one thread"
MOST_ROWS, MOST_POINTS = 300, 40
DIGITS = 6


@dataclass(frozen=True)
class Asked:
    """A search to be made: its name and words, the study's file, changes to it as on the command line."""

    name: str
    words: str
    file: Path
    overrides: tuple[str, ...] = ()

    def opened(self, store: Path, more: Sequence[str] = (), quiet: bool = False) -> api.OpenStudy:
        """The study; raises `UserError` where it is wrong."""
        progress = TerminalProgress(Console(stderr=True, highlight=False), quiet)
        return api.open_study(self.file, [*self.overrides, *more], store=store, progress=progress)


def searched(asked: Asked, opened: api.OpenStudy, workers: int | None) -> tuple[dict[str, Any], SearchResult]:
    """Search and check; the result as JSON, and as the record.

    Raises:
        UserError: the study cannot be searched.
        NotReachedError: nothing feasible was found.
    """
    here, before = machine(), kernel_s()
    begun = time.perf_counter()
    made = search_study(opened.bench, opened.study, workers=workers)
    whole_s = time.perf_counter() - begun
    result: SearchResult = made.value
    if not result.best:
        error: NotReachedError = nothing_found(result)
        raise error
    kernel = min(before, kernel_s())
    found = {
        "pliant": __version__,
        "command": "optimize",
        "study": opened.study.name,
        "words": asked.words,
        **search_json(result, engine_of(opened)),
        "engine": engine_of(opened),
        "history": history_rows(result),
        "machine": here,
        "workers": workers,
        "reference_kernel": KERNEL,
        "reference_kernel_s": kernel,
        "wall_in_kernels": result.wall_s / kernel,
        "whole_wall_s": whole_s,
        # Then it was searched in an earlier session, and the kernel was timed in this one.
        "from_store": made.cached,
    }
    return plain(found), result


def kernel_s() -> float:
    """Seconds of `KERNEL`, the fastest of a few rounds."""
    random = np.random.default_rng(0)
    matrix = random.random((SIZE, SIZE)) + SIZE * np.eye(SIZE)
    right = random.random(SIZE)
    return min(
        seconds_of(lambda: [np.linalg.solve(matrix, right) for _ in range(SOLVES)], ROUNDS, time.perf_counter)
    )


def engine_of(opened: api.OpenStudy) -> str:
    """The study's own engine."""
    return opened.study.physics.kind if opened.study.physics is not None else DEFAULT_PHYSICS


def history_rows(result: SearchResult) -> list[dict[str, Any]]:
    """Evenly spread candidates: row, branch, context, status, objective and the best so far, as stated."""
    history, sign = result.history, -1.0 if result.maximised[0] else 1.0
    best = history.best_so_far()
    return [
        {
            "row": int(row),
            "branch": int(history.branch[row]),
            "context": int(history.context[row]),
            "status": STATUSES[int(history.status[row])],
            "objective": sign * float(history.objectives[row, 0]),
            "best": sign * float(best[row]),
        }
        for row in spread(len(history), MOST_ROWS)
    ]


def spread(count: int, most: int) -> list[int]:
    """Indices 0 … count − 1, of many the evenly spread ones with both ends."""
    return (
        [int(k) for k in np.unique(np.linspace(0, count - 1, min(count, most)).astype(int))] if count else []
    )


def brief(values: Any) -> Any:
    """Numbers with six digits, in lists of any depth: files of docs are small."""
    if isinstance(values, float | np.floating):
        return float(f"{float(values):.{DIGITS}g}") if np.isfinite(values) else None
    if isinstance(values, list | tuple | np.ndarray):
        return [brief(value) for value in values]
    return values
