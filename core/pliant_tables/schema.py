"""Typed schema per use: the columns a table may have, their units and roles.

A new kind of table needs a `Schema`, `read_columns` and checks of its numbers; see tests/pliant_tables/test_schema.py.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np

from pliant_tables.arrays import Array
from pliant_tables.cells import CellBlock, is_number
from pliant_tables.dates import is_day, is_stamp
from pliant_tables.errors import UserError, closest
from pliant_tables.names import meanings
from pliant_tables.notes import Notes
from pliant_tables.sheet import Sheet
from pliant_tables.units import ENDINGS, SPELLINGS, conversion, fits, stem, unit_in
from pliant_tables.wording import plural

Role = Literal["text", "time", "input", "condition", "cycle", "output", "sigma", "count"]
NOTHING: Mapping[str, str] = {}
Entry = TypeVar("Entry")
CLOCKS = {"millis": ("time", "ms"), "micros": ("time", "us")}  # of microcontrollers
STAMPS, FRAMES = "date", "frames"  # units of a clock with time stamps, or numbers of pictures


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
        role: what it is used for.
        unit: SI unit of `name`.
        scale, shift: value in SI = scale · written value + shift.
        zero: the reading at zero stated in the notes, SI; already included in `shift`.
        in_unit: the unit in which it is written; `STAMPS` for dates or times of day.
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
        """Return the unit of its numbers in the file, in Pliant's spelling; the SI unit for stamps and pictures."""
        return self.unit if self.in_unit in (STAMPS, FRAMES) else SPELLINGS.get(self.in_unit, self.in_unit)

    def written_values(self, block: CellBlock, place: int) -> Array:
        """Return (n,) its numbers in a block as written; seconds from the first of time stamps."""
        return block.seconds(place, self.written) if self.stamped else block.numbers(place, self.written)

    def values(self, block: CellBlock, place: int) -> Array:
        """Return (n,) its numbers in a block, SI."""
        return self.scale * self.written_values(block, place) + self.shift


@dataclass(frozen=True)
class Schema:
    """The columns of one kind of table; `example` is a header for messages."""

    known: tuple[Known, ...]
    example: str

    def find(self, name: str) -> Known | None:
        """Return the family of a column in SI, or None."""
        return next((k for k in self.known if re.fullmatch(k.stem + k.unit_suffix, name)), None)

    def resolve_column(
        self, written: str, name: str, unit: str | None, inputs: frozenset[str], stamped: bool = False
    ) -> FileColumn | None:
        """Return the column that `name` means; None for an unknown name.

        Args:
            written: the name in the file, for messages.
            name: the name after renaming; it may end in another unit of the same kind (`angle_deg`).
            unit: the unit that the notes give for it, which overrides the one in the name.
            inputs: names whose role is "input" in this file, regardless of the schema.
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
        notes: Notes | None = None,
        inputs: frozenset[str] = frozenset(),
        stamped: Mapping[str, str] = NOTHING,
    ) -> dict[str, FileColumn]:
        """Return the known columns of a header by name; raise `UserError` where two mean the same.

        `stamped`: columns with dates or times of day, and the first of each. With a time of day, a date is not read: a
        clock that passes midnight continues.
        """
        rename, units = (notes.rename, notes.units) if notes else ({}, {})
        found: dict[str, FileColumn] = {}
        for written in filter(None, header):
            renamed = noted(rename, written, stem(written)) or written
            unit = noted(units, written, stem(written), renamed)
            try:
                column = self.resolve_column(written, renamed, unit, inputs, written in stamped)
            except UserError as error:
                where = str(path) if path.name else ""
                if notes is not None and unit is not None:
                    key = next(name for name in (written, stem(written), renamed) if name in units)
                    where = f"{notes.at(where, 'units', key)}"
                raise UserError(f"{where}: {error}" if where else str(error)) from None
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
        """Return the name in SI and the unit of a written name.

        `angle_deg` → (`angle_rad`, "deg"); a name in SI → (itself, None); `angle` with a unit → its name in SI.
        """
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
        """Return the name in SI and the unit of a common word, or the name itself if it is ambiguous.

        `Druck` with a unit, or `Druck_mbar` → (`pressure_pa`, "mbar").
        """
        cuts: list[tuple[str, str | None]] = [CLOCKS.get(name.strip().lower(), (name, unit))]
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
        """Return whether a column with this name and unit can only be the known one."""
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
    """Return the rows of an open sheet, with a remark on columns that are not read.

    Raises `UserError` with all cells that are not numbers.
    """
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
    """Return the columns of a sheet with dates or times of day, and the first of each."""
    firsts = {name: sheet.first(place) for place, name in enumerate(sheet.header)}
    return {
        name: first
        for name, first in firsts.items()
        if first[:1].isdigit() and not is_number(first) and is_stamp(first)
    }


def check_named(
    path: Path,
    notes_name: str,
    key: str,
    named: Iterable[str],
    columns: Iterable[str],
    notes: Notes | None = None,
) -> None:
    """Raise `UserError` where a key of the notes names a column that does not exist."""
    known = set(columns)
    for name in named:
        if name not in known:
            raise UserError(
                f"{notes.at(notes_name, key, name) if notes else notes_name}: '{key}' has '{name}', which is not a "
                f"column of {path.name}"
                f"{closest(name, sorted(known))}"
            )


def noted(entries: Mapping[str, Entry], *names: str) -> Entry | None:
    """Return the notes' entry for a column under the first of its names that they contain."""
    return next((entries[name] for name in names if name in entries), None)
