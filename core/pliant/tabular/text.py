"""A table's text as a stream of blocks: bounded memory, every row with its line, every problem told.

Taken as people save it: columns between commas, semicolons, tabs or blanks (decimals may have a comma where none
separates columns, or where cells are quoted); UTF-8 with or without a byte order mark, UTF-16, and Latin-1 where bytes
are no UTF-8; comments of Pliant (`#`), COMSOL (`%`) and Abaqus (`**`); lines of instruments above the header; the
header in the last comment above the numbers, as COMSOL and numpy write it; a line of units below it.
"""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import repeat
from pathlib import Path
from typing import IO

import numpy as np

from pliant.errors import UserError
from pliant.formatting import plural
from pliant.records.design import Array
from pliant.tabular.cells import (
    COMMA_DECIMAL,
    COMMA_THOUSANDS,
    THOUSANDS,
    Block,
    Cells,
    Marks,
    Problems,
    any_numeric,
    is_number,
    looks_numeric,
)
from pliant.tabular.header import WINDOW, Found, Row, find_header
from pliant.tabular.sheet import Sheet

BLOCK = 1 << 22  # characters read at a time
COMMENTS = ("#", "%", "**")
ODD = ' \t#%*,;"'  # first letters of lines that may be no rows
SEPARATORS = (";", "\t", ",", " ")
QUOTED_LINES = 20  # that a quoted cell may have
# Bytes that are no UTF-8 are read as Latin-1, one by one, so that a large file is read once.
codecs.register_error("latin-1", lambda e: (e.object[e.start : e.end].decode("latin-1"), e.end))  # type: ignore


@dataclass
class TextSheet(Sheet):
    """A text file. `rest` has been read and not yet given out; its first line is `line`."""

    file: IO[str] = field(default_factory=io.StringIO)
    rest: str = ""
    line: int = 1
    separator: str = ","

    def close(self) -> None:
        """Close the file."""
        self.file.close()

    def lines(self) -> int:
        """Lines of the file; a scan of its bytes."""
        with self.path.open("rb") as file:
            return sum(block.count(b"\n") for block in iter(lambda: file.read(BLOCK), b""))

    def blocks(self) -> Iterator[Block]:
        """The rows after the header. Raises `UserError` where the file is no text or has too many problems."""
        for first, lines in self._lines():
            # Most lines are rows by their first letter; a call for each of them is a fifth of the reading.
            kept = [i for i, line in enumerate(lines) if line[:1] not in ODD or self._is_row(line)]
            if not kept:
                continue
            texts = lines if len(kept) == len(lines) else [lines[i] for i in kept]
            block = self._parsed(texts, np.array(kept) + first)
            if block.lines.size:
                yield block

    def _lines(self) -> Iterator[tuple[int, list[str]]]:
        """Whole lines, block by block, with the number of the first."""
        text, line = self.rest, self.line
        while True:
            new = _read(self.file, self.path)
            text += new
            cut = len(text) if not new else text.rfind("\n") + 1
            if cut == 0 and len(text) > BLOCK:
                raise UserError(f"{self.path}, line {line}: the line is too long for a table row.")
            if lines := text[:cut].split("\n"):
                lines = lines[:-1] if lines[-1] == "" else lines
                yield line, lines
                line += len(lines)
            text = text[cut:]
            if not new:
                return

    def _is_row(self, line: str) -> bool:
        if not line.strip() or line.lstrip().startswith(COMMENTS):
            return False
        if line.strip(f'{self.separator} \t"'):
            return True
        self.blank_rows += 1
        return False

    def _parsed(self, texts: list[str], numbers: Array) -> Block:
        width = len(self.header)
        if (plain := self._plain(texts, width)) is not None:
            return Block(plain, numbers, self.problems, self.marks, self.clock)
        try:
            rows = list(_reader(texts, self.separator))
            columns = tuple(zip(*rows, strict=True))
            if len(rows) == len(texts) and len(columns) == width:
                return Block(columns, numbers, self.problems, self.marks, self.clock)
        except (csv.Error, ValueError):
            pass  # some row is bad: look for it row by row
        good, lines, k = [], [], 0
        while k < len(texts):
            sizes = range(2, QUOTED_LINES) if texts[k].count('"') % 2 else ()
            size = next((n for n in sizes if len(self._row(texts[k : k + n])[0]) == width), 1)
            cells, error = self._row(texts[k : k + size])
            number = int(numbers[min(k + size, len(texts)) - 1])  # that of the row's end
            k += size
            if error:
                self.problems.add(number, f"it cannot be read as CSV ({error})")
            elif len(cells) == width:
                good.append(cells)
                lines.append(number)
            else:
                unquoted = len(cells) > width and self.separator == ","
                hint = " (decimals need a point, not a comma)" if unquoted else ""
                self.problems.add(number, f"{plural(len(cells), 'cell')}, but the header has {width}{hint}")
        columns = tuple(zip(*good, strict=True)) if good else ((),) * width
        return Block(columns, np.array(lines, int), self.problems, self.marks, self.clock)

    def _plain(self, texts: list[str], width: int) -> tuple[Cells, ...] | None:
        """The columns where nothing is quoted and every row has all cells: without a list for each row."""
        mark = self.separator
        if mark == " ":
            texts = [" ".join(line.split()) for line in texts]
        together = mark.join(texts)
        if '"' in together or set(map(str.count, texts, repeat(mark))) != {width - 1}:
            return None
        cells = together.split(mark)
        return tuple(tuple(cells[k::width]) for k in range(width))

    def _row(self, texts: list[str]) -> tuple[list[str], str]:
        """Cells of one row that may run over lines, and what is wrong with it."""
        try:
            rows = list(_reader(io.StringIO("\n".join(texts), newline=""), self.separator))
        except csv.Error as error:
            return [], str(error)
        return rows[0] if len(rows) == 1 else [], ""


def _reader(lines: Iterable[str], separator: str) -> Iterator[list[str]]:
    if separator == " ":
        lines = (" ".join(line.split()) for line in lines)
    return csv.reader(lines, delimiter=separator, skipinitialspace=True, strict=True)


def open_text(path: Path, example: str, marks: Marks, notes: str = "") -> TextSheet:
    """Open a text file and find its header; arguments as of `open_sheet`, which see for errors."""
    with path.open("rb") as raw:
        start = raw.read(256)
    file = path.open(encoding=_encoding(start), errors="latin-1", newline=None)
    try:
        return _with_header(path, file, example, marks, Problems(path, notes=notes))
    except BaseException:
        file.close()
        raise


def _encoding(start: bytes) -> str:
    """Of a file that begins so: UTF-16 by its mark, or by the zeros between the letters; else UTF-8."""
    if start.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    for place, name in ((1, "utf-16-le"), (0, "utf-16-be")):
        if len(start) >= 4 and not any(start[place::2]):
            return name
    return "utf-8-sig"


def _with_header(path: Path, file: IO[str], example: str, marks: Marks, problems: Problems) -> TextSheet:
    text = _beginning(path, file)
    lines = text.split("\n")[:WINDOW]
    shown = [k for k, line in enumerate(lines) if line.strip() and not line.lstrip().startswith(COMMENTS)]
    if not shown:
        raise UserError(f"{path}: the table is empty; it needs a header such as {example}.")
    separator, found = _found(lines, shown, marks)
    if found is None:
        separator, found = _first_line(path, lines, shown[0], example, marks)
    count = Counter(filter(None, found.names))
    if repeated := sorted(name for name, times in count.items() if times > 1):
        raise UserError(
            f"{path}, line {found.at + 1}: column '{repeated[0]}' stands {count[repeated[0]]} times; keep one."
        )
    rows = [cells for k in shown if k >= found.start and (cells := _cells(lines[k], separator))]
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
    )


def _beginning(path: Path, file: IO[str]) -> str:
    """At least the lines that are searched for the header, or all there are."""
    text = ""
    while text.count("\n") < WINDOW and (new := _read(file, path)):
        text += new
        if "\0" in new:
            raise UserError(f"{path}: it is not a text file; save the table as 'CSV UTF-8'.")
        if len(text) - text.rfind("\n") - 1 > BLOCK:
            raise UserError(f"{path}, line {text.count(chr(10)) + 1}: the line is too long for a table row.")
    return text


def _cells(line: str, separator: str) -> list[str]:
    """Stripped cells of one line; none where it is no row by itself."""
    try:
        return [cell.strip() for cell in next(_reader([line], separator))]
    except csv.Error:
        return []


def _found(lines: Sequence[str], shown: Sequence[int], marks: Marks) -> tuple[str, Found | None]:
    """The separator with which most rows fit a header, and that header; it may stand in the last comment."""
    best: tuple[str, Found | None] = (",", None)
    for separator in SEPARATORS:
        written = replace(marks, comma=True)
        rows: list[Row] = [(k, cells) for k in shown if (cells := _cells(lines[k], separator))]
        found = (
            find_header(rows, written),
            _in_comment(lines, rows, separator, written),
            _longer(rows, written),
        )
        for one in found:
            if one is not None and one.rows > (best[1].rows if best[1] is not None else 0):
                best = separator, one
    return best


def _longer(rows: Sequence[Row], marks: Marks) -> Found | None:
    """The header where each row of data ends in a separator, and the header does not."""
    found = find_header([(k, cells[:-1] if cells[-1] == "" else cells) for k, cells in rows], marks)
    return found if found is None else replace(found, names=[*found.names, ""])


def _in_comment(lines: Sequence[str], rows: Sequence[Row], separator: str, marks: Marks) -> Found | None:
    """The header in the last comment above the first row, which holds numbers: COMSOL's and numpy's."""
    above = [k for k in range(rows[0][0] if rows else 0) if lines[k].strip()]
    if not above or not lines[above[-1]].lstrip().startswith(COMMENTS) or not any_numeric(rows[0][1], marks):
        return None
    header = _cells(lines[above[-1]].strip().lstrip("".join(COMMENTS)).strip(), separator)
    found = find_header([(above[-1], header), *rows], marks)
    return found if found is not None and found.at == above[-1] else None


def _first_line(path: Path, lines: Sequence[str], at: int, example: str, marks: Marks) -> tuple[str, Found]:
    """The first line as the header, where nothing fits any: for a message, or a table without numbers."""
    first = lines[at]
    candidates = ";\t," if ";" in first or "," not in first else ","
    separator = next((mark for mark in candidates if mark in first), ",")
    try:
        names = [cell.strip() for cell in next(_reader([first], separator))]
    except csv.Error as error:
        raise UserError(f"{path}, line {at + 1}: the header cannot be read as CSV ({error}).") from None
    filled = list(filter(None, names))
    if filled and 2 * sum(looks_numeric(name, replace(marks, comma=True)) for name in filled) >= len(filled):
        raise UserError(
            f"{path}, line {at + 1}: the first row holds numbers; write a header above it, such as {example}."
        )
    return separator, Found(names, at, at + 1, 0)


def _marks(rows: Sequence[Sequence[str]], separator: str, marks: Marks) -> Marks:
    """Which marks the decimals of the first rows have; cells between commas may have one where none has a point."""
    cells = [cell for row in rows for cell in row]
    commas = any(COMMA_DECIMAL.fullmatch(cell) and not COMMA_THOUSANDS.fullmatch(cell) for cell in cells)
    pointed = [cell for cell in cells if "." in cell and is_number(cell)]
    points = any(not THOUSANDS.fullmatch(cell) for cell in pointed)
    return replace(marks, comma=separator != "," or (commas and not pointed), commas=commas, points=points)


def _check_widths(path: Path, found: Found, rows: Sequence[Sequence[str]], separator: str) -> None:
    """Raise `UserError` where decimal commas between commas tear the numbers of most rows apart."""
    width = len(found.names)
    more = [row for row in rows if len(row) > width and all(re.fullmatch(r"[-+]?\d*", c) for c in row[-2:])]
    if separator == "," and len(more) > max(2, len(rows) // 2):
        raise UserError(
            f"{path}: {plural(len(more), 'row')} of the first {len(rows)} have more cells than the header, as decimal "
            "commas between columns that are separated by commas make them; export with semicolons between the "
            "columns, or with decimal points."
        )


def _read(file: IO[str], path: Path) -> str:
    try:
        return file.read(BLOCK)
    except UnicodeError:  # of UTF-16; UTF-8 goes on in Latin-1
        raise UserError(f"{path}: it is not a text file; save the table as 'CSV UTF-8'.") from None
    except OSError as error:
        raise UserError(f"{path}: the table cannot be read ({error.strerror}).") from None
