"""Parsing of cells into numbers and times: decimal points or commas, missing values, problems by line."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pliant_tables.arrays import Array
from pliant_tables.dates import NO_STAMP, StampClock, is_clock_time, is_stamp, microseconds, since_first
from pliant_tables.errors import UserError
from pliant_tables.quantities import BEYOND

SHOWN = 20  # maximum number of problems in a message
NOTHING = 1 / BEYOND
LONGEST_NUMBER = 100  # characters
ENOUGH = 10_000  # number of problems at which reading stops
MISSING = (
    "",
    *["nan", "na", "n/a", "#n/a", "#nv", "-", "–", "--", "---", "null", "none", "nan(ind)", "-nan(ind)"],
)
COMMA_DECIMAL = re.compile(r"[-+]?\d*,\d+([eE][-+]?\d+)?")
THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2}(\.\d{3})+")  # or decimals
COMMA_THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2}(,\d{3})+")
HUNDRED = 100.0  # thousands separators are suspected if whole numbers reach this, and all that have a point
FORTRAN = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+))[dD]([-+]?\d+)")
Cells = tuple[str, ...]


@dataclass
class Problems:
    """Problems with the rows of a file, by line; `advice` states how to proceed."""

    path: Path
    found: list[tuple[int, str]] = field(default_factory=list)
    count: int = 0
    advice: str = "correct the file or say more in its YAML"
    notes: str = ""

    @property
    def notes_name(self) -> str:
        """Return where the user writes what the file does not state."""
        return self.notes or self.path.with_suffix(".yaml").name

    def add(self, line: int, text: str) -> None:
        """Record a problem; the first `SHOWN` are kept, and reading ends at `ENOUGH`."""
        self.count += 1
        if len(self.found) < SHOWN:
            self.found.append((line, text))
        if self.count >= ENOUGH:
            raise self.error(f", and reading stopped at line {line}")

    def error(self, ending: str = "") -> UserError:
        alike: dict[str, list[int]] = {}
        for line, text in sorted(self.found):
            alike.setdefault(text, []).append(line)
        lines = [
            f"  line{'s' * (len(numbers) > 1)} {', '.join(map(str, numbers))}: {text}"
            for text, numbers in alike.items()
        ]
        more = self.count - len(self.found)
        if more or ending:
            lines.append(f"  … and {more} more{ending}")
        rows = "1 problem" if self.count == 1 else f"{self.count} problems"
        return UserError(f"{self.path}: {rows}; {self.advice}:\n" + "\n".join(lines))

    def raise_if_any(self) -> None:
        if self.count:
            raise self.error()


@dataclass(frozen=True)
class Marks:
    """The notation of a table's numbers.

    Attributes:
        comma: decimals may have a comma: commas do not separate the columns.
        commas, points: some decimals of the table certainly have one.
        decimal: the mark that the notes state; the other one then separates thousands.
        missing: texts for a missing value, besides the common ones.
    """

    comma: bool = False
    commas: bool = False
    points: bool = False
    decimal: str | None = None
    missing: frozenset[str] = frozenset()


@dataclass(frozen=True, eq=False)
class CellBlock:
    """A block of rows: the cells of each column (an array if the source has numbers), and (n,) the line of each row.

    Attributes:
        clock: start of each column of time stamps; shared by the blocks of a table.
    """

    columns: tuple[Cells | Array, ...]
    lines: Array
    problems: Problems
    marks: Marks = field(default_factory=Marks)
    clock: dict[int, StampClock] = field(default_factory=dict)

    def texts(self, place: int) -> Cells:
        """Return a column as texts."""
        cells = self.columns[place]
        if isinstance(cells, tuple):
            return cells
        return tuple("" if value != value else repr(value).removesuffix(".0") for value in cells.tolist())

    def plain_texts(self, place: int) -> list[str]:
        """Return a column as stripped texts: numbers in Python's notation, and blanks for missing values."""
        cells = [cell.strip() for cell in self.texts(place)]
        for k, cell in enumerate(cells):
            if cell in self.marks.missing:
                cells[k] = ""
            elif self.marks.decimal is not None or "," in cell or "D" in cell or "d" in cell:
                self.check_ways(cell, int(self.lines[k]), "")
                if (value := number_in(cell, self.marks)) is not None:
                    plain = cell.replace(",", ".")
                    cells[k] = plain if is_number(plain) and "," in cell else repr(value)
        return cells

    def numbers(self, place: int, column: str) -> Array:
        """Return a column as floats: NaN where blank or marked missing; texts and infinities become problems."""
        cells = self.columns[place]
        values = self._parsed(cells, column) if isinstance(cells, tuple) else cells
        if stated := [float(text) for text in self.marks.missing if is_number(text)]:
            values = np.where(np.isin(values, stated), np.nan, values)  # in any notation: -999.0, 9.9E37
        size = np.abs(values)
        for index in np.flatnonzero(size > BEYOND):
            what = (
                "infinite" if np.isinf(size[index]) else f"beyond ±{BEYOND:g}, and no quantity is that large"
            )
            text = f"column {column} is {what}; leave it blank where nothing was read"
            if isinstance(cells, tuple) and np.isfinite(size[index]):
                text += (
                    f", or write 'missing: [\"{float(values[index])!r}\"]' into {self.problems.notes_name}"
                )
            self.problems.add(int(self.lines[index]), text)
        # Their squares underflow; such values are the tail of a decaying filter.
        return np.where(size < NOTHING, 0.0, values) if (size < NOTHING).any() else values

    def _parsed(self, cells: Cells, column: str) -> Array:
        if self.marks.missing:
            cells = tuple("" if cell.strip() in self.marks.missing else cell for cell in cells)
        self._check_thousands(cells, column)
        together = "\n".join(cells)
        if "_" not in together:  # Python would read 1_5 as 15
            if self.marks.decimal is None and self.marks.comma and "," in together and "." not in together:
                together = together.replace(",", ".")
            elif self.marks.decimal == ",":
                together = ""  # points may separate thousands: parse cell by cell
            parts = together.split("\n")
            if len(parts) == len(cells):
                try:
                    return np.fromiter(map(float, parts), float, len(parts))
                except ValueError:
                    pass
        pairs = zip(cells, self.lines.tolist(), strict=True)
        return np.array([self._number(cell, line, column) for cell, line in pairs])

    def _check_thousands(self, cells: Cells, column: str) -> None:
        """Raise `UserError` where points may separate thousands: "1.430" after "990", or with decimal commas."""
        if self.marks.points and self.marks.comma and self.marks.decimal is None:
            marked = [k for k, cell in enumerate(cells) if "," in cell]
            if marked and all(COMMA_THOUSANDS.fullmatch(cells[k].strip()) for k in marked):
                self.check_ways(cells[marked[0]].strip(), int(self.lines[marked[0]]), column)
        pointed = (cell.strip() for cell in cells if "." in cell)
        if self.marks.decimal is not None or not all(map(THOUSANDS.fullmatch, pointed)):
            return
        with_points = [k for k, cell in enumerate(cells) if "." in cell]
        if not with_points:
            return
        whole = [float(cell) for cell in cells if cell.strip().lstrip("+-").isdecimal()]
        largest = max(
            abs(float(cells[k].strip().replace(".", "", cells[k].count(".") - 1))) for k in with_points
        )
        mixed = any(abs(value) >= HUNDRED and abs(value) > largest for value in whole)
        if self.marks.commas or mixed or any("," in cell for cell in cells):
            self.check_ways(
                cells[with_points[0]].strip(), int(self.lines[with_points[0]]), column, thousands=True
            )

    def _number(self, cell: str, line: int, column: str) -> float:
        text = cell.strip()
        value = number_in(text, self.marks)
        if value is not None:
            return value
        if text.lower() in MISSING:
            return np.nan
        self.check_ways(text, line, column)
        shown = text if len(text) <= 30 else f"{text[:30]}…"
        if re.fullmatch(r"[-+]?\d+,\d+", text):
            hint = "decimals need a point"
        else:
            hint = "leave missing values blank"
            if re.fullmatch(r"[^\W\d_][\w #/.-]{0,29}", text):
                hint += f", or write 'missing: [{text}]' into {self.problems.notes_name} if it stands for one"
        self.problems.add(line, f"column {column}: '{shown}' is not a number; {hint}")
        return np.nan

    def check_ways(self, text: str, line: int, column: str, thousands: bool = False) -> None:
        """Raise `UserError` for a number with ambiguous marks, if the notes do not state them."""
        grouped = COMMA_THOUSANDS.fullmatch(text) or (thousands and THOUSANDS.fullmatch(text))
        if self.marks.decimal is None and (two_ways(text) or grouped):
            where = f"column {column}: " if column else ""
            raise UserError(
                f"{self.problems.path}, line {line}: {where}'{text}' may be read in two ways; write "
                f"'decimal: \",\"' or 'decimal: \".\"' into {self.problems.notes_name} to say which mark the decimals "
                "have."
            )

    def seconds(self, place: int, column: str) -> Array:
        """Return a column of time stamps as seconds from the first one of the table; NaN where blank."""
        cells = self.texts(place)
        try:
            stamps = microseconds(cells)
        except ValueError:
            raise UserError(
                f"{self.problems.path}: column {column}: dates such as '{cells[0].strip()[:30]}' may have the month or "
                "the day first; write them as 2026-08-31."
            ) from None
        there = stamps != NO_STAMP
        for k in np.flatnonzero(~there):
            if cells[k].strip().lower() not in MISSING:
                text = f"column {column}: '{cells[k].strip()[:30]}' is no date or time"
                self.problems.add(int(self.lines[k]), text)
        found = np.full(len(cells), np.nan)
        if there.any():
            first = int(stamps[there][0])
            clock = self.clock.setdefault(place, StampClock(first, first))
            found[there] = since_first(stamps[there], clock, is_clock_time(cells[int(np.argmax(there))]))
        return found


def number_in(text: str, marks: Marks) -> float | None:
    """Return the number in a cell, or None."""
    if len(text) > LONGEST_NUMBER:
        return None
    if marks.decimal is not None:
        other = "." if marks.decimal == "," else ","
        if other in text:
            whole = text.partition(marks.decimal)[0]
            if not re.fullmatch(rf"[-+]?\d{{1,3}}(\{other}\d{{3}})+", whole):
                return None
            text = text.replace(other, "")
        text = text.replace(",", ".")
    elif marks.comma and COMMA_DECIMAL.fullmatch(text):
        text = text.replace(",", ".")
    if match := FORTRAN.fullmatch(text):
        text = f"{match[1]}e{match[2]}"
    return float(text) if is_number(text) else None


def is_number(text: str) -> bool:
    """Return whether a cell contains a number; Python would read 1_5 as 15."""
    if len(text) > LONGEST_NUMBER:
        return False
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text


def two_ways(text: str) -> bool:
    """Return whether a cell has a point and a comma, one of which separates thousands."""
    return "," in text and "." in text and is_number(text.replace(",", "").replace(".", ""))


def lines_text(lines: Sequence[int], count: int | None = None) -> str:
    """Return "lines 3, 5, 8, …": the first few of `count`."""
    count = len(lines) if count is None else count
    shown = ", ".join(str(line) for line in lines[:5])
    return f"line {shown}" if count == 1 else f"lines {shown}{', …' if count > min(len(lines), 5) else ''}"


def looks_numeric(cell: str, marks: Marks) -> bool:
    """Return whether a cell contains data: a number or a time stamp, and no mark of a missing value."""
    text = cell.strip()
    if not text or not (text[0].isdigit() or text[0] in "+-.,"):
        return False
    return number_in(text, marks) is not None or two_ways(text) or is_stamp(text)


def any_numeric(cells: Iterable[str], marks: Marks) -> bool:
    """Return whether a row contains data."""
    return any(looks_numeric(cell, marks) for cell in cells)
