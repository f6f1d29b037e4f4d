"""Streaming of a table's text in blocks: bounded memory, every row with its line, every problem reported.

Accepted formats: columns between commas, semicolons, tabs or blanks (decimals may have a comma if columns are separated
by other marks, or if cells are quoted); UTF-8 with or without a byte order mark, UTF-16, and Latin-1 for bytes that
are not UTF-8; comments of Pliant (`#`), COMSOL (`%`) and Abaqus (`**`); lines of instruments above the header; the
header in the last comment above the numbers, as COMSOL and numpy write it; a line of units below it.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import repeat
from pathlib import Path
from typing import IO

import numpy as np

from pliant_tables.arrays import Array
from pliant_tables.cells import (
    CellBlock,
    Cells,
)
from pliant_tables.errors import UserError
from pliant_tables.header import WINDOW
from pliant_tables.sheet import Sheet
from pliant_tables.unit_columns import note_other_units
from pliant_tables.wording import plural

BLOCK = 1 << 22  # characters read at a time
COMMENTS = ("#", "%", "**")
ODD = ' \t#%*,;"'  # first letters of lines that may not be rows
QUOTED_LINES = 20  # maximum lines of a quoted cell


@dataclass
class TextSheet(Sheet):
    """A text file. `rest` has been read and not yet yielded; its first line is `line`.

    `beside`: columns of units, by their place: the name of the column before each, and its unit.
    """

    file: IO[str] = field(default_factory=io.StringIO)
    rest: str = ""
    line: int = 1
    beside: Mapping[int, tuple[str, str]] = field(default_factory=dict)

    def close(self) -> None:
        """Close the file."""
        self.file.close()

    def lines(self) -> int:
        """Return the number of lines of the file, by a scan of its bytes."""
        with self.path.open("rb") as file:
            return sum(block.count(b"\n") for block in iter(lambda: file.read(BLOCK), b""))

    def blocks(self) -> Iterator[CellBlock]:
        """Yield the rows after the header; raise `UserError` if the file is no text or has too many problems."""
        for first, lines in self._lines():
            # Most lines are rows by their first letter; a call for each takes a fifth of the reading time.
            kept = [i for i, line in enumerate(lines) if line[:1] not in ODD or self._is_row(line)]
            if not kept:
                continue
            texts = lines if len(kept) == len(lines) else [lines[i] for i in kept]
            block = self._parsed(texts, np.array(kept) + first)
            if block.lines.size:
                note_other_units(block, self.beside)
                yield block

    def _lines(self) -> Iterator[tuple[int, list[str]]]:
        """Yield whole lines, block by block, with the number of the first."""
        text, line = self.rest, self.line
        while True:
            new = read_block(self.file, self.path)
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

    def _parsed(self, texts: list[str], numbers: Array) -> CellBlock:
        width = len(self.header)
        if (plain := self._plain(texts, width)) is not None:
            return CellBlock(plain, numbers, self.problems, self.marks, self.clock)
        try:
            rows = list(csv_reader(texts, self.separator))
            columns = tuple(zip(*rows, strict=True))
            if len(rows) == len(texts) and len(columns) == width:
                return CellBlock(columns, numbers, self.problems, self.marks, self.clock)
        except (csv.Error, ValueError):
            pass  # some row is bad: find it row by row
        good, lines, k = [], [], 0
        while k < len(texts):
            sizes = range(2, QUOTED_LINES) if texts[k].count('"') % 2 else ()
            size = next((n for n in sizes if len(self._row(texts[k : k + n])[0]) == width), 1)
            cells, error = self._row(texts[k : k + size])
            number = int(numbers[min(k + size, len(texts)) - 1])  # the number of the row's end
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
        return CellBlock(columns, np.array(lines, int), self.problems, self.marks, self.clock)

    def _plain(self, texts: list[str], width: int) -> tuple[Cells, ...] | None:
        """Return the columns if nothing is quoted and every row is complete, without a list per row; else None."""
        mark = self.separator
        if mark == " ":
            texts = [" ".join(line.split()) for line in texts]
        together = mark.join(texts)
        if '"' in together or set(map(str.count, texts, repeat(mark))) != {width - 1}:
            return None
        cells = together.split(mark)
        return tuple(tuple(cells[k::width]) for k in range(width))

    def _row(self, texts: list[str]) -> tuple[list[str], str]:
        """Return the cells of one row, which may span lines, and the problem with it."""
        try:
            rows = list(csv_reader(io.StringIO("\n".join(texts), newline=""), self.separator))
        except csv.Error as error:
            return [], str(error)
        return rows[0] if len(rows) == 1 else [], ""


def csv_reader(lines: Iterable[str], separator: str) -> Iterator[list[str]]:
    """Return the reader of rows; blanks as separators count once."""
    if separator == " ":
        lines = (" ".join(line.split()) for line in lines)
    return csv.reader(lines, delimiter=separator, skipinitialspace=True, strict=True)


def beginning(path: Path, file: IO[str]) -> str:
    """Return at least the lines that are searched for the header, or all there are."""
    text = ""
    while text.count("\n") < WINDOW and (new := read_block(file, path)):
        text += new
        if "\0" in new:
            raise UserError(f"{path}: it is not a text file; save the table as 'CSV UTF-8'.")
        if len(text) - text.rfind("\n") - 1 > BLOCK:
            raise UserError(f"{path}, line {text.count(chr(10)) + 1}: the line is too long for a table row.")
    return text


def read_block(file: IO[str], path: Path) -> str:
    """Return the next characters of a file; raise `UserError` if it is no text."""
    try:
        return file.read(BLOCK)
    except UnicodeError:  # of UTF-16; UTF-8 is continued in Latin-1
        raise UserError(f"{path}: it is not a text file; save the table as 'CSV UTF-8'.") from None
    except OSError as error:
        raise UserError(f"{path}: the table cannot be read ({error.strerror}).") from None
