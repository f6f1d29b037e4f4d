"""Notes next to a table: the YAML file of the same stem."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

from pliant.config.loading import load_notes
from pliant.config.measurements import ColumnNotes
from pliant.errors import UserError

Notes = TypeVar("Notes", bound=ColumnNotes)


def notes_beside(path: Path, model: type[Notes]) -> tuple[Notes | None, Path | None]:
    """Return the YAML notes of the same stem as a table and their file; None without one.

    A study may have that stem: then the file is the study, without notes, because the notes belong into it.
    """
    found = [f for end in (".yaml", ".yml") if (f := path.with_suffix(end)) != path and f.is_file()]
    read = [(notes, file) for file in found if (notes := load_notes(file, model)) is not None]
    if len(read) > 1:
        raise UserError(
            f"{path.parent}: {read[0][1].name} and {read[1][1].name} both hold notes on {path.name}; keep one."
        )
    return read[0] if read else (None, found[0] if found else None)
