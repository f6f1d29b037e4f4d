"""Clocks in two columns, seconds and nanoseconds, as ROS writes its stamps: joined to one column."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from pliant_tables.cells import CellBlock
from pliant_tables.sheet import Sheet

Value = TypeVar("Value")

SECONDS = re.compile(r"(.+?)[._/ ]secs?")
NANOSECONDS = re.compile(r"(.+?)[._/ ](nsecs?|nanosecs?)")


@dataclass
class SplitClockSheet(Sheet):
    """A table with a clock in two columns, which becomes one, `name`, in seconds.

    Attributes:
        name: of the clock: what the names of both columns begin with.
        inner: the table as written.
        places: of its seconds and its nanoseconds.
    """

    name: str = ""
    inner: Sheet | None = None
    places: tuple[int, int] = (0, 1)

    def close(self) -> None:
        """Close the table."""
        if self.inner is not None:
            self.inner.close()

    def lines(self) -> int:
        """Return the approximate number of rows."""
        return 0 if self.inner is None else self.inner.lines()

    def blocks(self) -> Iterator[CellBlock]:
        """Yield the rows with one column for the clock, in the place of its seconds."""
        for block in self.inner.blocks() if self.inner is not None else ():
            seconds, nanoseconds = (block.numbers(place, self.name) for place in self.places)
            self.blank_rows = self.inner.blank_rows if self.inner is not None else 0
            columns = list(block.columns)
            columns[self.places[0]] = seconds + 1e-9 * nanoseconds
            yield replace(block, columns=tuple(_without(columns, self.places[1])))


def with_joined_clock(sheet: Sheet) -> Sheet:
    """Return the sheet with seconds and nanoseconds of one clock joined; the sheet itself if it has no such columns."""
    names = {match[1]: place for place, name in enumerate(sheet.header) if (match := SECONDS.fullmatch(name))}
    for place, name in enumerate(sheet.header):
        match = NANOSECONDS.fullmatch(name)
        if match is None or match[1] not in names:
            continue
        at = names[match[1]]
        header = [match[1] if k == at else written for k, written in enumerate(sheet.header)]
        return SplitClockSheet(
            sheet.path,
            list(_without(header, place)),
            sheet.problems,
            sheet.marks,
            sheet.header_line,
            sheet.preamble,
            sheet.separator,
            tuple(tuple(_without(row, place)) for row in sheet.sample if len(row) == len(sheet.header)),
            clock=sheet.clock,
            name=match[1],
            inner=sheet,
            places=(at, place),
        )
    return sheet


def _without(values: Sequence[Value], place: int) -> list[Value]:
    return [value for k, value in enumerate(values) if k != place]
