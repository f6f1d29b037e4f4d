"""The short path of a clean CSV: a line of names, and rows of its width with numbers where the first row has them.

Most files are so. Their header needs none of the searches of `text_header` and `header`: other separators, levels of
names, lines of units, headers in comments, exports of motion capture.
"""

from __future__ import annotations

from collections.abc import Sequence

from pliant_tables.cells import MISSING, Marks, looks_numeric
from pliant_tables.header import LABELS, Found
from pliant_tables.units import is_unit

LONGEST = 100_000  # characters of a line
ELSEWHERE = '";\t'  # marks that quote cells or separate them in other files


def clean_header(lines: Sequence[str], shown: Sequence[int], marks: Marks) -> Found | None:
    """Return the header of a clean CSV as `header.find_header` would find it, or None for any other file.

    Args:
        lines: the first ones of the file.
        shown: indices of those that are neither blank nor comments.
        marks: how numbers are written.
    """
    rows = []
    for k in shown:
        line = lines[k]
        if len(line) > LONGEST or any(mark in line for mark in ELSEWHERE):
            return None
        rows.append([cell.strip() for cell in line.split(",")])
    names, *data = rows
    if not data or not _are_names(names) or any(len(cells) != len(names) for cells in data):
        return None
    first = {c for c, cell in enumerate(data[0]) if looks_numeric(cell, marks)}
    for cells in data:
        numbers = {c for c, cell in enumerate(cells) if looks_numeric(cell, marks)}
        if not numbers or not numbers <= first:
            return None
    return Found(names, shown[0], shown[0] + 1, len(data))


def _are_names(cells: Sequence[str]) -> bool:
    """Return whether cells are several different words, and not all of them units."""
    words = all(cell[:1].isalpha() and cell.lower() not in MISSING for cell in cells)
    if not words or not 1 < len(cells) == len(set(cells)):
        return False
    return any(cell.lower() not in LABELS and not is_unit(cell.strip("[]() ")) for cell in cells)
