"""A typed schema per use: which columns a table may have, in which unit, and what each is for.

A new kind of table is a `Schema`, `read_columns` and what its numbers must be; tests/tabular/test_schema.py has one.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from pliant.errors import UserError
from pliant.formatting import plural
from pliant.records.design import Array
from pliant.tabular.text import Sheet
from pliant.tabular.units import ENDINGS, conversion, fits, stem, unit_in

Role = Literal["text", "time", "input", "condition", "cycle", "output", "sigma", "count"]


@dataclass(frozen=True)
class Known:
    """A family of columns: `stem` and `unit_suffix` make the name, as regular expressions."""

    stem: str
    unit_suffix: str
    unit: str
    role: Role


@dataclass(frozen=True)
class Column:
    """A column of a file that Pliant reads.

    Attributes:
        written: its name in the file.
        name: Pliant's name, SI unit in it.
        role: what it is for.
        unit: SI unit of `name`.
        scale, shift: value in SI = scale · written value + shift.
    """

    written: str
    name: str
    role: Role
    unit: str
    scale: float = 1.0
    shift: float = 0.0


@dataclass(frozen=True)
class Schema:
    """The columns of one kind of table; `example` is a header for messages."""

    known: tuple[Known, ...]
    example: str

    def find(self, name: str) -> Known | None:
        """The family of a column in SI, or None."""
        return next((k for k in self.known if re.fullmatch(k.stem + k.unit_suffix, name)), None)

    def column_of(
        self, written: str, name: str = "", unit: str | None = None, inputs: frozenset[str] = frozenset()
    ) -> Column | None:
        """The column that `name` means; None for a name that is not known.

        Args:
            written: the name in the file, for messages.
            name: the name after renaming; it may end in another unit of the same kind (`angle_deg`).
            unit: the unit that the notes give for it, before the one in the name.
            inputs: names whose role is "input" in this file, whatever the schema says.

        Raises `UserError` for a unit that does not fit.
        """
        plain = stem(name or written).lower().replace(" ", "_")
        prefix = "sigma_" if plain.startswith("sigma_") else ""
        plain = plain.removeprefix(prefix)
        si, suffix_unit = self._in_si(plain, unit or unit_in(written))
        known = self.find(si)
        if known is None or (prefix and known.role != "output"):
            return None
        role: Role = "sigma" if prefix else "input" if si in inputs else known.role
        scale, shift = 1.0, 0.0
        source = unit or suffix_unit or (unit_in(written) if known.unit else None)
        if source is not None:
            if not known.unit:
                raise UserError(f"column '{written}' has no unit; take it out of 'units'.")
            scale, shift = conversion(source, known.unit, f"column '{written}'")
        return Column(written, prefix + si, role, known.unit, scale, 0.0 if prefix else shift)

    def matched(self, path: Path, header: Sequence[str]) -> dict[str, Column]:
        """The columns of a header that are known, by their names; raises `UserError` where two mean the same."""
        found: dict[str, Column] = {}
        for written in filter(None, header):
            column = self.column_of(written)
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


@dataclass
class Values:
    """The rows of a table: numbers in SI (NaN where a cell is blank) and texts by column, and the line of each row."""

    numbers: dict[str, Array] = field(default_factory=dict)
    texts: dict[str, list[str]] = field(default_factory=dict)
    lines: Array = field(default_factory=lambda: np.zeros(0, int))
    remarks: list[str] = field(default_factory=list)


def read_columns(sheet: Sheet, columns: dict[str, Column]) -> Values:
    """The rows of an open sheet; raises `UserError` with all cells that are no numbers. What is not read is said."""
    places = {name: sheet.header.index(column.written) for name, column in columns.items()}
    numbers: dict[str, list[Array]] = {name: [] for name, c in columns.items() if c.role != "text"}
    texts: dict[str, list[str]] = {name: [] for name, c in columns.items() if c.role == "text"}
    lines: list[Array] = [np.zeros(0, int)]
    for block in sheet.blocks():
        lines.append(block.lines)
        for name, strings in texts.items():
            strings += [cell.strip() for cell in block.columns[places[name]]]
        for name, parts in numbers.items():
            column = columns[name]
            parts.append(column.scale * block.numbers(places[name], column.written) + column.shift)
    sheet.problems.raise_if_any()
    read = {column.written for column in columns.values()}
    unread = [name for name in sheet.header if name and name not in read]
    remarks = [f"Not read: {plural(len(unread), 'column')} {', '.join(unread)}."] if unread else []
    joined = {name: np.concatenate([np.zeros(0), *parts]) for name, parts in numbers.items()}
    return Values(joined, texts, np.concatenate(lines), remarks)
