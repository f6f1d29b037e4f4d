"""A search on disk: every batch that was told, one JSON line each, and now and then the optimizer's state.

A line is handed to the system before the optimizer is told, so that whatever ends the process, what was evaluated is
known; down to the disk it goes once a second, which is what a machine that stops may lose. A line that was cut off is
dropped. The state only saves time: without it the search is repeated from the first line, asking and telling without
evaluating.
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

from pliant.search.outcome import Told
from pliant.store.store import write_atomically, writing_in

LINES, STATE = ".jsonl", ".state.json"
SYNC_EVERY_S = 1.0


@dataclass(frozen=True)
class Batch:
    """What was told at once.

    Attributes:
        asked: how many candidates the optimizer was asked for.
        size: its own batch then; `asked` is smaller where the budget ended.
        wall_s: of the search until then, all sessions together.
        rows: sorted by number.
    """

    asked: int
    size: int
    wall_s: float
    rows: tuple[Told, ...]

    @property
    def evaluated(self) -> int:
        """Candidates that were simulated."""
        return sum(row.simulated for row in self.rows)

    def line(self) -> str:
        """One line of JSON; NaN is written as such."""
        rows = [row.as_list() for row in self.rows]
        plain = {"asked": self.asked, "size": self.size, "wall_s": self.wall_s, "rows": rows}
        return json.dumps(plain, separators=(",", ":")) + "\n"

    @classmethod
    def of_line(cls, line: bytes) -> Batch:
        """The reverse of `line`."""
        plain = json.loads(line)
        rows = tuple(Told.of_list(row) for row in plain["rows"])
        return cls(int(plain["asked"]), int(plain["size"]), float(plain["wall_s"]), rows)


@dataclass(frozen=True)
class Snapshot:
    """An optimizer's state after so many batches."""

    batches: int
    state: Mapping[str, Any]


class Journal:
    """The journal of one branch: `<name>.jsonl` and `<name>.state.json` in a folder."""

    def __init__(self, folder: Path, name: str) -> None:
        self._folder = folder
        self._lines, self._state = folder / f"{name}{LINES}", folder / f"{name}{STATE}"
        self._synced = time.monotonic()

    def read(self) -> list[Batch]:
        """All whole lines; what follows a damaged one is cut off the file."""
        self._synced = time.monotonic()
        batches: list[Batch] = []
        good = 0
        for line in self._whole_lines():
            try:
                batches.append(Batch.of_line(line))
            except (ValueError, KeyError, TypeError):
                break
            good += len(line)
        if self._lines.exists() and self._lines.stat().st_size > good:
            self._cut(good)
        return batches

    def keep(self, batches: int) -> None:
        """Forget all but the first batches."""
        self._cut(sum(len(line) for _, line in zip(range(batches), self._whole_lines(), strict=False)))

    def append(self, batch: Batch) -> None:
        """Write a batch; every now and then down to the disk."""
        with writing_in(self._folder), self._lines.open("ab") as file:
            file.write(batch.line().encode())
            if time.monotonic() - self._synced >= SYNC_EVERY_S:
                self._sync(file)

    def sync(self) -> None:
        """What was written goes down to the disk."""
        if self._lines.exists():
            with writing_in(self._folder), self._lines.open("ab") as file:
                self._sync(file)

    def _sync(self, file: BufferedWriter) -> None:
        file.flush()
        os.fsync(file.fileno())
        self._synced = time.monotonic()

    def snapshot(self) -> Snapshot | None:
        """The optimizer's state, or None where there is none that can be read."""
        try:
            plain = json.loads(self._state.read_text(encoding="utf-8"))
            return Snapshot(int(plain["batches"]), dict(plain["state"]))
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def save(self, snapshot: Snapshot) -> None:
        """Replace the state, whole or not at all."""
        text = json.dumps({"batches": snapshot.batches, "state": snapshot.state})
        with writing_in(self._folder):
            write_atomically(self._state, text)

    def forget_snapshot(self) -> None:
        """Without it the search is repeated from the first line."""
        self._state.unlink(missing_ok=True)

    def clear(self) -> None:
        """Begin anew."""
        self._lines.unlink(missing_ok=True)
        self.forget_snapshot()

    def _whole_lines(self) -> Iterator[bytes]:
        if not self._lines.exists():
            return
        with self._lines.open("rb") as file:
            for line in file:
                if line.endswith(b"\n"):
                    yield line

    def _cut(self, size: int) -> None:
        if self._lines.exists():
            with writing_in(self._folder):
                os.truncate(self._lines, size)


def keep_journals(partial: Path, kept: Path) -> None:
    """Put a finished search's journals where one with a larger budget finds them; only a help, so never an error."""
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
    """Copy kept journals into the folder of a search that has none of its own; whether there were any."""
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
