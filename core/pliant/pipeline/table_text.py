"""A table's text as cells: comments of COMSOL, Abaqus and Pliant skipped, separators recognised."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from pliant.errors import UserError

COMMENTS = ("#", "%", "**")
# First bytes of what people take for a table.
NO_TABLES = {
    b"%PDF": "it is a PDF; a law needs the numbers: export the table as CSV",
    b"PK\x03\x04": "it is a spreadsheet or an archive; save the table as 'CSV UTF-8'",
    b"\xd0\xcf\x11\xe0": "it is an old spreadsheet; save the table as 'CSV UTF-8'",
}
_COMMA_DECIMAL = re.compile(r"[-+]?\d*,\d+([eE][-+]?\d+)?")
Cells = list[str]


@dataclass
class _Lines:
    """The lines of a file that are neither blank nor comments; `number` is that of the last one given."""

    text: str
    number: int = 0
    comments: list[str] = field(default_factory=list)

    def __iter__(self) -> Iterator[str]:
        for number, line in enumerate(self.text.splitlines(keepends=True), start=1):
            if not line.strip():
                continue
            if line.lstrip().startswith(COMMENTS):
                self.comments.append(line)
                continue
            self.number = number
            yield line


def table_cells(path: Path, needs: str) -> tuple[int, Cells, Iterator[tuple[int, Cells]]]:
    """Line and cells of the header, then each row's line and cells, stripped; all rows are as long as the header.

    Rows are read as they are asked for, so that the header can be judged before them.

    The separator is the comma, else the tab or semicolon that the header has; after semicolons and tabs decimals may
    have a comma. A first row of numbers takes its header from the comment before it, as COMSOL writes it.

    Args:
        path: the file.
        needs: what the header must have, for messages.

    Raises `UserError` with the file and the line.
    """
    lines = _Lines(_text(path))
    first = next(iter(lines), None)
    if first is None:
        raise UserError(f"{path}: the table is empty; it needs a header with {needs}")
    number, separator = lines.number, _separator(first)
    lead = _split(path, number, first, separator)
    header, skip = lead, 1
    if all(is_number(cell) for cell in lead):
        header, skip = _header_above(path, lines, lead, separator, needs), 0
    return number, header, _rows(path, lines, separator, skip, len(header))


def _rows(path: Path, lines: _Lines, separator: str, skip: int, width: int) -> Iterator[tuple[int, Cells]]:
    """Rows that are not blank, checked; at least one."""
    empty = True
    for line, cells in _read(path, lines, separator, skip):
        if len(cells) != width:
            raise UserError(f"{path}, line {line}: {len(cells)} cells, but the header has {width}")
        if any(cells):
            empty = False
            yield line, cells if separator == "," else [_with_point(path, line, cell) for cell in cells]
    if empty:
        raise UserError(f"{path}: the table has a header and no rows")


def is_number(text: str) -> bool:
    """Whether a cell holds a number."""
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text  # Python would read 1_5 as 15


def _text(path: Path) -> str:
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise UserError(f"{path}: the table cannot be read ({error.strerror})") from error
    for start, what in NO_TABLES.items():
        if raw.startswith(start):
            raise UserError(f"{path}: {what}")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise UserError(f"{path}: it is not a UTF-8 text file; save the table as 'CSV UTF-8'") from error


def _separator(header: str) -> str:
    if "," in header and ";" not in header:
        return ","
    return ";" if ";" in header else "\t" if "\t" in header else ","


def _split(path: Path, number: int, line: str, separator: str) -> Cells:
    try:
        return [c.strip() for c in next(csv.reader([line], delimiter=separator, skipinitialspace=True))]
    except csv.Error as error:
        raise UserError(f"{path}, line {number}: it cannot be read as CSV ({error})") from error


def _read(path: Path, lines: _Lines, separator: str, skip: int) -> Iterator[tuple[int, Cells]]:
    """Rows after the first `skip`; a quoted cell may hold a line break."""
    again = _Lines(lines.text)
    reader = csv.reader(again, delimiter=separator, skipinitialspace=True)
    try:
        for index, cells in enumerate(reader):
            if index >= skip:
                yield again.number, [cell.strip() for cell in cells]
    except csv.Error as error:
        raise UserError(f"{path}, line {again.number}: it cannot be read as CSV ({error})") from error


def _header_above(path: Path, lines: _Lines, lead: Cells, separator: str, needs: str) -> Cells:
    """COMSOL's header: the comment above the first row, if it has as many cells."""
    if lines.comments:
        text = lines.comments[-1].strip().lstrip("".join(COMMENTS)).strip()
        cells = [cell.strip() for cell in text.split(separator)]
        if len(cells) == len(lead) and len(cells) > 1:
            return cells
    raise UserError(
        f"{path}, line {lines.number}: the first row holds numbers; write a header above it with {needs}"
    )


def _with_point(path: Path, line: int, cell: str) -> str:
    """A cell whose decimals have a comma, with a point."""
    if _COMMA_DECIMAL.fullmatch(cell):
        return cell.replace(",", ".")
    if "," in cell and "." in cell and is_number(cell.replace(",", "").replace(".", "")):
        raise UserError(
            f"{path}, line {line}: '{cell}' may be read in two ways; write '.' for the decimals and nothing between "
            "thousands"
        )
    return cell
