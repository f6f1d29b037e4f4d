"""Finished states on disk, so that an interrupted sampling goes on."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from pliant.interfaces.fem import StateNotConvergedError
from pliant.records.fem import FemState
from pliant.store.store import (
    CorruptedError,
    digests,
    read_checked,
    write_atomically,
    write_value,
    writing_in,
)


class Saved:
    """Finished targets in a folder, so that an interruption loses at most one.

    A solved state has a sub-folder; `states.json` holds, by the target's name, the digests of its files, or
    the cause where the target failed. What is damaged is said and solved anew.
    """

    def __init__(self, folder: Path, note: Callable[[str], None]) -> None:
        self.folder = folder
        self.index = folder / "states.json"
        self.states: dict[str, FemState] = {}
        self.entries = self._sound(self._read_index(note), note)
        self.reused = False

    def __len__(self) -> int:
        return len(self.entries)

    def solve(self, name: str, compute: Callable[[], FemState]) -> FemState:
        """The saved state of this name, or a computed one, saved; a saved failure is raised again."""
        self.reused = name in self.entries
        if name in self.states:
            return self.states[name]
        if self.reused:
            raise StateNotConvergedError(self.entries[name]["failed"])
        try:
            state = compute()
        except StateNotConvergedError as error:
            self._remember(name, {"failed": str(error)})
            raise
        place = self._place(name)
        with writing_in(self.folder):
            shutil.rmtree(place, ignore_errors=True)
            place.mkdir()
            write_value(place, state)
            self._remember(name, digests(place))
        return state

    def _place(self, name: str) -> Path:
        return self.folder / f"state-{hashlib.sha256(name.encode()).hexdigest()[:16]}"

    def _remember(self, name: str, entry: dict[str, str]) -> None:
        self.entries[name] = entry
        with writing_in(self.folder):
            write_atomically(self.index, json.dumps(self.entries))

    def _read_index(self, note: Callable[[str], None]) -> dict[str, Any]:
        try:
            entries = json.loads(self.index.read_text())
        except FileNotFoundError:
            return {}
        except ValueError:
            entries = None
        if not isinstance(entries, dict):
            note(f"{self.index} is damaged; solving its states anew.")
            return {}
        return entries

    def _sound(self, entries: Mapping[str, Any], note: Callable[[str], None]) -> dict[str, dict[str, str]]:
        """The entries whose files are as they were written; their states are kept in `states`."""
        sound = {}
        for name, entry in entries.items():
            try:
                if "failed" not in entry:
                    self.states[name] = read_checked(self._place(name), entry)
                sound[name] = entry
            except (CorruptedError, TypeError) as error:
                note(f"the finished state '{name}' is damaged ({error}); solving it anew.")
        return sound
