"""Cells as numbers and times: decimals with a point or a comma, marks of missing values, dates, problems by line."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

import numpy as np

from pliant.errors import UserError
from pliant.records.design import Array

SHOWN = 20  # problems that a message lists
ENOUGH = 10_000  # problems after which reading stops
MISSING = (
    "",
    *["nan", "na", "n/a", "#n/a", "#nv", "-", "–", "--", "---", "null", "none", "nan(ind)", "-nan(ind)"],
)
COMMA_DECIMAL = re.compile(r"[-+]?\d*,\d+([eE][-+]?\d+)?")
THOUSANDS = re.compile(r"[-+]?\d{1,3}(\.\d{3})+")  # or decimals
FORTRAN = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+))[dD]([-+]?\d+)")
_ISO = r"(?P<year>\d{4})[-/.](?P<month>\d{1,2})[-/.](?P<day>\d{1,2})"
_DAY = rf"(?:{_ISO}|(?P<d>\d{{1,2}})\.(?P<m>\d{{1,2}})\.(?P<y>\d{{4}}|\d\d))"
_CLOCK = r"(?P<hour>\d{1,2}):(?P<minute>\d{2})(?::(?P<second>\d{2})(?:[.,](?P<fraction>\d{1,9}))?)?"
STAMP = re.compile(
    rf"(?:{_DAY}(?:[T ,]\s*{_CLOCK.replace('?P<', '?P<at_')})?|{_CLOCK})\s*(?:Z|[+-]\d\d:?\d\d)?"
)
SLASHED = re.compile(r"\d{1,2}/\d{1,2}/(\d{4}|\d\d)\b.*")  # day or month first?
Cells = tuple[str, ...]


@dataclass
class Problems:
    """What is wrong with the rows of a file, by line; `advice` says what to do about it."""

    path: Path
    found: list[tuple[int, str]] = field(default_factory=list)
    count: int = 0
    advice: str = "correct the file or say more in its YAML"
    notes: str = ""

    @property
    def notes_name(self) -> str:
        """Where the user writes what the file does not say."""
        return self.notes or self.path.with_suffix(".yaml").name

    def add(self, line: int, text: str) -> None:
        """One more; the first `SHOWN` are kept, and reading ends at `ENOUGH`."""
        self.count += 1
        if len(self.found) < SHOWN:
            self.found.append((line, text))
        if self.count >= ENOUGH:
            raise self.error(f", and reading stopped at line {line}")

    def error(self, ending: str = "") -> UserError:
        lines = [f"  line {line}: {text}" for line, text in sorted(self.found)]
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
    """How the numbers of a table are written.

    Attributes:
        comma: decimals may have a comma: commas do not separate the columns.
        decimal: the mark that the notes state; then the other one stands between thousands.
        missing: texts that stand for a missing value, beside those that everybody writes.
    """

    comma: bool = False
    decimal: str | None = None
    missing: frozenset[str] = frozenset()


@dataclass(frozen=True, eq=False)
class Block:
    """Some rows: the cells of each column (an array where the source has numbers), and (n,) the line of each row.

    Attributes:
        clock: the first time stamp of each column, in microseconds; shared by the blocks of a table.
    """

    columns: tuple[Cells | Array, ...]
    lines: Array
    problems: Problems
    marks: Marks = field(default_factory=Marks)
    clock: dict[int, int] = field(default_factory=dict)

    def texts(self, place: int) -> Cells:
        """A column as texts."""
        cells = self.columns[place]
        if isinstance(cells, tuple):
            return cells
        return tuple("" if value != value else repr(value).removesuffix(".0") for value in cells.tolist())

    def numbers(self, place: int, column: str) -> Array:
        """A column as floats: NaN where it is blank or says so; texts and infinities become problems."""
        cells = self.columns[place]
        if isinstance(cells, tuple):
            values = self._parsed(cells, column)
        else:
            stated = [float(text) for text in self.marks.missing if is_number(text)]
            values = np.where(np.isin(cells, stated), np.nan, cells) if stated else cells
        for index in np.flatnonzero(np.isinf(values)):
            self.problems.add(
                int(self.lines[index]), f"column {column} is infinite; leave it blank where nothing was read"
            )
        return values

    def _parsed(self, cells: Cells, column: str) -> Array:
        if self.marks.missing:
            cells = tuple("" if cell.strip() in self.marks.missing else cell for cell in cells)
        together = "\n".join(cells)
        if "_" not in together:  # Python would read 1_5 as 15
            if self.marks.decimal is None and self.marks.comma and "," in together and "." not in together:
                together = together.replace(",", ".")
            elif self.marks.decimal == ",":
                together = ""  # points may stand between thousands: cell by cell
            parts = together.split("\n")
            if len(parts) == len(cells):
                try:
                    return np.fromiter(map(float, parts), float, len(parts))
                except ValueError:
                    pass
        pairs = list(zip(cells, self.lines.tolist(), strict=True))
        if self.marks.comma and COMMA_DECIMAL.search(together):  # then a point may stand between thousands
            for cell, line in pairs:
                self.check_ways(cell.strip(), line, column, thousands=True)
        return np.array([self._number(cell, line, column) for cell, line in pairs])

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
        """Raise `UserError` for a number whose marks may mean two things, where the notes say nothing of them."""
        if self.marks.decimal is None and (two_ways(text) or (thousands and THOUSANDS.fullmatch(text))):
            where = f"column {column}: " if column else ""
            raise UserError(
                f"{self.problems.path}, line {line}: {where}'{text}' may be read in two ways; write "
                f"'decimal: \",\"' or 'decimal: \".\"' into {self.problems.notes_name} to say which mark the decimals "
                "have."
            )

    def seconds(self, place: int, column: str) -> Array:
        """A column of time stamps as seconds from the first one of the table; NaN where it is blank."""
        cells = self.texts(place)
        stamps = microseconds(cells)
        bad = [k for k in np.flatnonzero(stamps == NO_STAMP) if cells[k].strip().lower() not in MISSING]
        for k in bad:
            self.problems.add(
                int(self.lines[k]), f"column {column}: '{cells[k].strip()[:30]}' is no date or time"
            )
        there = stamps != NO_STAMP
        if not there.any():
            return np.full(len(cells), np.nan)
        first = self.clock.setdefault(place, int(stamps[there][0]))
        return np.where(there, (stamps - first) / 1e6, np.nan)


def number_in(text: str, marks: Marks) -> float | None:
    """The number that a cell holds, or None."""
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
    """Whether a cell holds a number; Python would read 1_5 as 15."""
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text


def two_ways(text: str) -> bool:
    """Whether a cell has a point and a comma, of which one stands between thousands."""
    return "," in text and "." in text and is_number(text.replace(",", "").replace(".", ""))


NO_STAMP = np.iinfo(np.int64).min


def is_stamp(text: str) -> bool:
    """Whether a cell holds a date, a date and a time, or a time of day."""
    return STAMP.fullmatch(text.strip()) is not None


def microseconds(cells: Sequence[str]) -> Array:
    """(n,) microseconds of time stamps; `NO_STAMP` where a cell holds none."""
    try:
        iso = np.array([cell.strip() for cell in cells], "datetime64[us]")
        if not np.isnat(iso).any():
            return iso.astype(np.int64)
    except ValueError:
        pass
    return np.fromiter(map(_microsecond, cells), np.int64, len(cells))


def _microsecond(cell: str) -> int:
    match = STAMP.fullmatch(cell.strip())
    if match is None:
        return int(NO_STAMP)
    found: Mapping[str, str | None] = match.groupdict()

    def part(*names: str, default: str = "0") -> int:
        return int(next((text for name in names if (text := found[name])), default))

    year = part("year", "y", default="1970")
    year += 2000 if year < 100 else 0
    fraction = next((text for name in ("at_fraction", "fraction") if (text := found[name])), "0")
    try:
        day = datetime(year, part("month", "m", default="1"), part("day", "d", default="1"))
    except ValueError:
        return int(NO_STAMP)
    seconds = 3600 * part("at_hour", "hour") + 60 * part("at_minute", "minute") + part("at_second", "second")
    days = (day - datetime(1970, 1, 1)).days
    return (86_400 * days + seconds) * 1_000_000 + int(fraction.ljust(6, "0")[:6])


def lines_text(lines: Sequence[int], count: int | None = None) -> str:
    """ "lines 3, 5, 8, …": the first few of `count`."""
    count = len(lines) if count is None else count
    shown = ", ".join(str(line) for line in lines[:5])
    return f"line {shown}" if count == 1 else f"lines {shown}{', …' if count > min(len(lines), 5) else ''}"


def looks_numeric(cell: str, marks: Marks) -> bool:
    """Whether a cell holds data: a number or a time stamp, and no mark of a missing one."""
    text = cell.strip()
    if not text or not (text[0].isdigit() or text[0] in "+-.,"):
        return False
    return (
        number_in(text, marks) is not None
        or two_ways(text)
        or is_stamp(text)
        or SLASHED.fullmatch(text) is not None
    )


def any_numeric(cells: Iterable[str], marks: Marks) -> bool:
    """Whether a row holds data."""
    return any(looks_numeric(cell, marks) for cell in cells)
