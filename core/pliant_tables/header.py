"""Detection of a table's header: below a preamble, with its levels, and the line of units that may follow it.

Loggers, testers and motion capture write lines above the header that are as wide as the table ("Prüfer;M. Müller;;"),
and headers of several lines (marker, quantity, axis). The table begins at the first block of rows that have numbers
wherever most rows have them; the header is the line above that block.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from pliant_tables.cells import MISSING, Marks, any_numeric, looks_numeric
from pliant_tables.levels import NOT_NAMES, combined_names
from pliant_tables.names import bare, is_counter, meanings
from pliant_tables.units import is_unit, unit_at_the_end, unit_in

WINDOW = 2000  # rows that are searched
LABELS = ("unit", "units", "einheit", "einheiten")
BLOCK = 5  # rows of data that certainly belong to the table: fewer may be numbers of a preamble
SAMPLE = 200  # rows from which columns of numbers are identified
LEVELS = 6  # lines above a header that may belong to it
Row = tuple[int, list[str]]  # its index in the file and its cells


@dataclass(frozen=True)
class Found:
    """The position of the header.

    Attributes:
        names: of the columns, with units in brackets where a line of units follows.
        at: index of the header.
        start: index of the first row of data.
        rows: number of matching rows of data below it, in the part that was searched.
    """

    names: list[str]
    at: int
    start: int
    rows: int


def find_header(rows: Sequence[Row], marks: Marks) -> Found | None:
    """Return the row of names right above the table's data, or None.

    Args:
        rows: the first ones of a file, without blank ones and comments.
        marks: how numbers are written.
    """
    data = [any_numeric(cells, marks) for _, cells in rows]
    widths = Counter(len(cells) for (_, cells), numeric in zip(rows, data, strict=True) if numeric)
    named = [
        k
        for k, (_, cells) in enumerate(rows)
        if not data[k] and sum(cell.lower() not in MISSING for cell in cells) > 1
    ]
    width = max(
        (len(rows[k][1]) for k in named if widths[len(rows[k][1])]), key=lambda w: widths[w], default=0
    )
    if not width:
        return None
    named = [k for k in named if len(rows[k][1]) == width]
    first = _first_table_row(rows, data, named, width, marks)
    above = [k for k in named if k < first]
    if not above:
        return None
    end = above[-1]
    stack = [end]  # the lines of names that follow each other down to the data
    while stack[0] - 1 in above:
        stack.insert(0, stack[0] - 1)
    filled = {
        c for _, cells in rows[first : first + 20] if len(cells) == width for c in range(width) if cells[c]
    }
    lines = [k for k in stack if not are_units(rows[k][1])]
    if not lines:
        return None
    best = max(lines, key=lambda k: (*_speaks(rows[k][1], filled), k))
    names = list(rows[best][1])
    if len(set(names)) < len(names):
        names = combined_names(names, _levels_above(rows, data, best), filled)
    units = next((rows[k][1] for k in stack if k > best and are_units(rows[k][1])), None)
    fitting = sum(
        numeric and len(cells) == width
        for (_, cells), numeric in zip(rows[first:], data[first:], strict=True)
    )
    return Found(with_units(names, units) if units else names, rows[best][0], rows[end][0] + 1, fitting)


def _levels_above(rows: Sequence[Row], data: Sequence[bool], at: int) -> list[list[str]]:
    """Return the lines of words right above a header, without lines of identifiers; numbers end them."""
    levels: list[list[str]] = []
    for k in range(at - 1, max(at - LEVELS, 0) - 1, -1):
        identifiers = bool({cell.lower().rstrip(":#") for cell in rows[k][1]} & set(NOT_NAMES))
        if data[k] and not identifiers:
            break
        if not identifiers:
            levels.insert(0, rows[k][1])
    return levels


def _first_table_row(
    rows: Sequence[Row], data: Sequence[bool], named: Sequence[int], width: int, marks: Marks
) -> int:
    """Return the first row of the first block of data, between lines of names, that is not part of a preamble."""
    fitting = [k for k, (_, cells) in enumerate(rows) if data[k] and len(cells) == width]
    looked = fitting[:: max(1, len(fitting) // SAMPLE)]
    counts = Counter(c for k in looked for c, cell in enumerate(rows[k][1]) if looks_numeric(cell, marks))
    usual = [c for c, count in counts.items() if 2 * count >= len(looked)]
    best: list[int] = []
    for above, below in pairwise([0, *named, len(rows)]):
        block: list[int] = []
        for k in range(above, below):
            if data[k] and len(rows[k][1]) == width and _is_table_row([rows[k][1][c] for c in usual], marks):
                block.append(k)
            if len(block) == BLOCK:
                return block[0]
        best = max(best, block, key=len)
    return best[0] if best else len(rows)


def _is_table_row(cells: Sequence[str], marks: Marks) -> bool:
    """Return whether the cells of columns of numbers are numbers, most of them, and missing values."""
    numbers = [looks_numeric(cell, marks) for cell in cells]
    missing = all(number or cell.lower() in MISSING for number, cell in zip(numbers, cells, strict=True))
    return missing and 2 * sum(numbers) >= len(cells)


def _speaks(cells: Sequence[str], filled: set[int]) -> tuple[int, int, int]:
    """Return how many filled columns a row names, minus those of units, and how many of its names are known."""
    known = [
        cell
        for cell in cells
        if unit_in(cell) or unit_at_the_end(cell) or meanings(bare(cell)) or is_counter(cell)
    ]
    units = sum(len(cell) > 1 and is_unit(cell) for cell in cells)
    return sum(bool(cells[c]) for c in filled), -units, len(known)


def are_units(cells: Sequence[str]) -> bool:
    """Return whether a row contains only units and blanks."""
    written = [cell.strip("[]() ") for cell in cells if cell and cell.lower() not in LABELS]
    return bool(written) and all(map(is_unit, written))


def with_units(names: Sequence[str], units: Sequence[str]) -> list[str]:
    """Return names with the units of the second line in brackets, unless they contain one."""
    return [
        f"{name} [{unit.strip('[]() ')}]"
        if name and unit and unit.lower() not in LABELS and unit_in(name) is None
        else name
        for name, unit in zip(names, units, strict=True)
    ]
