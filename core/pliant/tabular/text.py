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

    def raise_first(self) -> None:
        """Raise the first one alone, as tables do in which every row counts."""
        for line, text in self.found[:1]:
            raise UserError(f"{self.path}, line {line}: {text}")


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

    def rows(self) -> Iterator[tuple[int, list[str]]]:
        """Line and cells of each row, stripped, decimals with a point; the first problem is raised."""
        empty = True
        for block in self.blocks():
            self.problems.raise_first()
            columns = [tuple(cell.strip() for cell in cells) for cells in block.columns]
            if block.comma:
                columns = [_with_points(c, block.lines, "", self.problems) for c in columns]
                self.problems.raise_first()
            for line, cells in zip(block.lines.tolist(), zip(*columns, strict=True), strict=True):
                empty = False
                yield line, list(cells)
        self.problems.raise_first()
        if empty:
            raise UserError(f"{self.path}: the table has a header and no rows.")

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

    def _joined(self, texts: list[str], numbers: Array) -> tuple[list[str], Array]:
        """The rows with those lines put together that one quoted cell runs over; a row has the line of its end."""
        if not any(text.count('"') % 2 for text in texts):
            return texts, numbers
        rows, ends, k = [], [], 0
        while k < len(texts):
            size = 1
            if texts[k].count('"') % 2:
                ending = (n for n in range(2, QUOTED_LINES) if self._is_whole("\n".join(texts[k : k + n])))
                size = next(ending, 1)
            rows.append("\n".join(texts[k : k + size]))
            ends.append(numbers[min(k + size, len(texts)) - 1])
            k += size
        return rows, np.array(ends)

    def _is_whole(self, text: str) -> bool:
        try:
            rows = list(_reader(io.StringIO(text, newline=""), self.separator))
        except csv.Error:
            return False
        return len(rows) == 1 and len(rows[0]) == len(self.header)

    def _parsed(self, texts: list[str], numbers: Array) -> Block:
        width = len(self.header)
        try:
            rows = list(_reader(texts, self.separator))
            if len(rows) == len(texts):
                columns = tuple(zip(*rows, strict=True))
                if len(columns) == width:
                    return Block(columns, numbers, self.problems, self.separator != ",")
        except (csv.Error, ValueError):
            pass  # some row is bad: look for it row by row
        return self._parsed_singly(*self._joined(texts, numbers))

    def _parsed_singly(self, texts: list[str], numbers: Array) -> Block:
        width, good, lines = len(self.header), [], []
        for text, number in zip(texts, numbers.tolist(), strict=True):
            try:
                cells = next(_reader(io.StringIO(text, newline=""), self.separator))
            except csv.Error as error:
                self.problems.add(number, f"it cannot be read as CSV ({error})")
                continue
            if len(cells) == width:
                good.append(cells)
                lines.append(number)
            else:
                more = len(cells) > width and self.separator == ","
                hint = " (decimals need a point, not a comma)" if more else ""
                self.problems.add(number, f"{plural(len(cells), 'cell')}, but the header has {width}{hint}")
        columns = tuple(zip(*good, strict=True)) if good else ((),) * width
        return Block(columns, np.array(lines, int), self.problems, self.separator != ",")


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
        if not first.strip() or first.lstrip().startswith(COMMENTS):
            comment = first.strip().lstrip("".join(COMMENTS)).strip() or comment
            text = text or _read(file, path)
            continue
        return _headed(path, line, first, text, comment, file, example)
    raise UserError(f"{path}: the table is empty; it needs a header such as {example}.")


def _headed(path: Path, line: int, first: str, rest: str, comment: str, file: IO[str], example: str) -> Sheet:
    separator = _separator(first)
    sheet = Sheet(path, [], Problems(path), file, rest, line + 1, separator, line)
    try:
        lead = [cell.strip() for cell in next(_reader([first], separator))]
    except csv.Error as error:
        raise UserError(f"{path}, line {line}: the header cannot be read as CSV ({error}).") from None
    sheet.header = lead
    if all(is_number(cell.replace(",", ".")) for cell in lead):
        sheet.header = [cell.strip() for cell in comment.split(separator)]  # COMSOL's, above the numbers
        sheet.rest, sheet.line = f"{first}\n{rest}", line
        if len(sheet.header) != len(lead) or len(lead) < 2:
            raise UserError(
                f"{path}, line {line}: the first row holds numbers; write a header above it, such as {example}."
            )
    repeated = sorted({cell for cell in sheet.header if cell and sheet.header.count(cell) > 1})
    if repeated:
        count = sheet.header.count(repeated[0])
        raise UserError(f"{path}, line {line}: column '{repeated[0]}' stands {count} times; keep one.")
    return sheet


def _separator(header: str) -> str:
    if "," in header and ";" not in header:
        return ","
    return ";" if ";" in header else "\t" if "\t" in header else ","


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
    if not is_number(text):
        hint = (
            "; decimals need a point"
            if re.fullmatch(r"[-+]?\d+,\d+", text)
            else "; leave missing values blank"
        )
        problems.add(int(lines[index]), f"column {column}: '{_short(text)}' is not a number{hint}")
    elif np.isinf(value := float(text)):
        problems.add(int(lines[index]), f"column {column} is infinite; leave it blank where nothing was read")
    return value


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
