"""The contents of a store, checks of their integrity, and removal of old or excess artifacts."""

from __future__ import annotations

import json
import math
import shutil
import time
import uuid
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from filelock import FileLock, Timeout

from pliant.errors import UserError
from pliant.store.store import MANIFEST, CorruptedError, load_artifact, writing_in
from pliant.store.uses import users


@dataclass(frozen=True)
class StoreEntry:
    """One finished artifact.

    Attributes:
        folder: its location.
        stage, key: its address in the store.
        studies: that used it; empty for artifacts of an older Pliant.
        size_bytes: on the disk.
        created: ISO 8601, UTC; empty where its manifest cannot be read.
        wall_s: the time to compute it; NaN where its manifest cannot be read.
    """

    folder: Path
    stage: str
    key: str
    studies: tuple[str, ...]
    size_bytes: int
    created: str
    wall_s: float


def entries(root: Path) -> list[StoreEntry]:
    """Return all finished artifacts, stage by stage, oldest first. Raises `UserError` where there is no store."""
    if not root.is_dir():
        raise UserError(f"there is no store at {root}; the first 'pliant run' makes one, or give --store.")
    used = users(root)
    found = [_entry(file.parent, used) for file in root.glob(f"*/*/{MANIFEST}") if _is_finished(file.parent)]
    return sorted(found, key=lambda entry: (entry.stage, entry.created, entry.key))


def _is_finished(folder: Path) -> bool:
    return "." not in folder.name  # .partial, .corrupted, .writing-…


def _entry(folder: Path, used: dict[str, tuple[str, ...]]) -> StoreEntry:
    files = [file for file in folder.rglob("*") if file.is_file()]
    try:
        manifest = json.loads((folder / MANIFEST).read_text())
        created, wall_s = str(manifest["created"]), float(manifest["wall_s"])
    except (OSError, ValueError, KeyError, TypeError):
        created, wall_s = "", math.nan
    stage, key = folder.parent.name, folder.name
    size = sum(file.stat().st_size for file in files)
    return StoreEntry(folder, stage, key, used.get(f"{stage}/{key}", ()), size, created, wall_s)


def damaged(
    entries: Sequence[StoreEntry], tick: Callable[[], None] = lambda: None
) -> Iterator[tuple[StoreEntry, str]]:
    """Yield artifacts that do not match their checksums, each with the cause; `tick` is called for each one read."""
    for entry in entries:
        try:
            load_artifact(entry.folder, entry.key)
        except (CorruptedError, UserError) as error:
            yield entry, str(error)
        tick()


def to_prune(
    entries: Sequence[StoreEntry], older_s: float | None = None, most_bytes: int | None = None
) -> list[StoreEntry]:
    """Return entries older than `older_s`, and the oldest ones beyond a total size of those that stay.

    Entries without a readable date count as the oldest.
    """
    now = time.time()
    by_age = sorted(entries, key=lambda entry: entry.created)
    gone = [entry for entry in by_age if older_s is not None and _age_s(entry, now) > older_s]
    stay = [entry for entry in by_age if entry not in gone]
    size = sum(entry.size_bytes for entry in stay)
    for entry in stay if most_bytes is not None else ():
        if size <= (most_bytes or 0):
            break
        gone.append(entry)
        size -= entry.size_bytes
    return gone


def _age_s(entry: StoreEntry, now: float) -> float:
    try:
        made = datetime.fromisoformat(entry.created)
    except ValueError:
        return math.inf
    return now - (made if made.tzinfo else made.replace(tzinfo=UTC)).timestamp()


def prune(gone: Sequence[StoreEntry]) -> list[StoreEntry]:
    """Remove artifacts, each as a whole; those that another process is using stay.

    Returns the removed entries. Raises `UserError` where the store cannot be written.
    """
    done = []
    for entry in gone:
        with writing_in(entry.folder.parent):
            try:
                with FileLock(entry.folder.with_name(f"{entry.key}.lock")).acquire(timeout=0):
                    aside = entry.folder.with_name(f".pruned-{entry.key}-{uuid.uuid4().hex}")
                    entry.folder.rename(aside)  # a reader sees all of it or nothing
            except Timeout:
                continue
            except FileNotFoundError:  # another process was faster
                continue
        shutil.rmtree(aside, ignore_errors=True)
        done.append(entry)
    return done
