"""Lines of instruments above a table: the rate of its rows, the unit of its positions, the names of markers.

Layouts: Motive ("Export Frame Rate,30", "Length Units,Millimeters" in one line of keys and values), Vicon Nexus (the
rate alone below "Trajectories"), TRC ("DataRate … Units" above their values), Qualisys Track Manager (a key and its
values in each line; the positions have no separate header, and are in mm).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import pairwise

from pliant_tables.cells import MISSING, Marks, looks_numeric
from pliant_tables.header import Found, Row
from pliant_tables.units import unit_in

LENGTHS = {
    "millimeters": "mm",
    "millimetres": "mm",
    "centimeters": "cm",
    "centimetres": "cm",
    "meters": "m",
} | {
    **{"metres": "m", "inches": "inch", "mm": "mm", "cm": "cm", "m": "m"},
}
LENGTH_KEY = re.compile(r"(length ?)?units?|längeneinheit|position units?", re.IGNORECASE)
POSITION = re.compile(r"(?!.*(rot|ang|for|mom|tor|acc|vel|gyr|mag))(.*[\s_:.-])?[xyz]", re.IGNORECASE)
RATE_KEY = re.compile(
    r"(?!orig)(?P<export>export(ed)?\s)?[\w\s]*?(frame|sampl\w*|recording|picture|video|bild|abtast|data|camera|trajector)[\s_-]*"
    r"(rate|frequen\w*|freq)|frequen(cy|z)|fps|trajectories",
    re.IGNORECASE,
)
IN_HZ = re.compile(r"\s*[\[(]?(hz|fps|1/s)[\])]?\s*$", re.IGNORECASE)
IN_TEXT = re.compile(
    r"\b(?:frame|sampl\w*|recording|picture|video|bild\w*|abtast\w*)[\s_-]*(?:rate|frequen\w*|freq)?\b[^\d\n]*?"
    r"(\d+(?:[.,]\d+)?)[\s,;]*(?:fps|hz|1/s)\b|\bfps\b\W*(\d+(?:[.,]\d+)?)",
    re.IGNORECASE,
)
NUMBER = re.compile(r"\d+(?:[.,]\d+)?")


def rates(lines: Sequence[str], separator: str) -> set[float]:
    """Return the rates in Hz that lines above a header state; only the exported one if it is stated."""
    stated: set[float] = set()
    exported: set[float] = set()
    for line in lines:
        stated |= {_number(one or other) for one, other in IN_TEXT.findall(line)}
    for key, value in () if stated else _pairs(lines, separator):
        match = RATE_KEY.fullmatch(IN_HZ.sub("", key))
        if match and NUMBER.fullmatch(IN_HZ.sub("", value)) and _number(IN_HZ.sub("", value)) > 0:
            (exported if match["export"] else stated).add(_number(IN_HZ.sub("", value)))
    return exported or stated


def _number(text: str) -> float:
    return float(text.replace(",", "."))


def with_length_unit(names: Sequence[str], lines: Sequence[str], separator: str) -> list[str]:
    """Return names of a header, positions with the unit of length that the lines above it state."""
    stated = {
        LENGTHS[value.lower()]
        for key, value in _pairs(lines, separator)
        if LENGTH_KEY.fullmatch(key) and value.lower() in LENGTHS
    }
    if len(stated) != 1:
        return list(names)
    (unit,) = stated
    return [f"{n} [{unit}]" if POSITION.fullmatch(n) and unit_in(n) is None else n for n in names]


def _pairs(lines: Sequence[str], separator: str) -> Iterator[tuple[str, str]]:
    """Yield keys with their values: in neighbouring cells, around a colon or "=", or in a cell and the one below."""
    between = r":\s|=" if separator == " " else rf":\s|=|{separator}"
    rows = [[cell.strip(" \"'#%*") for cell in re.split(between, line)] for line in lines]
    for k, row in enumerate(rows):
        yield from pairwise(row)
        if k + 1 < len(rows):
            yield from zip(row, rows[k + 1], strict=False)


def qualisys_header(rows: Sequence[Row], marks: Marks) -> Found | None:
    """Return the columns of a TSV of Qualisys Track Manager, from its names of markers; None for any other file.

    It may contain frames and times, or positions alone, a row for each frame.
    """
    markers = next((cells[1:] for _, cells in rows if cells[0] == "MARKER_NAMES"), None)
    if markers is None:
        return None
    positions = [f"{marker}:{axis} [mm]" for marker in markers if marker for axis in "XYZ"]
    data = [
        (at, cells)
        for at, cells in rows
        if all(_is_position(cell, marks) for cell in cells) and len(cells) > 1
    ]
    for clock in (["Frame", "Time [s]"], []):
        names = [*clock, *positions]
        fitting = [(at, cells) for at, cells in data if len(cells) - (cells[-1] == "") == len(names)]
        if not fitting:
            continue
        at, cells = fitting[0]
        above = max((place for place, _ in rows if place < at), default=at)
        return Found([*names, *[""] * (len(cells) - len(names))], above, at, len(fitting))
    return None


def _is_position(cell: str, marks: Marks) -> bool:
    return looks_numeric(cell, marks) or cell.lower() in MISSING
