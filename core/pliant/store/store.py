"""The artifact store: a folder per result, named by what it was made from.

    <root>/<stage>/<key>/manifest.json   provenance and the digest of every file
    <root>/<stage>/<key>/value.json      the record
    <root>/<stage>/<key>/arrays.npz      its arrays
    <root>/<stage>/<key>.partial/        what an interrupted computation has finished so far

A result is written to a temporary folder and renamed, so a reader sees all of it or nothing. A lock per key
lets two processes share a store: the second waits and reads what the first wrote.
"""

from __future__ import annotations

import datetime
import hashlib
import json
import os
import platform
import shutil
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from filelock import FileLock, Timeout

from pliant import __version__
from pliant.errors import UserError
from pliant.store.codec import decode, encode
from pliant.store.fingerprint import versions

VALUE, ARRAYS, MANIFEST = "value.json", "arrays.npz", "manifest.json"


@dataclass(frozen=True)
class Recipe:
    """What determines a result: stage, JSON config, keys of its inputs, fingerprint of its code."""

    stage: str
    config: Mapping[str, Any]
    inputs: Mapping[str, str]
    code: str
    libraries: Mapping[str, str]

    @property
    def key(self) -> str:
        """Content address of the result."""
        text = json.dumps(
            [self.stage, self.config, dict(self.inputs), self.code, dict(self.libraries)], sort_keys=True
        )
        return hashlib.sha256(text.encode()).hexdigest()[:32]


@dataclass(frozen=True)
class Artifact:
    """A stored result: its value, its folder, its manifest, and whether it was there before."""

    value: Any
    folder: Path
    manifest: Mapping[str, Any]
    cached: bool

    @property
    def key(self) -> str:
        """Content address."""
        return self.folder.name


class CorruptedError(Exception):
    """A stored artifact does not match its own digests."""


class ArtifactStore:
    """Artifacts under one root folder."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def make(
        self, recipe: Recipe, compute: Callable[[Path], Any], note: Callable[[str], None] = lambda text: None
    ) -> Artifact:
        """Load the artifact of a recipe, or compute and store it.

        Args:
            recipe: what determines the result.
            compute: called with a folder for finished parts; what it leaves there survives an interruption
                and is given to the next attempt.
            note: receives a sentence when something was found corrupted, or when another process computes.

        Raises:
            UserError: the store cannot be written.
        """
        folder = self.root / recipe.stage / recipe.key
        found = self._load_or_discard(folder, note)
        if found is not None:
            return found
        _writable(folder.parent)
        with self._locked(folder, note):
            found = self._load_or_discard(folder, note)  # another process may have finished it
            if found is not None:
                return found
            partial = folder.with_name(folder.name + ".partial")
            partial.mkdir(exist_ok=True)
            started = time.perf_counter()
            value = compute(partial)
            wall_s = time.perf_counter() - started
            self._write(folder, recipe, value, wall_s)
            shutil.rmtree(partial, ignore_errors=True)
        return Artifact(value, folder, _manifest(folder), cached=False)

    def _load_or_discard(self, folder: Path, note: Callable[[str], None]) -> Artifact | None:
        if not folder.is_dir():
            return None
        try:
            return load_artifact(folder)
        except CorruptedError as error:
            note(
                f"artifact {folder.parent.name}/{folder.name[:8]} is corrupted ({error}); computing it anew."
            )
            aside = folder.with_name(folder.name + ".corrupted")
            shutil.rmtree(aside, ignore_errors=True)
            try:
                folder.rename(aside)
            except FileNotFoundError:
                return None  # another process moved it first
        return None

    def _write(self, folder: Path, recipe: Recipe, value: Any, wall_s: float) -> None:
        temporary = Path(tempfile.mkdtemp(prefix=".writing-", dir=folder.parent))
        try:
            write_value(temporary, value)
            manifest = {
                "pliant": __version__,
                "stage": recipe.stage,
                "key": recipe.key,
                "config": recipe.config,
                "inputs": dict(recipe.inputs),
                "code": recipe.code,
                "libraries": dict(recipe.libraries),
                "wall_s": wall_s,
                "created": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
                "python": platform.python_version(),
                "platform": platform.platform(),
                "versions": versions(["numpy", "scipy", "pydantic"]),
                "files": {name: _digest(temporary / name) for name in (VALUE, ARRAYS)},
            }
            (temporary / MANIFEST).write_text(json.dumps(manifest, indent=1))
            temporary.replace(folder)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)

    @contextmanager
    def _locked(self, folder: Path, note: Callable[[str], None]) -> Iterator[None]:
        lock = FileLock(folder.with_name(folder.name + ".lock"))
        try:
            lock.acquire(timeout=0.2)
        except Timeout:
            note(f"another process computes {folder.parent.name}/{folder.name[:8]}; waiting for it.")
            lock.acquire()
        try:
            yield
        finally:
            lock.release()


def write_value(folder: Path, value: Any) -> None:
    """Write a record as `value.json` and `arrays.npz`."""
    arrays: dict[str, np.ndarray] = {}
    tree = encode(value, arrays)
    (folder / VALUE).write_text(json.dumps(tree))
    with (folder / ARRAYS).open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]


def read_value(folder: Path) -> Any:
    """Read a record written by `write_value`; arrays come back read-only."""
    with np.load(folder / ARRAYS, allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    for array in arrays.values():
        array.flags.writeable = False
    return decode(json.loads((folder / VALUE).read_text()), arrays)


def load_artifact(folder: Path) -> Artifact:
    """Read a stored artifact and check its digests; raises `CorruptedError` with the cause."""
    try:
        manifest = _manifest(folder)
        for name, digest in manifest["files"].items():
            if _digest(folder / name) != digest:
                raise CorruptedError(f"{name} does not match its checksum")
        return Artifact(read_value(folder), folder, manifest, cached=True)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, zipfile.BadZipFile) as error:
        raise CorruptedError(f"{type(error).__name__}: {error}") from None


def write_atomically(path: Path, text: str) -> None:
    """Write a text file so that a reader sees the old one or the new one."""
    handle, name = tempfile.mkstemp(prefix=".writing-", dir=path.parent)
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        Path(name).chmod(0o644)
        Path(name).replace(path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def _writable(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        raise UserError(f"{folder} cannot be written ({error.strerror}); choose another folder.") from None


def _manifest(folder: Path) -> Any:
    return json.loads((folder / MANIFEST).read_text())


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
