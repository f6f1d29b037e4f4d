"""A CSV as a stream of blocks: bounded memory, every row with its line, every problem told."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

import numpy as np

from pliant.errors import UserError
from pliant.records.design import Array

BLOCK = 1 << 22  # characters read at a time
SHOWN = 20  # problems that a message lists
ENOUGH = 10_000  # problems after which reading stops
MISSING = ("", "nan", "na", "n/a")
EXAMPLE = "run,time_s,pressure_pa,angle_rad"
Cells = tuple[str, ...]


@dataclass
class Problems:
    """What is wrong with the rows of a file, by line; `advice` says what to do about it."""

    path: Path
    found: list[tuple[int, str]] = field(default_factory=list)
    count: int = 0
    advice: str = "correct the file or say more in its YAML"

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


@dataclass(frozen=True, eq=False)
class Block:
    """Some rows: one tuple of cells per column, and (n,) the line of each row."""

    columns: tuple[Cells, ...]
    lines: Array


@dataclass
class Sheet:
    """An open file: its header has been read, `blocks` gives the rows.

    Attributes:
        header: names as written, stripped.
        blank_rows: rows with separators and nothing else, counted while `blocks` runs.
    """

    path: Path
    header: list[str]
    problems: Problems
    file: IO[str]
    rest: str
    line: int
    blank_rows: int = 0

    def __enter__(self) -> Sheet:
        return self

    def __exit__(self, *_: object) -> None:
        self.file.close()

    def blocks(self) -> Iterator[Block]:
        """The rows after the header. Raises `UserError` where the file is no text or has too many problems."""
        for first, lines in self._lines():
            kept = [i for i, line in enumerate(lines) if self._is_row(line)]
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
        if line and line[0] not in ' \t#,"':
            return True
        if not line.strip() or line.lstrip().startswith("#"):
            return False
        if line.strip(', \t"'):
            return True
        self.blank_rows += 1
        return False

    def _parsed(self, texts: list[str], numbers: Array) -> Block:
        width = len(self.header)
        try:
            rows = list(csv.reader(texts, skipinitialspace=True, strict=True))
            if len(rows) == len(texts):
                columns = tuple(zip(*rows, strict=True))
                if len(columns) == width:
                    return Block(columns, numbers)
        except (csv.Error, ValueError):
            pass  # some row is bad: look for it row by row
        return self._parsed_singly(texts, numbers)

    def _parsed_singly(self, texts: list[str], numbers: Array) -> Block:
        width, good, lines = len(self.header), [], []
        for text, number in zip(texts, numbers.tolist(), strict=True):
            try:
                cells = next(csv.reader([text], skipinitialspace=True, strict=True))
            except csv.Error as error:
                self.problems.add(number, f"it cannot be read as CSV ({error})")
                continue
            if len(cells) == width:
                good.append(cells)
                lines.append(number)
            else:
                hint = " (decimals need a point, not a comma)" if len(cells) > width else ""
                self.problems.add(number, f"{plural(len(cells), 'cell')}, but the header has {width}{hint}")
        columns = tuple(zip(*good, strict=True)) if good else ((),) * width
        return Block(columns, np.array(lines, int))


def open_sheet(path: Path, example: str = EXAMPLE) -> Sheet:
    """Open a CSV and read its header; `example` is a header for messages.

    Raises `UserError` where there is no file, no text, no header, or another separator than the comma.
    """
    try:
        file = path.open(encoding="utf-8-sig", newline=None)
    except (OSError, ValueError) as error:
        cause = "no such file" if isinstance(error, FileNotFoundError) else getattr(error, "strerror", error)
        raise UserError(f"{path}: the measurement cannot be read ({cause}).") from None
    try:
        return _with_header(path, file, example)
    except BaseException:
        file.close()
        raise


def _with_header(path: Path, file: IO[str], example: str) -> Sheet:
    text, line = _read(file, path), 0
    while text:
        if "\n" not in text and (new := _read(file, path)):
            if len(text) > BLOCK:
                raise UserError(f"{path}, line {line + 1}: the line is too long for a table row.")
            text += new
            continue
        first, _, text = text.partition("\n")
        line += 1
        if not first.strip() or first.lstrip().startswith("#"):
            text = text or _read(file, path)
            continue
        header = _header(path, line, first, example)
        return Sheet(path, header, Problems(path), file, text, line + 1)
    raise UserError(f"{path}: the file is empty; a measurement has a header such as {example}.")


def _header(path: Path, line: int, text: str, example: str) -> list[str]:
    try:
        cells = next(csv.reader([text], skipinitialspace=True, strict=True))
    except csv.Error as error:
        raise UserError(f"{path}, line {line}: the header cannot be read as CSV ({error}).") from None
    header = [cell.strip() for cell in cells]
    for mark, name in ((";", "semicolons"), ("\t", "tabs")):
        if text.count(mark) > len(header) - 1:
            raise UserError(
                f"{path}, line {line}: columns stand between {name}; save the table with ',' between columns and "
                "'.' for decimals (in a spreadsheet: 'CSV UTF-8', English number format)."
            )
    if all(_is_number(cell) for cell in header):
        raise UserError(
            f"{path}, line {line}: the first row holds numbers; write a header above it, such as {example}."
        )
    repeated = sorted({cell for cell in header if cell and header.count(cell) > 1})
    if repeated:
        raise UserError(
            f"{path}, line {line}: column '{repeated[0]}' stands {header.count(repeated[0])} times; keep one."
        )
    return header


def numbers(cells: Cells, lines: Array, column: str, problems: Problems) -> Array:
    """A column as floats: NaN where it is blank (or says nan, NA); texts and infinities become problems."""
    try:
        values = np.fromiter(map(float, cells), float, len(cells))
        if "_" not in "".join(cells):  # Python would read 1_5 as 15
            for index in np.flatnonzero(np.isinf(values)):
                problems.add(
                    int(lines[index]), f"column {column} is infinite; leave it blank where nothing was read"
                )
            return values
    except ValueError:
        pass
    return np.array([_number(cell, i, lines, column, problems) for i, cell in enumerate(cells)])


def _number(cell: str, index: int, lines: Array, column: str, problems: Problems) -> float:
    text = cell.strip()
    if text.lower() in MISSING:
        return np.nan
    value = np.nan
    if not _is_number(text):
        hint = (
            "; decimals need a point"
            if re.fullmatch(r"[-+]?\d+,\d+", text)
            else "; leave missing values blank"
        )
        problems.add(int(lines[index]), f"column {column}: '{_short(text)}' is not a number{hint}")
    elif np.isinf(value := float(text)):
        problems.add(int(lines[index]), f"column {column} is infinite; leave it blank where nothing was read")
    return value


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text


def _short(text: str) -> str:
    return text if len(text) <= 30 else f"{text[:30]}…"


def plural(count: int, noun: str) -> str:
    """ "1 row", "2 rows"."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def _read(file: IO[str], path: Path) -> str:
    try:
        return file.read(BLOCK)
    except UnicodeDecodeError:
        raise UserError(
            f"{path}{_bad_line(path)}: it is not UTF-8 text; save the table as 'CSV UTF-8'."
        ) from None
    except OSError as error:
        raise UserError(f"{path}: the measurement cannot be read ({error.strerror}).") from None


def _bad_line(path: Path) -> str:
    """The first line that is not UTF-8, for a message."""
    with path.open("rb") as file:
        for number, line in enumerate(iter(lambda: file.readline(BLOCK), b""), start=1):
            try:
                line.decode("utf-8")
            except UnicodeDecodeError:
                return f", line {number}"
    return ""


def count_lines(path: Path) -> int:
    """Lines of a file, for a progress bar; a scan of its bytes."""
    with path.open("rb") as file:
        return sum(block.count(b"\n") for block in iter(lambda: file.read(BLOCK), b""))


def listed(lines: Sequence[int], count: int | None = None) -> str:
    """ "lines 3, 5, 8, …": the first few of `count`."""
    count = len(lines) if count is None else count
    shown = ", ".join(str(line) for line in lines[:5])
    return f"line {shown}" if count == 1 else f"lines {shown}{', …' if count > min(len(lines), 5) else ''}"
