"""The beginning of a text file: its encoding, its separator and its header; the rows follow by `text`."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import IO

from pliant_tables.cells import (
    COMMA_DECIMAL,
    COMMA_THOUSANDS,
    THOUSANDS,
    Marks,
    Problems,
    any_numeric,
    is_number,
    looks_numeric,
)
from pliant_tables.clean import clean_header
from pliant_tables.errors import UserError
from pliant_tables.header import WINDOW, Found, Row, find_header
from pliant_tables.preamble import qualisys_header, with_length_unit
from pliant_tables.serial_log import SerialLog, opened_log
from pliant_tables.text import COMMENTS, TextSheet, beginning, csv_reader
from pliant_tables.unit_columns import with_units_beside
from pliant_tables.wording import plural

SEPARATORS = (";", "\t", ",", " ")
AXES = ("x", "y", "z", "X", "Y", "Z")  # ends of the names of positions without a unit
# Bytes that are not UTF-8 are read as Latin-1, one by one, so that a large file is read once.
codecs.register_error("latin-1", lambda e: (e.object[e.start : e.end].decode("latin-1"), e.end))  # type: ignore


def open_text(
    path: Path, example: str, marks: Marks, notes: str = "", header: int | None = None
) -> TextSheet:
    """Open a text file and find its header; arguments and errors as for `open_sheet`."""
    with path.open("rb") as raw:
        start = raw.read(256)
    file = path.open(encoding=_encoding(start), errors="latin-1", newline=None)
    try:
        return _with_header(path, file, example, marks, Problems(path, notes=notes), header or 1)
    except BaseException:
        file.close()
        raise


def _encoding(start: bytes) -> str:
    """Return the encoding from the first bytes: UTF-16 by its mark, or by the zeros between letters; else UTF-8."""
    if start.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    for place, name in ((1, "utf-16-le"), (0, "utf-16-be")):
        if len(start) >= 4 and not any(start[place::2]):
            return name
    return "utf-8-sig"


def _with_header(
    path: Path, file: IO[str], example: str, marks: Marks, problems: Problems, begin: int
) -> TextSheet:
    """Return the sheet; lines before `begin` are preamble."""
    text = beginning(path, file)
    lines = text.split("\n")[:WINDOW]
    if (log := opened_log(io.StringIO(text), lines)) is not None:
        text = log.read()
        lines, file = text.split("\n")[:WINDOW], SerialLog(file, log.separator, log.names)
    written = enumerate(lines[begin - 1 :], begin - 1)
    shown = [k for k, line in written if line.strip() and not line.lstrip().startswith(COMMENTS)]
    if not shown and begin > 1:
        raise UserError(
            f"{path}: 'header: {begin}' in {problems.notes_name} is below the table, or not among the first {WINDOW} "
            "lines."
        )
    if not shown:
        raise UserError(f"{path}: the table is empty; it needs a header such as {example}.")
    separator, found = _found(lines, shown, marks)
    if log is not None and log.names:
        separator, found = log.separator, Found(list(log.names), shown[0], shown[0], len(shown))
    if found is None:
        separator, found = _first_line(path, lines, shown[0], example, marks)
    if any(name.endswith(AXES) for name in found.names):
        found = replace(found, names=with_length_unit(found.names, lines[: found.at], separator))
    rows = [cells for k in shown if k >= found.start and (cells := _cells(lines[k], separator))]
    names, beside = with_units_beside(found.names, rows)
    found = replace(found, names=names)
    count = Counter(filter(None, found.names))
    if repeated := sorted(name for name, times in count.items() if times > 1):
        raise UserError(
            f"{path}, line {found.at + 1}: column '{repeated[0]}' stands {count[repeated[0]]} times; keep one."
        )
    marks = _marks(rows, separator, marks)
    _check_widths(path, found, rows, separator)
    return TextSheet(
        path,
        found.names,
        problems,
        marks,
        header_line=found.at + 1,
        preamble=tuple(line.strip().lstrip("#%* ") for line in lines[: found.at] if line.strip()),
        sample=tuple(row for row in rows if len(row) == len(found.names)),
        file=file,
        rest=text[sum(len(line) + 1 for line in lines[: found.start]) :],
        line=found.start + 1,
        separator=separator,
        beside=beside,
    )


def _cells(line: str, separator: str) -> list[str]:
    """Return the stripped cells of one line; empty if it is not a complete row."""
    try:
        return [cell.strip() for cell in next(csv_reader([line], separator))]
    except csv.Error:
        return []


def _found(lines: Sequence[str], shown: Sequence[int], marks: Marks) -> tuple[str, Found | None]:
    """Return the separator and the header."""
    written = replace(marks, comma=True)
    clean = clean_header(lines, shown, written)
    return (",", clean) if clean is not None else _searched(lines, shown, written)


def _searched(lines: Sequence[str], shown: Sequence[int], written: Marks) -> tuple[str, Found | None]:
    """Return the separator with which most rows fit a header, and that header; it may be in the last comment."""
    best: tuple[str, Found | None] = (",", None)
    for separator in SEPARATORS:
        rows: list[Row] = [(k, cells) for k in shown if (cells := _cells(lines[k], separator))]
        found = (
            qualisys_header(rows, written) if separator == "\t" else None,
            find_header(rows, written),
            _in_comment(lines, rows, separator, written),
            _longer(rows, written),
        )
        for one in found:
            if one is not None and one.rows > (best[1].rows if best[1] is not None else 0):
                best = separator, one
    return best


def _longer(rows: Sequence[Row], marks: Marks) -> Found | None:
    """Return the header if each row of data ends in a separator and the header does not; else None."""
    found = find_header([(k, cells[:-1] if cells[-1] == "" else cells) for k, cells in rows], marks)
    if found is None:
        return None
    data = [cells for k, cells in rows if k >= found.start]
    if any(cells[-1] != "" or len(cells) != len(found.names) + 1 for cells in data):
        return None  # a blank cell at the end of some rows is a missing value
    return replace(found, names=[*found.names, ""])


def _in_comment(lines: Sequence[str], rows: Sequence[Row], separator: str, marks: Marks) -> Found | None:
    """Return the header in the last comment above the first row of numbers, as of COMSOL and numpy; else None."""
    above = [k for k in range(rows[0][0] if rows else 0) if lines[k].strip()]
    if not above or not lines[above[-1]].lstrip().startswith(COMMENTS) or not any_numeric(rows[0][1], marks):
        return None
    header = _cells(lines[above[-1]].strip().lstrip("".join(COMMENTS)).strip(), separator)
    found = find_header([(above[-1], header), *rows], marks)
    return found if found is not None and found.at == above[-1] else None


def _first_line(path: Path, lines: Sequence[str], at: int, example: str, marks: Marks) -> tuple[str, Found]:
    """Return the first line as the header if nothing fits any: for a message, or a table without numbers."""
    first = lines[at]
    candidates = ";\t," if ";" in first or "," not in first else ","
    separator = next((mark for mark in candidates if mark in first), ",")
    try:
        names = [cell.strip() for cell in next(csv_reader([first], separator))]
    except csv.Error as error:
        raise UserError(f"{path}, line {at + 1}: the header cannot be read as CSV ({error}).") from None
    filled = list(filter(None, names))
    if filled and 2 * sum(looks_numeric(name, replace(marks, comma=True)) for name in filled) >= len(filled):
        raise UserError(
            f"{path}, line {at + 1}: the first row holds numbers; write a header above it, such as {example}."
        )
    return separator, Found(names, at, at + 1, 0)


def _marks(rows: Sequence[Sequence[str]], separator: str, marks: Marks) -> Marks:
    """Return the decimal marks of the first rows; cells between commas may have one if none has a point."""
    cells = [cell for row in rows for cell in row]
    commas = any(COMMA_DECIMAL.fullmatch(cell) and not COMMA_THOUSANDS.fullmatch(cell) for cell in cells)
    pointed = [cell for cell in cells if "." in cell and is_number(cell)]
    points = any(not THOUSANDS.fullmatch(cell) for cell in pointed)
    return replace(marks, comma=separator != "," or (commas and not pointed), commas=commas, points=points)


def _check_widths(path: Path, found: Found, rows: Sequence[Sequence[str]], separator: str) -> None:
    """Raise `UserError` where decimal commas in comma-separated columns split the numbers of most rows."""
    width = len(found.names)
    more = [row for row in rows if len(row) > width and all(re.fullmatch(r"[-+]?\d*", c) for c in row[-2:])]
    if separator == "," and len(more) > max(2, len(rows) // 2):
        raise UserError(
            f"{path}: {plural(len(more), 'row')} of the first {len(rows)} have more cells than the header, as decimal "
            "commas between columns that are separated by commas make them; export with semicolons between the "
            "columns, or with decimal points."
        )
