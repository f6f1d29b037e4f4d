"""The split of the five benches by names (`splits.yaml`), as files and notes for either part."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal

from benchmarks.real import recordings
from ruamel.yaml import YAML

from pliant.units import parse_quantity

FILE = Path(__file__).with_name("splits.yaml")
Part = Literal["train", "judge"]
HEADER_LINES = 1
EARLIER_S = 1e-6  # an instant belongs to the part that it begins


@dataclass(frozen=True)
class Stretch:
    """A run, or a stretch of it: from an instant (s, or a row where there is no clock) and until before another one."""

    run: str
    start: float | None = None
    end: float | None = None
    rows: bool = False

    def excluded(self) -> list[dict[str, Any]]:
        """Return the notes' spans of what does not belong to it."""
        if self.rows:
            first = HEADER_LINES + 1
            spans: list[dict[str, Any]] = []
            spans += [{"lines": [first, first + int(self.start) - 1]}] if self.start else []
            return self._named(spans + ([{"lines": [first + int(self.end), 10**6]}] if self.end else []))
        spans = [{"end": f"{self.start - EARLIER_S:.9g} s"}] if self.start else []
        return self._named(spans + ([{"start": f"{self.end:.9g} s"}] if self.end else []))

    def _named(self, spans: list[dict[str, Any]]) -> list[dict[str, Any]]:
        return [{"run": self.run, **span} for span in spans]


@cache
def _table() -> Mapping[str, Any]:
    return dict(YAML(typ="safe").load(FILE))


def draws() -> dict[str, tuple[list[list[str]], list[int]]]:
    """Return the groups of names of each bench that was drawn, and how many of each group judge."""
    drawn = {bench: split["draw"] for bench, split in _table().items() if "draw" in split}
    return {bench: (draw["groups"], draw["each"]) for bench, draw in drawn.items()}


def stretches(bench: str, part: Part) -> tuple[Stretch, ...]:
    """Return the runs of a part of a bench."""
    return tuple(_stretch(entry) for entry in _table()[bench][part])


def _stretch(entry: str | Mapping[str, Any]) -> Stretch:
    if isinstance(entry, str):
        return Stretch(entry)
    ends = [entry.get(key) for key in ("from", "until")]
    rows = all(isinstance(end, int) for end in ends if end is not None)
    numbers = [None if e is None else float(e) if rows else parse_quantity(e, "s") for e in ends]
    return Stretch(str(entry["run"]), numbers[0], numbers[1], rows)


def files(bench: str, part: Part, only: str = "") -> list[Path]:
    """Return the files of a part, of those whose names begin with `only`."""
    runs = [one.run for one in stretches(bench, part) if one.run.startswith(only)]
    return [recordings.MEASURED / bench / f"{run}.csv" for run in runs]


def block(bench: str, part: Part, notes: Mapping[str, Any], only: str = "") -> dict[str, Any]:
    """Return the `measurements` block that reads a part of a bench.

    Args:
        bench, part: which.
        notes: information that the files lack; entries of runs that are not in the part are left out.
        only: how the names of its files begin.
    """
    chosen = [one for one in stretches(bench, part) if one.run.startswith(only)]
    names = {one.run for one in chosen}
    spans = [span for one in chosen for span in one.excluded()]
    said = {
        key: {run: value for run, value in entry.items() if run in names}
        if key in ("runs", "let_go")
        else entry
        for key, entry in notes.items()
    }
    found = {"file": [str(path) for path in files(bench, part, only)], **said}
    return {**found, "exclude": spans} if spans else found
