"""Inputs in rows of their own: loggers of several channels write each reading in a row, and the others blank.

Between its own rows an input is taken as a straight line, or as held where the notes say so.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pliant.config.measurements import MeasurementNotes
from pliant.errors import UserError, closest
from pliant.formatting import number, plural
from pliant.records.design import Array
from pliant.records.measurement import Doubt
from pliant_tables.cells import MISSING
from pliant_tables.schema import FileColumn, noted
from pliant_tables.sheet import Sheet
from pliant_tables.units import stem

MOST_BLANK = 0.5  # of the rows with readings: from this share on a blank input is no gap of its sensor
STEEP, LONG = 0.25, 10  # share of an input's range, and rows, on one straight line between two of its rows


@dataclass(frozen=True)
class Line:
    """A long straight line between two rows of an input: times, values, and the rows that lie on it."""

    start_s: float
    end_s: float
    first: float
    last: float
    rows: int


def filled_inputs(
    sheet: Sheet, columns: Sequence[FileColumn], notes: MeasurementNotes, notes_name: str
) -> dict[str, bool]:
    """Return the inputs that are filled between their own rows, and whether each holds until the next one.

    They are those of the notes' `hold`, and those that are blank in most rows with readings. A table without a clock
    has none.
    """
    inputs = {column.name: column for column in columns if column.role == "input"}
    named = {n for c in inputs.values() for n in (c.written, stem(c.written), c.name)}
    for name in notes.hold:
        if name not in named:
            where = notes.at(notes_name, "hold", name)
            raise UserError(
                f"{where}: 'hold' has '{name}', which is no input of {sheet.path.name}{closest(name, sorted(named))}"
            )
    if all(column.role != "time" for column in columns):
        return {}
    readings = [sheet.header.index(c.written) for c in columns if c.role == "output"]
    read = [row for row in sheet.sample if any(_filled(sheet, row, place) for place in readings)]
    found = {}
    for name, column in inputs.items():
        stated = noted(notes.hold, column.written, stem(column.written), name)
        place = sheet.header.index(column.written)
        blank = sum(not _filled(sheet, row, place) for row in read)
        if stated or (blank and blank >= MOST_BLANK * len(read)):
            found[name] = bool(stated)
    return found


def _filled(sheet: Sheet, row: Sequence[str], place: int) -> bool:
    cell = row[place].strip() if place < len(row) else ""
    return cell.lower() not in MISSING and cell not in sheet.marks.missing


def values_between(times: Array, knots: Array, values: Array, hold: bool) -> Array:
    """Return (n,) an input at some times from its own rows; NaN before the first, and behind the last of a line."""
    if not len(knots):
        return np.full(len(times), np.nan)
    if hold:
        before = np.searchsorted(knots, times, side="right") - 1
        return np.where(before >= 0, values[np.maximum(before, 0)], np.nan)
    inside = (times >= knots[0]) & (times <= knots[-1])
    return np.where(inside, np.interp(times, knots, values), np.nan)


def longest_line(times: Array, knots: Array, values: Array) -> Line | None:
    """Return the straight line of an input with the most rows on it, if it is long and steep; else None."""
    if len(knots) < 2 or not np.ptp(values):
        return None
    inside = np.searchsorted(times, knots[1:], side="left") - np.searchsorted(times, knots[:-1], side="right")
    inside = np.where(np.abs(np.diff(values)) > STEEP * np.ptp(values), inside, 0)
    k = int(np.argmax(inside))
    if inside[k] < LONG:
        return None
    return Line(float(knots[k]), float(knots[k + 1]), float(values[k]), float(values[k + 1]), int(inside[k]))


def line_doubt(
    written: str, line: Line, shown: Callable[[float], str], remedy: str, notes_name: str
) -> Doubt:
    """Return the doubt about an input that takes a long straight line, where it may have held its value.

    Args:
        written: the column.
        line: the line.
        shown: writes a value with its unit.
        remedy: the line of the notes that says that values hold.
        notes_name: where it belongs.
    """
    text = (
        f"{written} goes from {shown(line.first)} to {shown(line.last)} in one straight line, from "
        f"{number(line.start_s, 4)} to {number(line.end_s, 4)} s over {plural(line.rows, 'row')}: if it holds each "
        f"value until the next, as in a log of changes, write '{remedy}' into {notes_name}. Nothing was changed."
    )
    return Doubt(written, "hold", text)
