"""What both studies take on the command line, and how they end."""

from __future__ import annotations

import argparse
import importlib
import json
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.studies.page import DOCS, publish, require_main
from benchmarks.studies.parts import Parts, published_parts

from benchmarks import output
from pliant.errors import INTERRUPTED, PliantError, UserError
from pliant.store.store import write_atomically

OUT = output.OUT / "studies"
STORES = output.ROOT / ".pliant" / "studies"


@dataclass(frozen=True)
class Given:
    """What was asked for.

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
        """Of the parts."""
        return self.out / (f"{self.name}_small" if self.small else self.name)

    def parts(self, main: str) -> Parts:
        """Those that are finished; `main`: the search that the published result is of."""
        docs = {} if self.small else published_parts(self.docs / f"{self.name}.json", main)
        return Parts(self.folder, self.fresh, docs)

    def store_of(self, part: str) -> Path:
        """A store for each part: one that goes on from the candidates of another would not tell its own time."""
        return self.store / self.folder.name / part

    def wants(self, part: str) -> bool:
        """Whether a part is to be run."""
        return not self.only or part in self.only

    def stated(self) -> dict[str, Any]:
        """What a result says of how it was asked for."""
        return {"small": self.small, "overrides": list(self.overrides)}

    def write(self, result: dict[str, Any]) -> None:
        """The result beside the parts."""
        self.out.mkdir(parents=True, exist_ok=True)
        target = self.folder.with_suffix(".json")
        write_atomically(target, json.dumps(result, indent=1, allow_nan=False) + "\n")
        print(f"result   {target}")


def arguments(parser: argparse.ArgumentParser, names: Sequence[str]) -> argparse.ArgumentParser:
    """The options of both studies."""
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


def given_of(found: argparse.Namespace, name: str) -> Given:
    """The options as a record.

    Raises:
        UserError: options that exclude each other, or numbers that mean nothing.
    """
    if found.small and found.publish:
        raise UserError("--small is no study to publish; leave out one of --small and --publish.")
    seeds, grasps = getattr(found, "seeds", None), getattr(found, "seed_grasps", None)
    for option, value in (("--workers", found.workers), ("--seeds", seeds), ("--seed-grasps", grasps)):
        if value is not None and value < (0 if option == "--seeds" else 1):
            raise UserError(
                f"{option} is {value}; give a number of at least {0 if option == '--seeds' else 1}."
            )
    return Given(
        name, found.small, tuple(found.only), found.workers, found.publish, found.fresh, found.quiet, found.out,
        found.store, DOCS, tuple(found.overrides), seeds, grasps,
    )  # fmt: skip


def run_command(work: Callable[[], Any]) -> int:
    """The exit code: one message for a mistake, none for success."""
    try:
        work()
    except PliantError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print("interrupted; finished work is kept, run the same command to go on.", file=sys.stderr)
        return INTERRUPTED
    return 0


def conclude(given: Given, result: dict[str, Any], told: Iterable[str], main: str, page: str) -> None:
    """Print the lines, write the result, and publish it where that is asked for.

    Args:
        given: what was asked for.
        result: of the study.
        told: lines for people.
        main: the search without which nothing is published.
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
