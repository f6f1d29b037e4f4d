"""Journal of a search on disk: each reported generation as one JSON line, and the optimizer's state at intervals.

A line is written before the optimizer's `tell`, so that evaluations survive the end of the process. Lines are synced
to the disk once a second, which is what a machine that stops may lose. A truncated line is dropped. The state only
saves time: without it the search is replayed from the first line by ask and tell, without evaluations.
"""

from __future__ import annotations

import json
import os
import shutil
import time
import uuid
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from io import BufferedWriter
from pathlib import Path
from typing import Any

from pliant.store.store import write_atomically, writing_in
from pliant_search.optimizer import PROPOSED, Trial

# Fields of a trial in a line; the order is that of the first version.
KEPT = (
    *("number", "context", "values", "state", "objectives", "violation", "cause", "metrics", "conditions"),
    *("scenarios", "simulations", "wall_s"),
)
LINES, STATE = ".jsonl", ".state.json"
SYNC_EVERY_S = 1.0


@dataclass(frozen=True)
class Generation:
    """The trials of one `ask` of an optimizer and one `tell`.

    Attributes:
        asked: number of trials that the optimizer was asked for.
        size: its own batch size at that time; `asked` is smaller at the end of the budget.
        trials: sorted by number.
        wall_s: wall time of the search until all were evaluated, summed over sessions.
    """

    asked: int
    size: int
    trials: tuple[Trial, ...]
    wall_s: float = 0.0

    @property
    def open(self) -> tuple[Trial, ...]:
        """Trials that are not evaluated yet."""
        return tuple(trial for trial in self.trials if trial.state == PROPOSED)

    def line(self) -> str:
        """Return the generation as one line of JSON; NaN is written as NaN."""
        rows = [[getattr(trial, name) for name in KEPT] for trial in self.trials]
        plain = {"asked": self.asked, "size": self.size, "wall_s": self.wall_s, "rows": rows}
        return json.dumps(plain, separators=(",", ":"), default=_plain) + "\n"

    @classmethod
    def from_line(cls, line: bytes) -> Generation:
        """Parse a line that `line` wrote."""
        plain = json.loads(line)
        rows = [dict(zip(KEPT, row, strict=True)) for row in plain["rows"]]
        trials = tuple(
            Trial(**{**row, "objectives": tuple(row["objectives"]), "scenarios": tuple(row["scenarios"])})
            for row in rows
        )
        return cls(int(plain["asked"]), int(plain["size"]), trials, float(plain["wall_s"]))


def _plain(value: Any) -> Any:
    """Convert mappings and NumPy numbers to JSON values."""
    return dict(value) if isinstance(value, Mapping) else value.item()


class Journal:
    """The journal of one branch: `<name>.jsonl` and `<name>.state.json` in a folder."""

    def __init__(self, folder: Path, name: str) -> None:
        self._folder = folder
        self._lines, self._state = folder / f"{name}{LINES}", folder / f"{name}{STATE}"
        self._synced = time.monotonic()

    def read(self) -> list[Generation]:
        """Return the generations of all complete lines; truncate the file at a damaged line."""
        self._synced = time.monotonic()
        generations: list[Generation] = []
        good = 0
        for line in self._whole_lines():
            try:
                generations.append(Generation.from_line(line))
            except (ValueError, KeyError, TypeError):
                break
            good += len(line)
        if self._lines.exists() and self._lines.stat().st_size > good:
            self._cut(good)
        return generations

    def keep(self, batches: int) -> None:
        """Delete all but the first batches."""
        self._cut(sum(len(line) for _, line in zip(range(batches), self._whole_lines(), strict=False)))

    def append(self, generation: Generation) -> None:
        """Write a generation; sync to the disk at intervals."""
        with writing_in(self._folder), self._lines.open("ab") as file:
            file.write(generation.line().encode())
            if time.monotonic() - self._synced >= SYNC_EVERY_S:
                self._sync(file)

    def sync(self) -> None:
        """Sync the written lines to the disk."""
        if self._lines.exists():
            with writing_in(self._folder), self._lines.open("ab") as file:
                self._sync(file)

    def _sync(self, file: BufferedWriter) -> None:
        file.flush()
        os.fsync(file.fileno())
        self._synced = time.monotonic()

    def snapshot(self) -> tuple[int, Mapping[str, Any]] | None:
        """Return the number of batches before the optimizer's saved state, and the state; None if unreadable."""
        try:
            plain = json.loads(self._state.read_text(encoding="utf-8"))
            return int(plain["batches"]), dict(plain["state"])
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def save(self, batches: int, state: Mapping[str, Any]) -> None:
        """Replace the optimizer's state atomically."""
        text = json.dumps({"batches": batches, "state": state})
        with writing_in(self._folder):
            write_atomically(self._state, text)

    def forget_snapshot(self) -> None:
        """Delete the snapshot, so that the search is replayed from the first line."""
        self._state.unlink(missing_ok=True)

    def clear(self) -> None:
        """Delete every line and the snapshot."""
        self._lines.unlink(missing_ok=True)
        self.forget_snapshot()

    def _whole_lines(self) -> Iterator[bytes]:
        if self._lines.exists():
            with self._lines.open("rb") as file:
                yield from (line for line in file if line.endswith(b"\n"))

    def _cut(self, size: int) -> None:
        if self._lines.exists():
            with writing_in(self._folder):
                os.truncate(self._lines, size)


def keep_journals(partial: Path, kept: Path) -> None:
    """Keep a finished search's journals for a search with a larger budget; failures are ignored."""
    temporary = kept.with_name(f".writing-{kept.name}-{uuid.uuid4().hex}")
    try:
        temporary.mkdir(parents=True)
        for file in _journals(partial):
            shutil.copy2(file, temporary / file.name)
        shutil.rmtree(kept, ignore_errors=True)
        temporary.rename(kept)
    except OSError:
        shutil.rmtree(temporary, ignore_errors=True)


def take_journals(kept: Path, partial: Path) -> bool:
    """Copy kept journals into the folder of a search that has no journals; return whether there were any."""
    if not kept.is_dir() or any(_journals(partial)):
        return False
    files = _journals(kept)
    try:
        for file in files:
            shutil.copy2(file, partial / file.name)
    except OSError:
        return False
    return bool(files)


def _journals(folder: Path) -> list[Path]:
    return sorted(file for file in folder.iterdir() if file.name.endswith((LINES, STATE)))
