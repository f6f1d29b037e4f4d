"""Open tables of any format: the header has been read, the rows follow in blocks."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from pliant_tables.arrays import Array
from pliant_tables.cells import CellBlock, Cells, Marks, Problems
from pliant_tables.dates import StampClock
from pliant_tables.errors import UserError

ROWS = 65_536  # maximum rows of a block in memory


@dataclass
class Sheet(ABC):
    """A table that is being read.

    Attributes:
        path: the file, or a name for a table in memory.
        header: names as written, stripped, in line `header_line`; with the units of a second line in brackets.
        marks: how numbers are written.
        preamble: lines above the header: comments, and keys and values of instruments.
        separator: the mark between the cells of such lines.
        sample: cells of the first rows, to inspect the content of a column.
        blank_rows: rows with separators and nothing else, counted while `blocks` runs.
        clock: start of each column of time stamps.
    """

    path: Path
    header: list[str]
    problems: Problems
    marks: Marks
    header_line: int = 1
    preamble: tuple[str, ...] = ()
    separator: str = "\t"
    sample: tuple[Sequence[str], ...] = ()
    blank_rows: int = 0
    clock: dict[int, StampClock] = field(default_factory=dict)

    def __enter__(self) -> Sheet:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:  # noqa: B027 - only files need it
        """Close the file."""

    @abstractmethod
    def blocks(self) -> Iterator[CellBlock]:
        """Yield the rows after the header; raise `UserError` if the file is no text or has too many problems."""

    def lines(self) -> int:
        """Return the approximate number of rows, for a progress bar; 0 where it is not needed."""
        return 0

    def first(self, place: int) -> str:
        """Return the first cell of a column that is not blank, or an empty text."""
        cells = (row[place].strip() for row in self.sample if place < len(row))
        return next(filter(None, cells), "")

    def table(self) -> tuple[list[int], list[list[str]]]:
        """Return line of each row and cells of each column, stripped, with decimal points; raise the first problem."""
        lines: list[int] = []
        columns: list[list[str]] = [[] for _ in self.header]
        for block in self.blocks():
            lines += block.lines.tolist()
            for place, column in enumerate(columns):
                column += block.plain_texts(place)
        for line, text in self.problems.found[:1]:
            raise UserError(f"{self.path}, line {line}: {text}")
        if not lines:
            raise UserError(f"{self.path}: the table has a header and no rows.")
        return lines, columns


@dataclass
class ColumnSheet(Sheet):
    """A table whose columns are in memory, or come in batches.

    Attributes:
        batches: of columns, each a tuple of texts or an array of numbers.
        first_line: of the first row, as messages number it.
    """

    batches: Iterator[Sequence[Cells | Array]] = field(default_factory=lambda: iter(()))
    first_line: int = 2

    def blocks(self) -> Iterator[CellBlock]:
        """Yield the batches, divided into blocks."""
        line = self.first_line
        for columns in self.batches:
            count = len(columns[0]) if columns else 0
            for start in range(0, count, ROWS):
                part = tuple(column[start : start + ROWS] for column in columns)
                lines = np.array(range(line + start, line + min(start + ROWS, count)), int)
                yield CellBlock(part, lines, self.problems, self.marks, self.clock)
            line += count


@dataclass
class RowSheet(Sheet):
    """A table of rows of texts in memory, each with its line."""

    rows: Sequence[tuple[int, Sequence[str]]] = ()

    def blocks(self) -> Iterator[CellBlock]:
        """Yield all rows that are not blank."""
        there = [(line, row) for line, row in self.rows if any(row)]
        self.blank_rows += len(self.rows) - len(there)
        for start in range(0, len(there), ROWS):
            part = there[start : start + ROWS]
            columns = tuple(zip(*(row for _, row in part), strict=True))
            yield CellBlock(
                columns, np.array([line for line, _ in part]), self.problems, self.marks, self.clock
            )


@dataclass
class NumberedSheet(Sheet):
    """A table whose rows are numbered from 0 in an additional column: pictures or samples without a clock."""

    inner: Sheet | None = None

    @staticmethod
    def around(inner: Sheet, name: str) -> NumberedSheet:
        """Return a sheet with one more column of this name."""
        sample = tuple((*row, str(k)) for k, row in enumerate(inner.sample))
        return NumberedSheet(
            inner.path,
            [*inner.header, name],
            inner.problems,
            inner.marks,
            inner.header_line,
            inner.preamble,
            inner.separator,
            sample,
            clock=inner.clock,
            inner=inner,
        )

    def close(self) -> None:
        """Close the table."""
        if self.inner is not None:
            self.inner.close()

    def lines(self) -> int:
        """Return the approximate number of rows."""
        return 0 if self.inner is None else self.inner.lines()

    def blocks(self) -> Iterator[CellBlock]:
        """Yield the rows with their numbers."""
        count = 0
        for block in self.inner.blocks() if self.inner is not None else ():
            numbers = np.arange(count, count + len(block.lines), dtype=float)
            count += len(block.lines)
            self.blank_rows = self.inner.blank_rows if self.inner is not None else 0
            yield replace(block, columns=(*block.columns, numbers))
