"""A typed schema per use: which columns a table may have, in which unit, what each is for, and the notes beside it.

A new kind of table is a `Schema`, `read_columns` and what its numbers must be; tests/tabular/test_schema.py has one.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np

from pliant.config.loading import load_notes
from pliant.config.measurements import ColumnNotes
from pliant.errors import UserError, closest
from pliant.formatting import plural
from pliant.records.design import Array
from pliant.tabular.cells import Block
from pliant.tabular.dates import is_day, is_stamp
from pliant.tabular.names import meanings
from pliant.tabular.sheet import Sheet
from pliant.tabular.units import ENDINGS, SPELLINGS, conversion, fits, stem, unit_in

Role = Literal["text", "time", "input", "condition", "cycle", "output", "sigma", "count"]
NOTHING: Mapping[str, str] = {}
Entry = TypeVar("Entry")
Notes = TypeVar("Notes", bound=ColumnNotes)
STAMPS, FRAMES = "date", "frames"  # units of a clock that holds time stamps, or numbers of pictures


@dataclass(frozen=True)
class Known:
    """A family of columns: `stem` and `unit_suffix` make the name, as regular expressions."""

    stem: str
    unit_suffix: str
    unit: str
    role: Role


@dataclass(frozen=True)
class FileColumn:
    """A column of a file that Pliant reads.

    Attributes:
        written: its name in the file.
        name: Pliant's name, SI unit in it.
        role: what it is for.
        unit: SI unit of `name`.
        scale, shift: value in SI = scale · written value + shift.
        zero: what the notes say that it reads at zero, SI; `shift` holds it already.
        in_unit: the unit that it is written in; `STAMPS` where it holds dates or times of day.
    """

    written: str
    name: str
    role: Role
    unit: str
    scale: float = 1.0
    shift: float = 0.0
    in_unit: str = ""
    zero: float = 0.0

    @property
    def stamped(self) -> bool:
        return self.in_unit == STAMPS

    @property
    def unit_as_written(self) -> str:
        """The unit of its numbers in the file, as it is spelt here; the SI unit of a clock of stamps or pictures."""
        return self.unit if self.in_unit in (STAMPS, FRAMES) else SPELLINGS.get(self.in_unit, self.in_unit)

    def written_values(self, block: Block, place: int) -> Array:
        """(n,) its numbers in a block, as they are written; seconds from the first of time stamps."""
        return block.seconds(place, self.written) if self.stamped else block.numbers(place, self.written)

    def values(self, block: Block, place: int) -> Array:
        """(n,) its numbers in a block, SI."""
        return self.scale * self.written_values(block, place) + self.shift


@dataclass(frozen=True)
class Schema:
    """The columns of one kind of table; `example` is a header for messages."""

    known: tuple[Known, ...]
    example: str

    def find(self, name: str) -> Known | None:
        """The family of a column in SI, or None."""
        return next((k for k in self.known if re.fullmatch(k.stem + k.unit_suffix, name)), None)

    def column_of(
        self, written: str, name: str, unit: str | None, inputs: frozenset[str], stamped: bool = False
    ) -> FileColumn | None:
        """The column that `name` means; None for a name that is not known.

        Args:
            written: the name in the file, for messages.
            name: the name after renaming; it may end in another unit of the same kind (`angle_deg`).
            unit: the unit that the notes give for it, before the one in the name.
            inputs: names whose role is "input" in this file, whatever the schema says.
            stamped: whether its cells are dates or times of day.

        Raises `UserError` for a unit that does not fit.
        """
        plain = stem(name).lower().replace(" ", "_")
        prefix = "sigma_" if plain.startswith("sigma_") else ""
        plain = plain.removeprefix(prefix)
        si, suffix_unit = self._in_si(plain, unit or unit_in(written))
        known = self.find(si)
        if known is None and not prefix:
            si, suffix_unit = self._by_word(stem(name), unit or unit_in(written), stamped)
            known = self.find(si)
        if known is None or (prefix and known.role != "output"):
            return None
        role: Role = "sigma" if prefix else "input" if si in inputs else known.role
        scale, shift = 1.0, 0.0
        if stamped and role == "time":
            return FileColumn(written, si, role, known.unit, in_unit=STAMPS)
        source = unit or suffix_unit or (unit_in(written) if known.unit else None)
        if source is not None:
            if not known.unit:
                raise UserError(f"column '{written}' has no unit; take it out of 'units'.")
            scale, shift = conversion(source, known.unit, f"column '{written}'")
        return FileColumn(
            written, prefix + si, role, known.unit, scale, 0.0 if prefix else shift, source or known.unit
        )

    def matched(
        self,
        path: Path,
        header: Sequence[str],
        notes: ColumnNotes | None = None,
        inputs: frozenset[str] = frozenset(),
        stamped: Mapping[str, str] = NOTHING,
    ) -> dict[str, FileColumn]:
        """The columns of a header that are known, by their names; raises `UserError` where two mean the same.

        `stamped`: columns that hold dates or times of day, and the first of each. Beside a time of day a date is not
        read: a clock that passes midnight goes on.
        """
        rename, units = (notes.rename, notes.units) if notes else ({}, {})
        found: dict[str, FileColumn] = {}
        for written in filter(None, header):
            renamed = noted(rename, written, stem(written)) or written
            unit = noted(units, written, stem(written), renamed)
            try:
                column = self.column_of(written, renamed, unit, inputs, written in stamped)
            except UserError as error:
                raise UserError(f"{path}: {error}" if path.name else str(error)) from None
            if column is not None and column.stamped and column.name in found:
                other = found[column.name]
                if other.stamped and is_day(stamped[other.written]) != is_day(stamped[written]):
                    found[column.name] = other if is_day(stamped[written]) else column
                    continue
            if column is not None and column.name in found:
                both = f"'{found[column.name].written}' and '{written}'"
                raise UserError(f"{path}: columns {both} both mean {column.name}; keep one.")
            if column is not None:
                found[column.name] = column
        return found

    def _in_si(self, name: str, unit: str | None) -> tuple[str, str | None]:
        """`angle_deg` → (`angle_rad`, "deg"); a name in SI → (itself, None); `angle` with a unit → its name in SI."""
        if self.find(name) is not None:
            return name, None
        parts = name.split("_")
        cuts: list[tuple[str, str | None]] = [(name, unit)] if unit else []
        cuts += [("_".join(parts[:k]), ENDINGS.get("_".join(parts[k:]))) for k in range(1, len(parts))]
        for start, ending in cuts:
            for known in self.known if ending else ():
                if known.unit and re.fullmatch(known.stem, start) and fits(str(ending), known.unit):
                    return start + known.unit_suffix, ending
        return name, None

    def _by_word(self, name: str, unit: str | None, stamped: bool) -> tuple[str, str | None]:
        """`Druck` with a unit, or `Druck_mbar` → (`pressure_pa`, "mbar"); the name itself where it may mean several."""
        cuts: list[tuple[str, str | None]] = [(name, unit)]
        for k in (k for k, mark in enumerate(name) if mark == "_"):
            after = name[k + 1 :]
            cuts.append((name[:k], SPELLINGS.get(after, ENDINGS.get(after.lower()))))
        found: dict[str, str | None] = {}
        for start, ending in cuts:
            for meant in meanings(start):
                for known in self.known:
                    if re.fullmatch(known.stem, meant) and self._says(known, ending, stamped):
                        found.setdefault(meant + known.unit_suffix, ending)
        return next(iter(found.items())) if len(found) == 1 else (name, None)

    @staticmethod
    def _says(known: Known, unit: str | None, stamped: bool) -> bool:
        """Whether a column that is called so, with this unit, can be only that."""
        if known.role == "time" and stamped:
            return True
        return fits(unit, known.unit) if unit and known.unit else not unit and not known.unit


@dataclass
class Values:
    """The rows of a table: numbers in SI (NaN where a cell is blank) and texts by column, and the line of each row."""

    numbers: dict[str, Array] = field(default_factory=dict)
    texts: dict[str, list[str]] = field(default_factory=dict)
    lines: Array = field(default_factory=lambda: np.zeros(0, int))
    remarks: list[str] = field(default_factory=list)


def read_columns(sheet: Sheet, columns: dict[str, FileColumn]) -> Values:
    """The rows of an open sheet; raises `UserError` with all cells that are no numbers. What is not read is said."""
    places = {name: sheet.header.index(column.written) for name, column in columns.items()}
    numbers: dict[str, list[Array]] = {name: [] for name, c in columns.items() if c.role != "text"}
    texts: dict[str, list[str]] = {name: [] for name, c in columns.items() if c.role == "text"}
    lines: list[Array] = [np.zeros(0, int)]
    for block in sheet.blocks():
        lines.append(block.lines)
        for name, strings in texts.items():
            strings += [cell.strip() for cell in block.texts(places[name])]
        for name, parts in numbers.items():
            column = columns[name]
            parts.append(column.values(block, places[name]))
    sheet.problems.raise_if_any()
    read = {column.written for column in columns.values()}
    unread = [name for name in sheet.header if name and name not in read]
    remarks = [f"Not read: {plural(len(unread), 'column')} {', '.join(unread)}."] if unread else []
    joined = {name: np.concatenate([np.zeros(0), *parts]) for name, parts in numbers.items()}
    return Values(joined, texts, np.concatenate(lines), remarks)


def stamped(sheet: Sheet) -> dict[str, str]:
    """Columns of a sheet that hold dates or times of day, and the first of each."""
    firsts = {name: sheet.first(place) for place, name in enumerate(sheet.header)}
    return {name: first for name, first in firsts.items() if is_stamp(first)}


def notes_beside(path: Path, model: type[Notes]) -> tuple[Notes | None, Path | None]:
    """The YAML notes of the same stem as a table and their file; None where there are none.

    A study may have that stem too: then the file is the study, without notes, since the notes belong into it.
    """
    found = [f for end in (".yaml", ".yml") if (f := path.with_suffix(end)) != path and f.is_file()]
    read = [(notes, file) for file in found if (notes := load_notes(file, model)) is not None]
    if len(read) > 1:
        raise UserError(
            f"{path.parent}: {read[0][1].name} and {read[1][1].name} both hold notes on {path.name}; keep one."
        )
    return read[0] if read else (None, found[0] if found else None)


def check_named(path: Path, notes_name: str, key: str, named: Iterable[str], columns: Iterable[str]) -> None:
    """Raise `UserError` where a key of the notes names a column that is not there: a slip of the pen."""
    known = set(columns)
    for name in named:
        if name not in known:
            raise UserError(
                f"{notes_name}: '{key}' has '{name}', which is not a column of {path.name}"
                f"{closest(name, sorted(known))}"
            )


def noted(entries: Mapping[str, Entry], *names: str) -> Entry | None:
    """What notes say of a column under the first of its names that they know."""
    return next((entries[name] for name in names if name in entries), None)
