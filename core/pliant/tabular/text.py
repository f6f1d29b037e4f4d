"""A table's text as a stream of blocks: bounded memory, every row with its line, every problem told.

Taken as people save it: columns between commas, semicolons or tabs (after the last two decimals may have a comma);
UTF-8 with or without a byte order mark, UTF-16, and Latin-1 where bytes are no UTF-8; comments of Pliant (`#`), COMSOL
(`%`) and Abaqus (`**`); the header in the last comment above the numbers, as COMSOL writes it.
"""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

import numpy as np

from pliant.errors import UserError
from pliant.formatting import plural
from pliant.records.design import Array

BLOCK = 1 << 22  # characters read at a time
SHOWN = 20  # problems that a message lists
ENOUGH = 10_000  # problems after which reading stops
MISSING = ("", "nan", "na", "n/a")
COMMENTS = ("#", "%", "**")
# First bytes of what people take for a table.
NO_TABLES = {
    b"%PDF": "it is a PDF; export the numbers as CSV",
    b"PK\x03\x04": "it is a spreadsheet or an archive; save the table as 'CSV UTF-8'",
    b"\xd0\xcf\x11\xe0": "it is an old spreadsheet; save the table as 'CSV UTF-8'",
}
COMMA_DECIMAL = re.compile(r"[-+]?\d*,\d+([eE][-+]?\d+)?")
QUOTED_LINES = 20  # that a quoted cell may have
# Bytes that are no UTF-8 are read as Latin-1, one by one, so that a large file is read once.
codecs.register_error("latin-1", lambda e: (e.object[e.start : e.end].decode("latin-1"), e.end))  # type: ignore
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
    problems: Problems
    comma: bool = False

    def numbers(self, place: int, column: str) -> Array:
        """A column as floats: NaN where it is blank (or says nan, NA); texts and infinities become problems."""
        cells = self.columns[place]
        if self.comma and "," in (together := "\n".join(cells)):
            plain = "." not in together and together.count("\n") == len(cells) - 1
            if plain:
                cells = tuple(together.replace(",", ".").split("\n"))
            else:
                cells = _with_points(cells, self.lines, column, self.problems)
        return _floats(cells, self.lines, column, self.problems)


@dataclass
class Sheet:
    """An open file: its header has been read, `blocks` gives the rows.

    Attributes:
        header: names as written, stripped, in line `header_line`.
        separator: between columns.
        blank_rows: rows with separators and nothing else, counted while `blocks` runs.
    """

    path: Path
    header: list[str]
    problems: Problems
    file: IO[str]
    rest: str
    line: int
    separator: str = ","
    header_line: int = 1
    blank_rows: int = 0

    def __enter__(self) -> Sheet:
        return self

    def __exit__(self, *_: object) -> None:
        self.file.close()

    def table(self) -> tuple[list[int], list[list[str]]]:
        """Line of each row and cells of each column, stripped, decimals with a point; the first problem is raised."""
        lines: list[int] = []
        columns: list[list[str]] = [[] for _ in self.header]
        for block in self.blocks():
            lines += block.lines.tolist()
            for column, cells in zip(columns, block.columns, strict=True):
                stripped = tuple(cell.strip() for cell in cells)
                column += _with_points(stripped, block.lines, "", self.problems) if block.comma else stripped
        for line, text in self.problems.found[:1]:
            raise UserError(f"{self.path}, line {line}: {text}")
        if not lines:
            raise UserError(f"{self.path}: the table has a header and no rows.")
        return lines, columns

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
        if line and line[0] not in ' \t#%*,;"':
            return True
        if not line.strip() or line.lstrip().startswith(COMMENTS):
            return False
        if line.strip(f'{self.separator} \t"'):
            return True
        self.blank_rows += 1
        return False

    def _parsed(self, texts: list[str], numbers: Array) -> Block:
        width, comma = len(self.header), self.separator != ","
        try:
            rows = list(_reader(texts, self.separator))
            columns = tuple(zip(*rows, strict=True))
            if len(rows) == len(texts) and len(columns) == width:
                return Block(columns, numbers, self.problems, comma)
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
                hint = " (decimals need a point, not a comma)" if len(cells) > width and not comma else ""
                self.problems.add(number, f"{plural(len(cells), 'cell')}, but the header has {width}{hint}")
        columns = tuple(zip(*good, strict=True)) if good else ((),) * width
        return Block(columns, np.array(lines, int), self.problems, comma)

    def _row(self, texts: list[str]) -> tuple[list[str], str]:
        """Cells of one row that may run over lines, and what is wrong with it."""
        try:
            rows = list(_reader(io.StringIO("\n".join(texts), newline=""), self.separator))
        except csv.Error as error:
            return [], str(error)
        return rows[0] if len(rows) == 1 else [], ""


def _reader(lines: Iterable[str], separator: str) -> Iterator[list[str]]:
    return csv.reader(lines, delimiter=separator, skipinitialspace=True, strict=True)


def open_sheet(path: Path, example: str) -> Sheet:
    """Open a table and read its header; `example` is a header for messages.

    Raises `UserError` where there is no file, no text, or no header.
    """
    try:
        with path.open("rb") as raw:
            start = raw.read(256)
        for mark, what in NO_TABLES.items():
            if start.startswith(mark):
                raise UserError(f"{path}: {what}.")
        file = path.open(encoding=_encoding(start), errors="latin-1", newline=None)
    except (OSError, ValueError) as error:
        cause = "no such file" if isinstance(error, FileNotFoundError) else getattr(error, "strerror", error)
        raise UserError(f"{path}: the table cannot be read ({cause}).") from None
    try:
        return _with_header(path, file, example)
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


def _with_header(path: Path, file: IO[str], example: str) -> Sheet:
    text, line, comment = _read(file, path), 0, ""
    if "\0" in text:
        raise UserError(f"{path}: it is not a text file; save the table as 'CSV UTF-8'.")
    while text:
        if "\n" not in text and (new := _read(file, path)):
            if len(text) > BLOCK:
                raise UserError(f"{path}, line {line + 1}: the line is too long for a table row.")
            text += new
            continue
        first, _, text = text.partition("\n")
        line += 1
        if first.strip() and not first.lstrip().startswith(COMMENTS):
            return _headed(path, line, first, text, comment, file, example)
        comment = first.strip().lstrip("".join(COMMENTS)).strip() or comment
        text = text or _read(file, path)
    raise UserError(f"{path}: the table is empty; it needs a header such as {example}.")


def _headed(path: Path, line: int, first: str, rest: str, comment: str, file: IO[str], example: str) -> Sheet:
    marks = ";\t," if ";" in first or "," not in first else ","
    separator = next((mark for mark in marks if mark in first), ",")
    try:
        header = [cell.strip() for cell in next(_reader([first], separator))]
    except csv.Error as error:
        raise UserError(f"{path}, line {line}: the header cannot be read as CSV ({error}).") from None
    start = line + 1
    if all(is_number(cell.replace(",", ".")) for cell in header):
        width = len(header)
        header = [cell.strip() for cell in comment.split(separator)]  # COMSOL's, above the numbers
        rest, start = f"{first}\n{rest}", line
        if len(header) != width or width < 2:
            raise UserError(
                f"{path}, line {line}: the first row holds numbers; write a header above it, such as {example}."
            )
    repeated = sorted({cell for cell in header if cell and header.count(cell) > 1})
    if repeated:
        count = header.count(repeated[0])
        raise UserError(f"{path}, line {line}: column '{repeated[0]}' stands {count} times; keep one.")
    return Sheet(path, header, Problems(path), file, rest, start, separator, line)


def _with_points(cells: Cells, lines: Array, column: str, problems: Problems) -> Cells:
    """Cells whose decimals have a comma, with a point; "1.234,5" may be read in two ways and is a problem."""
    found = []
    for cell, line in zip(cells, lines.tolist(), strict=True):
        text = cell.strip()
        if "," in text and "." in text and is_number(text.replace(",", "").replace(".", "")):
            where = f"column {column}: " if column else ""
            problems.add(
                line,
                f"{where}'{text}' may be read in two ways; write one mark for the decimals and nothing between "
                "thousands",
            )
        found.append(text.replace(",", ".") if COMMA_DECIMAL.fullmatch(text) else cell)
    return tuple(found)


def _floats(cells: Cells, lines: Array, column: str, problems: Problems) -> Array:
    try:
        values = np.fromiter(map(float, cells), float, len(cells))
        plain = "_" not in "".join(cells)  # Python would read 1_5 as 15
    except ValueError:
        plain = False
    if not plain:
        pairs = zip(cells, lines.tolist(), strict=True)
        values = np.array([_number(cell.strip(), line, column, problems) for cell, line in pairs])
    for index in np.flatnonzero(np.isinf(values)):
        problems.add(int(lines[index]), f"column {column} is infinite; leave it blank where nothing was read")
    return values


def _number(text: str, line: int, column: str, problems: Problems) -> float:
    if is_number(text):
        return float(text)
    if text.lower() not in MISSING:
        comma = re.fullmatch(r"[-+]?\d+,\d+", text)
        hint = "decimals need a point" if comma else "leave missing values blank"
        shown = text if len(text) <= 30 else f"{text[:30]}…"
        problems.add(line, f"column {column}: '{shown}' is not a number; {hint}")
    return np.nan


def is_number(text: str) -> bool:
    """Whether a cell holds a number; Python would read 1_5 as 15."""
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text


def _short(text: str) -> str:
    return text if len(text) <= 30 else f"{text[:30]}…"


def _read(file: IO[str], path: Path) -> str:
    try:
        return file.read(BLOCK)
    except UnicodeError:  # of UTF-16; UTF-8 goes on in Latin-1
        raise UserError(f"{path}: it is not a text file; save the table as 'CSV UTF-8'.") from None
    except OSError as error:
        raise UserError(f"{path}: the table cannot be read ({error.strerror}).") from None


def count_lines(path: Path) -> int:
    """Lines of a file, for a progress bar; a scan of its bytes."""
    with path.open("rb") as file:
        return sum(block.count(b"\n") for block in iter(lambda: file.read(BLOCK), b""))


def lines_text(lines: Sequence[int], count: int | None = None) -> str:
    """ "lines 3, 5, 8, …": the first few of `count`."""
    count = len(lines) if count is None else count
    shown = ", ".join(str(line) for line in lines[:5])
    return f"line {shown}" if count == 1 else f"lines {shown}{', …' if count > min(len(lines), 5) else ''}"
