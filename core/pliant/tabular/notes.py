"""The YAML notes beside a table: found, read and checked against its header in one way."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TypeVar

from pliant.config.loading import load_notes
from pliant.config.measurements import ColumnNotes
from pliant.errors import UserError, closest

ENDINGS = (".yaml", ".yml")
Notes = TypeVar("Notes", bound=ColumnNotes)


def notes_beside(path: Path, model: type[Notes]) -> tuple[Notes | None, Path | None]:
    """The notes of the same stem as a table and their file; None where there are none.

    A study may have that stem too: then the file is the study, without notes, since the notes belong into it.
    """
    found = [f for end in ENDINGS if (f := path.with_suffix(end)) != path and f.is_file()]
    read = [(notes, file) for file in found if (notes := load_notes(file, model)) is not None]
    if len(read) > 1:
        raise UserError(
            f"{path.parent}: {read[0][1].name} and {read[1][1].name} both hold notes on {path.name}; keep one."
        )
    return read[0] if read else (None, found[0] if found else None)


def check_named(path: Path, notes_name: str, key: str, named: Iterable[str], columns: Iterable[str]) -> None:
    """Raise `UserError` where a key of the notes names a column that is not there: a slip of the pen."""
    known = dict.fromkeys(columns)
    for name in named:
        if name not in known:
            raise UserError(
                f"{notes_name}: '{key}' has '{name}', which is not a column of {path.name}"
                f"{closest(name, sorted(known))}"
            )


def noted(entries: Mapping[str, str], *names: str) -> str | None:
    """What notes say of a column under the first of its names that they know."""
    return next((entries[name] for name in names if name in entries), None)
