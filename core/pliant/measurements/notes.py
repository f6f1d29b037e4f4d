"""The notes on a measurement: those of the YAML beside it, those of the study on top."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

from pliant.config.measurements import MeasurementNotes
from pliant.tabular.opening import is_frame
from pliant.tabular.schema import notes_beside


def digest_of(path: Path) -> str:
    """SHA-256 of a file's content."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def notes_of(path: Path, settings: MeasurementNotes | None) -> tuple[MeasurementNotes, str]:
    """The notes beside the file with the study's on top, and the name of the file to write notes into."""
    beside, file = notes_beside(path, MeasurementNotes)
    notes = _on_top(beside or MeasurementNotes(), settings)
    if file is None:
        return notes, path.with_suffix(".yaml").name
    # a study of the same stem takes the name: then the notes belong into its `measurements` block
    return notes, file.name if beside is not None else f"the 'measurements' block of {file.name}"


def notes_on(source: Any, settings: MeasurementNotes | None) -> tuple[MeasurementNotes, str]:
    """`notes_of` of a file, `notes_of_frame` of a table in memory."""
    return notes_of_frame(settings) if is_frame(source) else notes_of(Path(source), settings)


def notes_of_frame(settings: MeasurementNotes | None) -> tuple[MeasurementNotes, str]:
    """As `notes_of`, for a table in memory, beside which nothing lies."""
    return _on_top(MeasurementNotes(), settings), "the notes"


def _on_top(notes: MeasurementNotes, settings: MeasurementNotes | None) -> MeasurementNotes:
    """Notes with those of a study on top: entries are merged, spans of both hold, the rest is the study's if said."""
    if settings is None:
        return notes
    both: dict[str, Any] = {}
    for key in MeasurementNotes.model_fields:
        mine, theirs = getattr(notes, key), getattr(settings, key)
        if isinstance(mine, dict):
            both[key] = {**mine, **theirs}
        elif key in ("exclude", "missing"):
            both[key] = (*mine, *theirs)
        else:
            both[key] = theirs or mine
    return MeasurementNotes(**both)
