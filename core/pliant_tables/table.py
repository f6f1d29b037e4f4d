"""A whole table in memory, as written: numbers, times and texts by the names of its columns."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pliant_tables.arrays import Array
from pliant_tables.cells import CellBlock, looks_numeric
from pliant_tables.notes import Notes
from pliant_tables.opening import open_sheet
from pliant_tables.schema import stamped
from pliant_tables.sheet import Sheet
from pliant_tables.units import SPELLINGS, unit_at_the_end, unit_in

EXAMPLE = "time_s,pressure_kpa"  # a header, for messages


@dataclass(frozen=True, eq=False)
class LabTable:
    """The rows of a table.

    Attributes:
        columns: by the file's name: (n,) numbers, NaN where a cell is blank; seconds from the first of dates or times
            of day; texts.
        units: unit of each column whose name states one.
        lines: (n,) line of each row in the file.
        preamble: lines above the header.
    """

    columns: dict[str, Array | list[str]]
    units: dict[str, str]
    lines: Array
    preamble: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> Array | list[str]:
        """Return a column."""
        return self.columns[name]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names of the columns."""
        return iter(self.columns)

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.lines)


def read(source: Path | str | Any, notes: Notes | None = None) -> LabTable:
    """Read a table.

    Args:
        source: a text, .xlsx, .mat (to version 7) or Parquet file, or a pandas frame.
        notes: what the table does not state, such as `StatedNotes(decimal=",", missing=["OVERLOAD"])`; its `rename` and
            `units` are for schemas and not used here.

    Raises `UserError` where there is no file, no table or no header, or with the lines of all cells that are no numbers
    in a column of numbers.
    """
    with open_sheet(source, EXAMPLE, notes) as sheet:
        kinds = {name: kind for name, kind in _kinds(sheet).items() if name}
        places = {name: sheet.header.index(name) for name in kinds}
        blocks = [
            (block.lines, [_values(block, places[name], name, kind) for name, kind in kinds.items()])
            for block in sheet.blocks()
        ]
    sheet.problems.raise_if_any()
    lines = np.concatenate([np.zeros(0, int), *(rows for rows, _ in blocks)])
    columns: dict[str, Array | list[str]] = {}
    for k, (name, kind) in enumerate(kinds.items()):
        parts = [values[k] for _, values in blocks]
        whole = [cell for part in parts for cell in part]
        columns[name] = whole if kind == "text" else np.concatenate([np.zeros(0), *parts])
    return LabTable(columns, _units(sheet, kinds), lines, sheet.preamble)


def _kinds(sheet: Sheet) -> dict[str, str]:
    """Return "time", "number" or "text" by column, by the first cell that is not blank."""
    stamps = stamped(sheet)
    kinds = {}
    for place, name in enumerate(sheet.header):
        first = sheet.first(place)
        numeric = not first or looks_numeric(first, sheet.marks) or first in sheet.marks.missing
        kinds[name] = "time" if name in stamps else "number" if numeric else "text"
    return kinds


def _values(block: CellBlock, place: int, name: str, kind: str) -> Any:
    if kind == "text":
        return [cell.strip() for cell in block.texts(place)]
    return block.seconds(place, name) if kind == "time" else block.numbers(place, name)


def _units(sheet: Sheet, kinds: dict[str, str]) -> dict[str, str]:
    written = {
        name: unit_in(name) or unit_at_the_end(name) for name, kind in kinds.items() if kind == "number"
    }
    return {name: SPELLINGS.get(unit, unit) for name, unit in written.items() if unit}
