"""Notes on a measurement: those of the YAML next to the file, overridden by those of the study."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

from pliant.config.measurements import MeasurementNotes
from pliant.config.notes import notes_beside
from pliant.config.places import Places
from pliant_tables.columns import is_frame


def file_digest(path: Path) -> str:
    """Return the SHA-256 of a file's content."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def effective_notes(path: Path, settings: MeasurementNotes | None) -> tuple[MeasurementNotes, str]:
    """Return the notes next to the file overridden by the study's, and the name of the file to write notes into."""
    beside, file = notes_beside(path, MeasurementNotes)
    notes = _on_top(beside or MeasurementNotes(), settings)
    if file is None:
        return notes, path.with_suffix(".yaml").name
    if beside is not None:
        return notes, file.name
    # a study of the same stem occupies the name: notes belong into the block of the study that reads the file
    study = settings.places.study if settings is not None else ""
    return notes, f"the 'measurements' block of {study or file.name}"


def notes_on(source: Any, settings: MeasurementNotes | None) -> tuple[MeasurementNotes, str]:
    """Return `effective_notes` a file, or `frame_notes` for a table in memory."""
    return frame_notes(settings) if is_frame(source) else effective_notes(Path(source), settings)


def frame_notes(settings: MeasurementNotes | None) -> tuple[MeasurementNotes, str]:
    """Return the study's notes for a table in memory, and the name for messages."""
    return _on_top(MeasurementNotes(), settings), "the notes"


def _on_top(notes: MeasurementNotes, settings: MeasurementNotes | None) -> MeasurementNotes:
    """Return notes overridden by a study's: entries are merged, spans joined, other keys the study's if stated."""
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
    merged = MeasurementNotes(**both)
    first = {
        "exclude": len(notes.exclude),
        "missing": len(notes.missing),
    }  # entries of a list follow those of the file
    stated = {
        (path[0], path[1] + first.get(path[0], 0), *path[2:])
        if len(path) > 1 and isinstance(path[1], int)
        else path: place
        for path, place in settings.places.of_keys.items()
    }
    merged.stand_at(Places({**notes.places.of_keys, **stated}))
    return merged
