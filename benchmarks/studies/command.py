"""Functions shared by both studies: options, finished parts stored as JSON for continuation, and conclusion.

A study takes hours and may be run in several calls or on several checkouts: published results replace a part that this
checkout lacks, provided that they are of the same study. Requested parts are always run.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib
import json
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.output import machine, time_calls
from benchmarks.studies.page import DOCS, publish, require_main
from rich.console import Console

from benchmarks import output
from pliant import __version__, api
from pliant.cli.bars import TerminalProgress
from pliant.cli.session import plain
from pliant.config.study import Study
from pliant.errors import INTERRUPTED, NotReachedError, PliantError, UserError
from pliant.pipeline.study import DEFAULT_PHYSICS
from pliant.pipeline.workbench import content
from pliant.store.store import write_atomically
from pliant_search.records import STATUSES, SearchResult
from pliant_search.report.folder import search_json
from pliant_search.run.search import nothing_found
from pliant_search.stage import search_study

Part = dict[str, Any]
# Entries of a result other than its main search.
AROUND = ("small", "asked", "overrides", "published", "runs", "baseline", "seeds", "bars")


@dataclass(frozen=True)
class Parts:
    """The parts of a folder.

    Attributes:
        folder: of NAME.json.
        fresh: whether existing parts are recomputed.
        published: parts in docs that a page needs.
    """

    folder: Path
    fresh: bool = False
    published: Mapping[str, Part] = field(default_factory=dict)

    def find(self, name: str, of: str) -> Part | None:
        """Return a finished part, or None if it is missing, or was made of something else than `of`."""
        try:
            part: Part = json.loads((self.folder / f"{name}.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        return part if part.get("made_of") == of else None

    def known(self, name: str, of: str) -> Part | None:
        """Return a finished part, or else the published one; None if neither is of the same study."""
        docs = self.published.get(name, {})
        return self.find(name, of) or (docs if docs.get("made_of") == of else None)

    def get(self, name: str, of: str, make: Callable[[], Mapping[str, Any]]) -> Part:
        """Return a finished part, made if it is missing."""
        found = None if self.fresh else self.find(name, of)
        if found is not None:
            return found
        self.folder.mkdir(parents=True, exist_ok=True)
        made = {"made_of": of, **plain(make())}
        write_atomically(self.folder / f"{name}.json", json.dumps(made, indent=1, allow_nan=False) + "\n")
        return self.find(name, of) or made


def published_parts(file: Path, main: str) -> dict[str, Part]:
    """Return part → the entries of a published result; empty if there is no such file.

    Args:
        file: NAME.json of docs.
        main: the search that the result is of: of it everything is kept.
    """
    try:
        result = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    parts: dict[str, Part] = dict(result["runs"])
    if main in parts:
        whole = {key: value for key, value in result.items() if key not in AROUND}
        parts[main] = {**whole, **parts[main]}
    over_seeds = [part for own in result.get("seeds", {}).values() for part in own]
    others = [result.get("baseline") or {}, *over_seeds]
    return parts | {part["part"]: part for part in others if part}


def study_digest(study: Study) -> str:
    """Return a digest of the study with files by content: a part with another digest is out of date."""
    return hashlib.sha256(json.dumps(content(study), sort_keys=True).encode()).hexdigest()[:32]


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
        """Return the study; raise `UserError` if it is wrong."""
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
    made = search_study(opened.context, opened.study, workers=workers)
    whole_s = time.perf_counter() - begun
    result: SearchResult = made.value
    if not result.best:
        error: NotReachedError = nothing_found(result)
        raise error
    kernel = min(before, kernel_s())
    physics = opened.study.physics
    engine = physics.kind if physics is not None else DEFAULT_PHYSICS
    found = {
        "pliant": __version__,
        "command": "optimize",
        "study": opened.study.name,
        "words": asked.words,
        **_published(search_json(result, engine)),
        "engine": engine,
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


def _published(found: dict[str, Any]) -> dict[str, Any]:
    """Return the result without the places of files in the store."""
    rounds = [{name: value for name, value in one.items() if name != "table"} for one in found["rounds"]]
    return {**found, "rounds": rounds}


def kernel_s() -> float:
    """Return seconds of `KERNEL`, the fastest of a few rounds."""
    random = np.random.default_rng(0)
    matrix = random.random((SIZE, SIZE)) + SIZE * np.eye(SIZE)
    right = random.random(SIZE)

    def solves() -> None:
        for _ in range(SOLVES):
            np.linalg.solve(matrix, right)

    return min(time_calls(solves, ROUNDS, time.perf_counter))


def history_rows(result: SearchResult) -> list[dict[str, Any]]:
    """Return evenly spread candidates: row, branch, context, status, objective and best so far, as stated."""
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
    """Return indices 0 … count − 1, evenly spread with both ends if there are many."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(int)).tolist() if count else []


def brief(values: Any) -> Any:
    """Return numbers with six digits, in lists of any depth, to keep files of docs small."""
    if isinstance(values, float | np.floating):
        return float(f"{float(values):.{DIGITS}g}") if np.isfinite(values) else None
    if isinstance(values, list | tuple | np.ndarray):
        return [brief(value) for value in values]
    return values


OUT = output.OUT / "studies"
STORES = output.ROOT / ".pliant" / "studies"


@dataclass(frozen=True)
class Given:
    """The command's options.

    Attributes:
        name: of the study.
        small: tiny budgets; docs are never written.
        only: parts that are run; () means all.
        workers: processes that evaluate; None: one for each CPU.
        publish: whether docs are written.
        fresh: whether finished parts are made again (their searches may come from the store).
        quiet: no progress.
        out, store, docs: folders; `store` of the artifact stores.
        overrides: changes of every study, "key=value".
        seeds, seed_grasps: of the table over seeds; grasps None: as many as the main search has.
    """

    name: str
    small: bool = False
    only: tuple[str, ...] = ()
    workers: int | None = None
    publish: bool = False
    fresh: bool = False
    quiet: bool = False
    out: Path = OUT
    store: Path = STORES
    docs: Path = DOCS
    overrides: tuple[str, ...] = field(default_factory=tuple)
    seeds: int | None = None
    seed_grasps: int | None = None

    @property
    def folder(self) -> Path:
        """Folder of the study's finished parts."""
        return self.out / (f"{self.name}_small" if self.small else self.name)

    def parts(self, main: str) -> Parts:
        """Return the finished parts; `main`: the search of the published result."""
        docs = {} if self.small else published_parts(self.docs / f"{self.name}.json", main)
        return Parts(self.folder, self.fresh, docs)

    def part_store(self, part: str) -> Path:
        """Return a separate store for each part, so that the time of a part includes all its candidates."""
        return self.store / self.folder.name / part

    def wants(self, part: str) -> bool:
        """Return whether a part is to be run."""
        return not self.only or part in self.only

    def part(
        self, parts: Parts, name: str, study: Study, make: Callable[[], Mapping[str, Any]]
    ) -> Part | None:
        """Return a part of a study; existing results only if it was not requested."""
        of = study_digest(study)
        return parts.get(name, of, make) if self.wants(name) else parts.known(name, of)

    def stated(self) -> dict[str, Any]:
        """Return the options that a result states."""
        return {"small": self.small, "overrides": list(self.overrides)}

    def write(self, result: dict[str, Any]) -> None:
        """Write the result next to the folder of the parts."""
        self.out.mkdir(parents=True, exist_ok=True)
        target = self.folder.with_suffix(".json")
        write_atomically(target, json.dumps(result, indent=1, allow_nan=False) + "\n")
        print(f"result   {target}")


def arguments(parser: argparse.ArgumentParser, names: Sequence[str]) -> argparse.ArgumentParser:
    """Return the options of both studies."""
    parser.add_argument("overrides", nargs="*", metavar="KEY=VALUE", help="changes of every study")
    parser.add_argument("--small", action="store_true", help="tiny budgets, for CI; docs are not touched")
    parser.add_argument("--only", action="append", choices=names, default=[], help="run only this part")
    parser.add_argument("--workers", type=int, help="processes that evaluate; by default one for each CPU")
    parser.add_argument(
        "--publish", action="store_true", help="write the result, its page and pictures to docs"
    )
    parser.add_argument("--fresh", action="store_true", help="make finished parts again")
    parser.add_argument("--quiet", action="store_true", help="no progress")
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the results")
    parser.add_argument("--store", type=Path, default=STORES, help="folder of their artifact stores")
    return parser


def given_from_options(found: argparse.Namespace, name: str) -> Given:
    """Return the options as a record.

    Raises:
        UserError: options that exclude each other, or invalid numbers.
    """
    if found.small and found.publish:
        raise UserError("--small is no study to publish; leave out one of --small and --publish.")
    seeds, grasps = getattr(found, "seeds", None), getattr(found, "seed_grasps", None)
    counts = (("--workers", found.workers, 1), ("--seeds", seeds, 0), ("--seed-grasps", grasps, 1))
    for option, value, least in counts:
        if value is not None and value < least:
            raise UserError(f"{option} is {value}; give a number of at least {least}.")
    lists = {"only": tuple(found.only), "overrides": tuple(found.overrides)}
    return Given(name, **{**vars(found), **lists})


def run_command(work: Callable[[], Any]) -> int:
    """Return the exit code: one message for a mistake, none for success."""
    try:
        work()
    except PliantError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print("interrupted; finished work is kept, run the same command to continue.", file=sys.stderr)
        return INTERRUPTED
    return 0


def conclude(given: Given, result: dict[str, Any], told: Iterable[str], main: str, page: str) -> None:
    """Print the lines, write the result, and publish it if requested.

    Args:
        given: the command's options.
        result: of the study.
        told: lines to print.
        main: the search that is required for publication.
        page: module with the TABLES and PICTURES of the study's page.

    Raises:
        UserError: the main search is missing.
    """
    for line in told:
        print(line)
    given.write(result)
    if given.publish:
        require_main(result, main)
        drawn = importlib.import_module(page)  # matplotlib takes a second to import
        for path in publish(given.name, drawn.TABLES, drawn.PICTURES, result, given.docs):
            print(f"written  {path}")
