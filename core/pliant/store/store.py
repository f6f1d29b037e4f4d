"""The artifact store: a folder per result, named by a digest of its inputs.

    <root>/<stage>/<key>/manifest.json   provenance and the digest of every file
    <root>/<stage>/<key>/value.json      the record
    <root>/<stage>/<key>/arrays.npz      its arrays
    <root>/<stage>/<key>.partial/        the finished parts of an interrupted computation

A result is written to a temporary folder and renamed, so a reader sees all of it or nothing. A lock per key
lets two processes share a store: the second waits and reads the result of the first. Cached results are
read without writing, so a store without write permission still serves its results. A result of other code for the same
config and inputs is adopted where the caller can show that the present code agrees.
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
import uuid
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from filelock import FileLock, Timeout

from pliant import __version__
from pliant.errors import UserError
from pliant.store.codec import decode, encode
from pliant.store.fingerprint import versions
from pliant.store.uses import Uses

# Errors of reading a damaged file, such as an array length that exceeds the memory.
DAMAGE = (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError, MemoryError)
VALUE, ARRAYS, MANIFEST = "value.json", "arrays.npz", "manifest.json"


@dataclass(frozen=True)
class Recipe:
    """The stage, JSON config, keys of inputs and fingerprint of the code that determine a result.

    `plugins` compute it, each with interface, kind and package; they are recorded and not part of the key.
    """

    stage: str
    config: Mapping[str, Any]
    inputs: Mapping[str, str]
    code: str
    libraries: Mapping[str, str]
    plugins: Sequence[Mapping[str, str]] = ()

    @property
    def key(self) -> str:
        """Content address of the result."""
        parts = [self.stage, self.config, dict(self.inputs), self.code, dict(self.libraries)]
        return _json_digest(parts)[:32]


@dataclass(frozen=True)
class Artifact:
    """A stored result: its value, its folder, its manifest, and whether it was cached."""

    value: Any
    folder: Path
    manifest: Mapping[str, Any]
    cached: bool

    @property
    def key(self) -> str:
        """The content address, which names the folder."""
        return self.folder.name


class CorruptedError(Exception):
    """Error of a stored artifact that does not match its own digests."""


class ArtifactStore:
    """Artifacts under one root folder; those made or found are recorded for the study that the store is opened for."""

    def __init__(self, root: Path, study: str = "") -> None:
        self.root = root
        self.uses = Uses(root, study)

    def make(
        self,
        recipe: Recipe,
        compute: Callable[[Path], Any],
        note: Callable[[str], None] = lambda text: None,
        agrees: Callable[[Any], bool] | None = None,
    ) -> Artifact:
        """Load the artifact of a recipe, or compute and store it.

        Args:
            recipe: what determines the result.
            compute: called with a folder for finished parts; its contents survive an interruption and are given to
                the next attempt.
            note: receives a sentence when an artifact is corrupted, or when another process computes it.
            agrees: whether the present code gives the same value as other code for the same config and inputs; such a
                value is adopted under the new key instead of computed. None adopts nothing.

        Raises:
            UserError: the store cannot be read or written.
        """
        folder = self.root / recipe.stage / recipe.key
        partial = folder.with_name(folder.name + ".partial")
        found = _sound(folder)
        if found is not None:
            # A process that was killed after its last write left its parts.
            shutil.rmtree(partial, ignore_errors=True)
            self.uses.note(recipe.stage, recipe.key)
            return found
        _writable(folder.parent)
        with self._locked(folder, note):
            found = self._load_or_discard(folder, note)  # another process may have finished it
            if found is not None:
                self.uses.note(recipe.stage, recipe.key)
                return found
            of_other_code = self._adoptable(recipe, agrees) if agrees is not None else None
            if of_other_code is not None:
                value, wall_s = of_other_code.value, float(of_other_code.manifest["wall_s"])
                note(
                    f"{recipe.stage}: what other code of Pliant made ({of_other_code.key[:8]}) is taken over; "
                    "a part of it was computed again and agrees."
                )
            else:
                with writing_in(folder.parent):
                    partial.mkdir(exist_ok=True)
                started = time.perf_counter()
                value = compute(partial)
                wall_s = time.perf_counter() - started
            with writing_in(folder.parent):
                self._write(folder, recipe, value, wall_s, of_other_code.key if of_other_code else "")
            shutil.rmtree(partial, ignore_errors=True)
        # Read back, so that the first run continues with exactly the values that later runs read.
        made = replace(load_artifact(folder), cached=False)
        self.uses.note(recipe.stage, recipe.key)
        return made

    def find(self, recipe: Recipe) -> Artifact | None:
        """Return the artifact of a recipe if it exists and is sound; nothing is written."""
        found = _sound(self.root / recipe.stage / recipe.key)
        if found is not None:
            self.uses.note(recipe.stage, recipe.key)
        return found

    def computed_elsewhere(self, stage: str, key: str) -> bool:
        """Return whether another process, or thread, computes this artifact now.

        A killed process does not count: the operating system releases its lock.
        """
        try:
            if (self.root / stage).is_dir():
                with FileLock(self.root / stage / f"{key}.lock").acquire(timeout=0):
                    pass
        except Timeout:
            return True
        except (OSError, NotImplementedError):  # `make` reports it
            pass
        return False

    def _adoptable(self, recipe: Recipe, agrees: Callable[[Any], bool]) -> Artifact | None:
        """Return the newest artifact of the same config, inputs and libraries by other code that agrees, or None."""
        alike = json.loads(json.dumps([recipe.config, dict(recipe.inputs), dict(recipe.libraries)]))
        found = []
        for file in (self.root / recipe.stage).glob(f"*/{MANIFEST}"):
            try:
                manifest = json.loads(file.read_text())
                if [manifest["config"], manifest["inputs"], manifest["libraries"]] == alike:
                    found.append((manifest["created"], file.parent))
            except (OSError, ValueError, KeyError, TypeError):  # damaged, or being written
                continue
        sound = (_sound(folder) for _, folder in sorted(found, reverse=True))
        return next((artifact for artifact in sound if artifact is not None and agrees(artifact.value)), None)

    def _load_or_discard(self, folder: Path, note: Callable[[str], None]) -> Artifact | None:
        """Return the artifact, if it is sound; a damaged one is renamed. Only for the holder of the lock."""
        if not folder.exists():
            return None
        try:
            return load_artifact(folder, folder.name)
        except CorruptedError as error:
            note(
                f"artifact {folder.parent.name}/{folder.name[:8]} is corrupted ({error}); computing it anew."
            )
        aside = folder.with_name(folder.name + ".corrupted")
        with writing_in(folder.parent):
            shutil.rmtree(aside, ignore_errors=True)
            folder.rename(aside)
        return None

    def _write(self, folder: Path, recipe: Recipe, value: Any, wall_s: float, adopted: str) -> None:
        for left in folder.parent.glob(f".writing-{folder.name}-*"):  # by a process that was killed
            shutil.rmtree(left, ignore_errors=True)
        temporary = folder.with_name(f".writing-{folder.name}-{uuid.uuid4().hex}")
        try:
            temporary.mkdir()
            write_value(temporary, value)
            manifest = {
                "pliant": __version__,
                "stage": recipe.stage,
                "key": recipe.key,
                "config": recipe.config,
                "inputs": dict(recipe.inputs),
                "code": recipe.code,
                "libraries": dict(recipe.libraries),
                "plugins": [dict(plugin) for plugin in recipe.plugins],
                "wall_s": wall_s,
                "created": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
                "python": platform.python_version(),
                "platform": platform.platform(),
                "versions": versions(["numpy", "scipy", "pydantic"]),
                "files": digests(temporary),
                **({"adopted": adopted} if adopted else {}),
            }
            manifest["digest"] = _json_digest(manifest)
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
        except (OSError, NotImplementedError) as error:
            raise UserError(
                f"{lock.lock_file} cannot be locked ({error}); choose another store with --store."
            ) from None
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
    """Read a record written by `write_value`; arrays are read-only."""
    with np.load(folder / ARRAYS, allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    for array in arrays.values():
        array.flags.writeable = False
    return decode(json.loads((folder / VALUE).read_text()), arrays)


def digests(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of the files of a record that `write_value` wrote."""
    return {name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in (VALUE, ARRAYS)}


def read_checked(folder: Path, expected: Mapping[str, str]) -> Any:
    """Read a record whose files must have these digests; raises `CorruptedError` with the cause."""
    try:
        for name, digest in digests(folder).items():
            if digest != expected[name]:
                raise CorruptedError(f"{name} does not match its checksum")
        return read_value(folder)
    except PermissionError as error:
        raise UserError(f"{folder} cannot be read ({error.strerror}).") from None
    except (*DAMAGE, zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        raise CorruptedError(f"{type(error).__name__}: {error}") from None


def load_artifact(folder: Path, key: str | None = None) -> Artifact:
    """Read a stored artifact and check its digests, and its key if given.

    Raises `CorruptedError` with the cause, and `UserError` where permission is missing.
    """
    try:
        manifest = json.loads((folder / MANIFEST).read_text())
        bare = {name: value for name, value in manifest.items() if name != "digest"}
        if manifest["digest"] != _json_digest(bare):
            raise CorruptedError(f"{MANIFEST} does not match its checksum")
    except PermissionError as error:
        raise UserError(f"{folder} cannot be read ({error.strerror}).") from None
    except DAMAGE as error:
        raise CorruptedError(f"{MANIFEST}: {type(error).__name__}: {error}") from None
    if key is not None and manifest.get("key") != key:
        raise CorruptedError(f"it is a copy of {manifest.get('key')}")
    return Artifact(read_checked(folder, manifest["files"]), folder, manifest, cached=True)


def _sound(folder: Path) -> Artifact | None:
    """Return the artifact of a store, or None for a missing or damaged one."""
    try:
        return load_artifact(folder, folder.name) if folder.is_dir() else None
    except CorruptedError:
        return None


@contextmanager
def writing_in(folder: Path) -> Iterator[None]:
    """Turn a full disk or a missing permission into a `UserError` that names the folder."""
    try:
        yield
    except OSError as error:
        cause = error.strerror or type(error).__name__
        raise UserError(
            f"{folder} cannot be written ({cause}); finished work is kept, run again when that is mended."
        ) from None


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a temporary file next to `path`, which replaces it at the end; an error or Ctrl-C leaves no file behind."""
    handle, name = tempfile.mkstemp(prefix=".writing-", suffix=path.suffix, dir=path.parent)
    os.close(handle)
    partial = Path(name)
    try:
        yield partial
        partial.chmod(0o644)
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def write_atomically(path: Path, text: str) -> None:
    """Write a text file so that a reader sees the old one or the new one."""
    with whole_file(path) as partial:
        partial.write_text(text, encoding="utf-8")


def _writable(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        raise UserError(f"{folder} cannot be written ({error.strerror}); choose another folder.") from None


def _json_digest(value: Any) -> str:
    """Return the SHA-256 of a value as JSON, independent of the order of its keys; the same before and after a file."""
    plain = json.loads(json.dumps(value))
    return hashlib.sha256(json.dumps(plain, sort_keys=True).encode()).hexdigest()
