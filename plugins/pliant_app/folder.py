"""A session's folder: state, results by key, and input files. Every file is written completely or not at all."""

from __future__ import annotations

import hashlib
import json
import os
import secrets
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from pliant import __version__
from pliant.errors import UserError
from pliant.records.plain_values import plain
from pliant.store.store import write_atomically
from pliant_app.page_state import PageState

STATE, ADDRESS = "session.json", "address.json"
FORMAT = 1


@dataclass(frozen=True)
class SessionFolder:
    """The folder of one session: `files/` are inputs, `results/` were computed, `saved/` are studies."""

    path: Path

    @property
    def files(self) -> Path:
        return self._made("files")

    @property
    def results(self) -> Path:
        return self._made("results")

    @property
    def saved(self) -> Path:
        return self._made("saved")

    def _made(self, name: str) -> Path:
        folder = self.path / name
        folder.mkdir(parents=True, exist_ok=True)
        return folder

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Lock the folder against a second server; raises `UserError` where another server has it."""
        self.path.mkdir(parents=True, exist_ok=True)
        lock = FileLock(self.path / ".lock")
        try:
            with lock.acquire(timeout=0):
                yield
        except Timeout:
            raise UserError(
                f"{self.path}: another 'pliant app' has this session open; continue in its page, or give another --out."
            ) from None

    def state(self) -> PageState:
        """Return the state, new if no file exists; raises `UserError` for an invalid file."""
        file = self.path / STATE
        if not file.exists():
            return PageState()
        try:
            values = json.loads(file.read_text(encoding="utf-8"))
            if values["format"] != FORMAT:
                raise ValueError
            return PageState.from_json(values["state"])
        except (ValueError, KeyError, TypeError):
            raise UserError(f"{file} is no session of this version; give --out another folder.") from None

    def keep(self, state: PageState) -> None:
        """Write the state."""
        text = {"format": FORMAT, "pliant": __version__, "state": plain(state.as_json())}
        self.path.mkdir(parents=True, exist_ok=True)
        write_atomically(self.path / STATE, json.dumps(text, indent=1) + "\n")

    def address(self, port: int) -> tuple[str, int]:
        """Return the page's token and port, unchanged between starts for open tabs and readable only by the user."""
        file = self.path / ADDRESS
        try:
            kept = json.loads(file.read_text(encoding="utf-8"))
            return str(kept["token"]), port or int(kept["port"])
        except (OSError, ValueError, KeyError, TypeError):
            return secrets.token_urlsafe(24), port

    def keep_address(self, token: str, port: int) -> None:
        """Write token and port, readable only by the user."""
        self.path.mkdir(parents=True, exist_ok=True)
        file = self.path / ADDRESS
        handle = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        with os.fdopen(handle, "w", encoding="utf-8") as out:
            json.dump({"token": token, "port": port}, out)

    def result(self, key: str) -> dict[str, Any] | None:
        """Return the result of a key; None where it is missing or cannot be read."""
        try:
            found = json.loads((self.results / f"{key}.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        return found if isinstance(found, dict) else None

    def keep_result(self, key: str, value: Mapping[str, Any]) -> None:
        """Write a result."""
        write_atomically(self.results / f"{key}.json", json.dumps(plain(value), allow_nan=False) + "\n")


def result_key(what: str, *depends: Any) -> str:
    """Return a name for a result that depends on these JSON values and on this version."""
    text = json.dumps([__version__, what, *map(plain, depends)], sort_keys=True)
    return f"{what}-{hashlib.sha256(text.encode()).hexdigest()[:20]}"
