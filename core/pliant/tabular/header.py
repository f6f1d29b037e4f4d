"""Where a table begins in a file: the header below a preamble, and the line of units that may follow it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pliant.tabular.cells import Marks, any_numeric
from pliant.tabular.units import is_unit, unit_in

WINDOW = 2000  # rows that are searched
LABELS = ("unit", "units", "einheit", "einheiten")
Row = tuple[int, list[str]]  # its place in the file and its cells


@dataclass(frozen=True)
class Found:
    """Where the header stands.

    Attributes:
        names: of the columns, with units in brackets where a line of units follows.
        at: place of the header.
        start: place of the first row of data.
        rows: of data below it that fit, in the part that was searched.
    """

    names: list[str]
    at: int
    start: int
    rows: int


def find_header(rows: Sequence[Row], marks: Marks) -> Found | None:
    """The row of names that the most rows of data below it fit, the first of those; None where there is none.

    Args:
        rows: the first ones of a file, without blank ones and comments.
        marks: how numbers are written.
    """
    fitting = [0] * len(rows)  # rows of data below each that have its width
    below: dict[int, int] = {}
    data = [any_numeric(cells, marks) for _, cells in rows]
    for k in range(len(rows) - 1, -1, -1):
        width = len(rows[k][1])
        fitting[k] = below.get(width, 0)
        below[width] = fitting[k] + data[k]
    named = [k for k, (_, cells) in enumerate(rows) if not data[k] and sum(map(bool, cells)) > 1]
    best = max(named, key=lambda k: (fitting[k], -k), default=None)
    if best is None or not fitting[best]:
        return None
    at, names = rows[best]
    second = rows[best + 1][1]
    units = not data[best + 1] and len(second) == len(names) and are_units(second)
    start = rows[best + units][0] + 1
    return Found(with_units(names, second) if units else list(names), at, start, fitting[best])


def are_units(cells: Sequence[str]) -> bool:
    """Whether a row holds units and blanks alone."""
    written = [cell.strip("[]() ") for cell in cells if cell and cell.lower() not in LABELS]
    return bool(written) and all(map(is_unit, written))


def with_units(names: Sequence[str], units: Sequence[str]) -> list[str]:
    """Names with the units of the second line in brackets, where they say none themselves."""
    return [
        f"{name} [{unit.strip('[]() ')}]"
        if name and unit and unit.lower() not in LABELS and unit_in(name) is None
        else name
        for name, unit in zip(names, units, strict=True)
    ]
