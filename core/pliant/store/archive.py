"""A study with its artifacts as one zip file, for use on another machine.

    archive.json                     format, version of Pliant, the study's name and file
    study/…                          the study and the tables that it reads
    store/<stage>/<key>/…            manifest, value and arrays of each artifact

An archive is data: nothing in it is executed when it is opened, every name in it is checked before a byte is written,
and its unpacked size is bounded. The numbers in it are trusted, as those of any table.
"""

from __future__ import annotations

import json
import re
import shutil
import tempfile
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pliant import __version__
from pliant.errors import UserError
from pliant.regular_files import require_regular
from pliant.store.inventory import StoreEntry
from pliant.store.store import ARRAYS, MANIFEST, VALUE, CorruptedError, load_artifact, whole_file, writing_in
from pliant.store.uses import Uses

INDEX, FORMAT = "archive.json", 1
UNPACKED = 4_000_000_000  # bytes of all files
MOST_FILES = 100_000
LARGEST_INDEX = 100_000
ARTIFACT_FILE = re.compile(
    rf"store/([a-z][a-z_]*)/([0-9a-f]{{32}})/({re.escape(MANIFEST)}|{VALUE}|{re.escape(ARRAYS)})"
)
# A file, or one folder and a file; no name begins with a dot, so that none points outside.
STUDY_FILE = re.compile(r"study/(?:[A-Za-z0-9_][\w.+-]{0,99}/)?[A-Za-z0-9_][\w.+ -]{0,199}", re.ASCII)
STUDY_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")
FIXED = (1980, 1, 1, 0, 0, 0)  # fixed, so that the same contents give the same bytes


@dataclass(frozen=True)
class Imported:
    """The contents of an imported archive.

    Attributes:
        study: the study file, ready to run.
        name: of the study.
        artifacts: how many the store did not have before, and how many the archive contained.
        code: Python files that running the study executes.
    """

    study: Path
    name: str
    artifacts: tuple[int, int]
    code: tuple[Path, ...]


def write_archive(target: Path, name: str, study: Path, artifacts: Sequence[StoreEntry]) -> None:
    """Write an archive of a self-contained study, the other files of its folder, and artifacts.

    Raises `UserError` where the target cannot be written.
    """
    folder = study.parent
    files = {f"study/{p.relative_to(folder).as_posix()}": p for p in sorted(folder.rglob("*")) if p.is_file()}
    for entry in artifacts:
        for part in (MANIFEST, VALUE, ARRAYS):
            files[f"store/{entry.stage}/{entry.key}/{part}"] = entry.folder / part
    if wrong := next(
        (one for one in files if not (STUDY_FILE.fullmatch(one) or ARTIFACT_FILE.fullmatch(one))), None
    ):
        raise UserError(f"{wrong.partition('/')[2]}: no archive can hold a file of this name; rename it.")
    index = {"format": FORMAT, "pliant": __version__, "study": name, "file": study.name}
    with (
        writing_in(target.parent),
        whole_file(target) as partial,
        zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED) as made,
    ):
        made.writestr(zipfile.ZipInfo(INDEX, FIXED), json.dumps(index, indent=1))
        for inside, path in files.items():
            with path.open("rb") as source, made.open(zipfile.ZipInfo(inside, FIXED), "w") as sink:
                shutil.copyfileobj(source, sink)


def import_archive(path: Path, root: Path, folder: Path) -> Imported:
    """Put the artifacts of an archive into a store and its study into a new folder.

    Everything is unpacked next to the store and checked before any of it is moved into place; artifacts that the store
    already has are not changed.

    Raises:
        UserError: it is no archive, it is damaged, a name in it points outside, it is too large, or the folder exists
            already.
    """
    if folder.exists():
        raise UserError(f"{folder} is there already; give another --out.")
    with writing_in(root):
        root.mkdir(parents=True, exist_ok=True)
        folder.parent.mkdir(parents=True, exist_ok=True)
        staged = Path(tempfile.mkdtemp(prefix=".importing-", dir=root))
    try:
        index = _unpacked(path, staged)
        new = _checked_artifacts(path, staged)
        with writing_in(root):
            fresh = [source for source in new if not (root / source.relative_to(staged / "store")).exists()]
            for source in fresh:
                target = root / source.relative_to(staged / "store")
                target.parent.mkdir(exist_ok=True)
                source.rename(target)
            shutil.copytree(staged / "study", folder)
        uses = Uses(root, index["study"])
        for source in new:
            uses.note(source.parent.name, source.name)
    finally:
        shutil.rmtree(staged, ignore_errors=True)
    code = tuple(sorted(folder.rglob("*.py")))
    return Imported(folder / index["file"], index["study"], (len(fresh), len(new)), code)


def _unpacked(path: Path, staged: Path) -> Mapping[str, Any]:
    """Unpack the archive into `staged` and return its index."""
    no_archive = UserError(f"{path}: it is no archive of 'pliant store --export'.")
    try:
        require_regular(path)
        with zipfile.ZipFile(path) as archive:
            inside = archive.infolist()
            _check_names(path, inside)
            if archive.getinfo(INDEX).file_size > LARGEST_INDEX:
                raise no_archive
            index = json.loads(archive.read(INDEX))
            if not isinstance(index, dict) or index.get("format") != FORMAT:
                raise UserError(f"{path}: its format is not {FORMAT}, the one that this Pliant reads.")
            name, file = str(index.get("study")), f"study/{index.get('file')}"
            if not STUDY_NAME.fullmatch(name) or file not in archive.namelist():
                raise no_archive
            for entry in inside:
                if entry.filename != INDEX:
                    target = staged / entry.filename
                    target.parent.mkdir(parents=True, exist_ok=True)
                    with archive.open(entry) as source, target.open("wb") as sink:  # at most its stated size
                        shutil.copyfileobj(source, sink)
            return index
    except UserError:
        raise
    except OSError as error:
        raise UserError(f"{path}: the archive cannot be read ({error.strerror or error}).") from None
    except (zipfile.BadZipFile, zlib.error, EOFError) as error:
        raise UserError(f"{path}: the archive is damaged ({error}).") from None
    except (ValueError, LookupError, RuntimeError, NotImplementedError, RecursionError):
        raise no_archive from None  # also a password-protected archive, or one of another kind of compression


def _check_names(path: Path, inside: Sequence[zipfile.ZipInfo]) -> None:
    names = [entry.filename for entry in inside]
    if len(names) > MOST_FILES or len(set(names)) != len(names):
        raise UserError(f"{path}: it holds more than {MOST_FILES} files, or one of them twice.")
    for name in names:
        if name != INDEX and not (STUDY_FILE.fullmatch(name) or ARTIFACT_FILE.fullmatch(name)):
            raise UserError(
                f"{path}: it holds '{name[:80]}', which no archive of Pliant does; nothing was unpacked."
            )
    if sum(entry.file_size for entry in inside) > UNPACKED:
        raise UserError(f"{path}: it unpacks to more than {UNPACKED / 1e9:g} GB, which is the most.")


def _checked_artifacts(path: Path, staged: Path) -> list[Path]:
    """Return the folders of the artifacts, after checking each for completeness, its checksums and its size."""
    found = sorted(folder for folder in (staged / "store").glob("*/*"))
    size = 0
    for folder in found:
        what = f"{folder.parent.name}/{folder.name[:8]}"
        try:
            with zipfile.ZipFile(folder / ARRAYS) as arrays:  # arrays are compressed a second time
                size += sum(entry.file_size for entry in arrays.infolist())
            if size > UNPACKED:
                raise UserError(
                    f"{path}: its arrays unpack to more than {UNPACKED / 1e9:g} GB, which is the most."
                )
            load_artifact(folder, folder.name)
        except (CorruptedError, OSError, zipfile.BadZipFile, MemoryError) as error:
            raise UserError(f"{path}: artifact {what} is damaged ({error}); nothing was imported.") from None
    return found
