"""An open table: its header has been read, its rows follow block by block, whatever file they stand in."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pliant.errors import UserError
from pliant.records.design import Array
from pliant.tabular.cells import Block, Cells, Marks, Problems
from pliant.tabular.dates import StampClock

ROWS = 65_536  # of a block that is in memory


@dataclass
class Sheet(ABC):
    """A table that is being read.

    Attributes:
        path: the file, or a name for a table in memory.
        header: names as written, stripped, in line `header_line`; with the units of a second line in brackets.
        marks: how numbers are written.
        preamble: lines above the header: comments, and keys and values of instruments.
        sample: cells of the first rows, to see what a column holds.
        blank_rows: rows with separators and nothing else, counted while `blocks` runs.
        clock: where each column of time stamps began.
    """

    path: Path
    header: list[str]
    problems: Problems
    marks: Marks
    header_line: int = 1
    preamble: tuple[str, ...] = ()
    sample: tuple[Sequence[str], ...] = ()
    blank_rows: int = 0
    clock: dict[int, StampClock] = field(default_factory=dict)

    def __enter__(self) -> Sheet:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:  # noqa: B027 - only files need it
        """Give the file back."""

    @abstractmethod
    def blocks(self) -> Iterator[Block]:
        """The rows after the header. Raises `UserError` where the file is no text or has too many problems."""

    def lines(self) -> int:
        """About how many rows there are, for a progress bar; 0 where nobody needs one."""
        return 0

    def first(self, place: int) -> str:
        """The first cell of a column that is not blank, or an empty text."""
        cells = (row[place].strip() for row in self.sample if place < len(row))
        return next(filter(None, cells), "")

    def table(self) -> tuple[list[int], list[list[str]]]:
        """Line of each row and cells of each column, stripped, decimals with a point; the first problem is raised."""
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

    def blocks(self) -> Iterator[Block]:
        """The batches, cut into blocks."""
        line = self.first_line
        for columns in self.batches:
            count = len(columns[0]) if columns else 0
            for start in range(0, count, ROWS):
                part = tuple(column[start : start + ROWS] for column in columns)
                lines = np.array(range(line + start, line + min(start + ROWS, count)), int)
                yield Block(part, lines, self.problems, self.marks, self.clock)
            line += count


@dataclass
class RowSheet(Sheet):
    """A table of rows of texts in memory, each with its line."""

    rows: Sequence[tuple[int, Sequence[str]]] = ()

    def blocks(self) -> Iterator[Block]:
        """All rows that are not blank."""
        there = [(line, row) for line, row in self.rows if any(row)]
        self.blank_rows += len(self.rows) - len(there)
        for start in range(0, len(there), ROWS):
            part = there[start : start + ROWS]
            columns = tuple(zip(*(row for _, row in part), strict=True))
            yield Block(columns, np.array([line for line, _ in part]), self.problems, self.marks, self.clock)
