"""An artifact as bytes, for workers on hosts that do not share the store: packed there and stored here."""

from __future__ import annotations

import io
import shutil
import uuid
import zipfile
from pathlib import Path

from pliant.store.store import ARRAYS, MANIFEST, VALUE, CorruptedError, load_artifact, writing_in

FILES = (MANIFEST, VALUE, ARRAYS)
UNPACKED = 2_000_000_000  # bytes of its files


def packed(folder: Path) -> bytes:
    """Return the files of an artifact in one zip; they are compressed already."""
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w") as made:
        for name in FILES:
            made.write(folder / name, name)
    return target.getvalue()


def received(parcel: bytes, folder: Path) -> None:
    """Put a packed artifact into its folder of the store; an existing one stays.

    Raises:
        CorruptedError: it is not an artifact of this key, damaged, or too large.
        UserError: the store cannot be written.
    """
    with writing_in(folder.parent):
        staged = folder.with_name(f".writing-{folder.name}-{uuid.uuid4().hex}")
        staged.mkdir(parents=True)
        try:
            _unpack(parcel, staged)
            load_artifact(staged, folder.name)
            if not folder.exists():
                staged.replace(folder)
        finally:
            shutil.rmtree(staged, ignore_errors=True)


def _unpack(parcel: bytes, folder: Path) -> None:
    try:
        with zipfile.ZipFile(io.BytesIO(parcel)) as archive:
            if sorted(archive.namelist()) != sorted(FILES):
                raise CorruptedError(f"it holds other files than {', '.join(FILES)}")
            if sum(entry.file_size for entry in archive.infolist()) > UNPACKED:
                raise CorruptedError(f"it unpacks to more than {UNPACKED / 1e9:.0f} GB")
            archive.extractall(folder)
    except zipfile.BadZipFile as error:
        raise CorruptedError(f"{error}") from None
