"""What a table does not state of itself, and its user does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol


class Notes(Protocol):
    """Notes on a table, wherever they are kept: a YAML file, a block of a study, arguments of a function."""

    @property
    def rename(self) -> Mapping[str, str]:
        """Return the name that each of some columns means, by its name in the file."""
        ...

    @property
    def units(self) -> Mapping[str, str]:
        """Return the unit that each of some columns is written in."""
        ...

    @property
    def missing(self) -> Sequence[str]:
        """Return texts for a missing value, besides the common ones."""
        ...

    @property
    def decimal(self) -> Literal[",", "."] | None:
        """Return the mark of decimals; the other one then separates thousands."""
        ...

    @property
    def header(self) -> int | None:
        """Return the line of the header, if another one would be taken for it."""
        ...

    @property
    def table(self) -> str | None:
        """Return which sheet of a spreadsheet or variable of a .mat is read."""
        ...

    def at(self, otherwise: object, *path: Any) -> str:
        """Return where a key was written, such as "finger.yaml, line 5", or `otherwise`."""
        ...


@dataclass(frozen=True)
class StatedNotes:
    """Notes given in Python; the fields are those of `Notes`."""

    rename: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    missing: Sequence[str] = ()
    decimal: Literal[",", "."] | None = None
    header: int | None = None
    table: str | None = None

    def at(self, otherwise: object, *path: Any) -> str:
        """Return `otherwise`: no file states these notes."""
        return str(otherwise)
