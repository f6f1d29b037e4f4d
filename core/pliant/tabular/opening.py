"""Open a table that somebody brings, whatever it was saved as: all become a `Sheet`.

Spreadsheets, MATLAB, Parquet and pandas frames are read here, each library imported when it is needed; text in `text`.
"""

from __future__ import annotations

import datetime
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

import numpy as np

from pliant.config.measurements import ColumnNotes
from pliant.errors import MissingDependencyError, UserError, closest
from pliant.formatting import listed
from pliant.records.design import Array
from pliant.regular_files import require_regular
from pliant.tabular.cells import Cells, Marks, Problems
from pliant.tabular.header import WINDOW, find_header
from pliant.tabular.sheet import ColumnSheet, RowSheet, Sheet
from pliant.tabular.text import open_text

# First bytes of what people take for a table.
NO_TABLES = {
    b"%PDF": "it is a PDF; export the numbers as CSV",
    b"\xd0\xcf\x11\xe0": "it is an old spreadsheet; save the table as .xlsx or 'CSV UTF-8'",
    b"MATLAB 7.3": "it is of MATLAB 7.3; write it by save(…, '-v7')",
    b"\x89HDF": "it is an HDF5 file; write MATLAB's by save(…, '-v7'), others as CSV or Parquet",
}
MOST_COLUMNS, LONGEST_NAME = 2000, 300
FRAME = "DataFrame"  # what messages call a table in memory
SHOWN = 200  # rows that a sample has
UNPACKED = 200_000_000  # bytes that a spreadsheet or a .mat may have when it is unpacked


def open_sheet(
    source: Path | Any, example: str, notes: ColumnNotes | None = None, notes_name: str = ""
) -> Sheet:
    """Open a table and read its header.

    Args:
        source: a text, .xlsx, .mat (to version 7) or Parquet file, or a pandas frame.
        example: a header for messages.
        notes: what the table does not say of itself: the mark of its decimals, words for missing values, which of
            several tables.
        notes_name: where the user would write notes, for messages; the YAML of the same stem by default.

    Raises `UserError` where there is no file, no table, or no header.
    """
    notes = notes or ColumnNotes()
    marks = Marks(decimal=notes.decimal, missing=frozenset(notes.missing))
    if is_frame(source):
        return open_frame(source, Path(FRAME), marks, notes_name)
    path = Path(source)
    try:
        require_regular(path)
        with path.open("rb") as raw:
            start = raw.read(16)
        for mark, what in NO_TABLES.items():
            if start.startswith(mark):
                raise UserError(f"{path}: {what}.")
        for mark, opened in OPENERS.items():
            if start.startswith(mark):
                return _checked(opened(path, example, marks, notes.table, notes_name))
        return _checked(open_text(path, example, marks, notes_name))
    except (OSError, ValueError) as error:
        cause = (
            "no such file"
            if isinstance(error, FileNotFoundError)
            else getattr(error, "strerror", None) or error
        )
        raise UserError(f"{path}: the table cannot be read ({cause}).") from None


def _checked(sheet: Sheet) -> Sheet:
    """The sheet; raises `UserError` for a header that no table has: its names are read word by word."""
    longest = max(map(len, sheet.header), default=0)
    if len(sheet.header) > MOST_COLUMNS or longest > LONGEST_NAME:
        sheet.close()
        what = (
            f"{len(sheet.header)} columns" if longest <= LONGEST_NAME else f"a name of {longest} characters"
        )
        raise UserError(
            f"{sheet.path}, line {sheet.header_line}: the header has {what}; at most {MOST_COLUMNS} columns with "
            f"names of {LONGEST_NAME} characters are read."
        )
    return sheet


def is_frame(source: object) -> bool:
    """Whether something is a table in memory, as pandas has them."""
    return hasattr(source, "columns") and hasattr(source, "dtypes")


def _library(name: str, path: Path, install: str) -> Any:
    try:
        return import_module(name)
    except ImportError:
        raise MissingDependencyError(
            f"{path}: reading it needs {name.partition('.')[0]}: pip install {install}"
        ) from None


def _chosen(path: Path, tables: Sequence[str], wanted: str | None, what: str, notes_name: str) -> str:
    """The one table of a file, or the one that the notes name."""
    names = listed([f"'{name}'" for name in tables])
    if wanted is not None:
        if wanted not in tables:
            raise UserError(
                f"{path}: 'table: {wanted}' is no {what} with a table{closest(wanted, tables)} It has {names}."
            )
        return wanted
    if len(tables) > 1:
        notes = notes_name or path.with_suffix(".yaml").name
        raise UserError(
            f"{path}: the {what}s {names} hold tables; write 'table: {tables[0]}' or another of them into {notes}."
        )
    return tables[0]


def open_spreadsheet(path: Path, example: str, marks: Marks, table: str | None, notes_name: str) -> Sheet:
    """The one worksheet of an .xlsx that holds a table, or the one that is named."""
    no_table = UserError(
        f"{path}: it is a spreadsheet or an archive that cannot be opened; save the table as 'CSV UTF-8'."
    )
    try:
        with zipfile.ZipFile(path) as archive:
            if "xl/workbook.xml" not in archive.namelist():
                raise no_table
            if sum(entry.file_size for entry in archive.infolist()) > UNPACKED:
                raise UserError(
                    f"{path}: it unpacks to more than {UNPACKED / 1e6:.0f} MB; save the table as 'CSV UTF-8'."
                )
    except zipfile.BadZipFile:
        raise no_table from None
    openpyxl = _library("openpyxl", path, "openpyxl")
    try:
        book = openpyxl.load_workbook(path, read_only=True, data_only=True)
        sheets = {sheet.title: _rows(sheet) for sheet in book.worksheets}
        book.close()
    except Exception:  # a damaged archive raises many kinds
        raise no_table from None
    there = {title: rows for title, rows in sheets.items() if len(rows) > 1}
    if not there:
        raise UserError(f"{path}: the table is empty; it needs a header such as {example}.")
    title = _chosen(path, list(there), table, "sheet", notes_name)
    rows = there[title]
    shown = [(k, list(cells)) for k, (_, cells) in enumerate(rows[:WINDOW])]
    found = find_header(shown, marks)
    if found is None:
        line = rows[0][0]
        raise UserError(
            f"{path}, sheet '{title}', line {line}: no row looks like a header; it needs one such as {example}."
        )
    _check_repeated(path, found.names, f", line {rows[found.at][0]}")
    return RowSheet(
        path,
        found.names,
        Problems(path, notes=notes_name),
        marks,
        header_line=rows[found.at][0],
        preamble=tuple(" ".join(filter(None, cells)) for _, cells in rows[: found.at]),
        sample=tuple(cells for _, cells in rows[found.start : found.start + SHOWN]),
        rows=rows[found.start :],
    )


def _check_repeated(path: Path, names: Sequence[str], where: str = "") -> None:
    for name in names:
        if name and names.count(name) > 1:
            raise UserError(f"{path}{where}: column '{name}' stands {names.count(name)} times; keep one.")


def _rows(sheet: Any) -> list[tuple[int, Sequence[str]]]:
    """Rows that are not blank, each with its number, as wide as the widest."""
    rows = [
        (k, [_text(value) for value in row]) for k, row in enumerate(sheet.iter_rows(values_only=True), 1)
    ]
    rows = [(k, cells) for k, cells in rows if any(cells)]
    width = max((max(i for i, cell in enumerate(cells) if cell) + 1 for _, cells in rows), default=0)
    return [(k, (cells + [""] * width)[:width]) for k, cells in rows]


def _text(value: object) -> str:
    """A cell's value as a table in text would have it."""
    if value is None or value != value:
        return ""
    if isinstance(value, bool):
        return str(int(value))
    if isinstance(value, datetime.timedelta):
        return repr(value.total_seconds())
    if isinstance(value, datetime.datetime):
        return value.isoformat(" ")
    if isinstance(value, float):
        return repr(value).removesuffix(".0")
    return str(value).strip()


def open_matlab(path: Path, example: str, marks: Marks, table: str | None, notes_name: str) -> Sheet:
    """Vectors of one length in a .mat: those of a struct, or variables."""
    from scipy.io import loadmat

    if _unpacked_matlab(path) > UNPACKED:
        raise UserError(f"{path}: it unpacks to more than {UNPACKED / 1e6:.0f} MB; save the table as CSV.")
    try:
        found = loadmat(path, simplify_cells=True)
    except Exception as error:  # a damaged file raises many kinds
        raise UserError(f"{path}: it cannot be read as a MATLAB file ({error}).") from None
    variables = {name: value for name, value in found.items() if not name.startswith("__")}
    tables = {name: _vectors(value) for name, value in variables.items() if isinstance(value, Mapping)}
    tables = {name: columns for name, columns in tables.items() if len(columns) > 1}
    if len(loose := _vectors(variables)) > 1:
        tables["variables"] = loose
    if not tables:
        raise UserError(
            f"{path}: no struct and no variables hold columns of one length; write them so, or a table by "
            "s = table2struct(T, 'ToScalar', true), and save(…, '-v7')."
        )
    columns = tables[_chosen(path, list(tables), table, "variable", notes_name)]
    scalars = tuple(f"{name}: {value!s}" for name, value in variables.items() if np.isscalar(value))
    return _of_columns(path, columns, marks, notes_name, scalars)


def _unpacked_matlab(path: Path) -> int:
    """Bytes of a .mat's variables, counted no further than `UNPACKED`; those of version 5 and up may be compressed.

    Source: MAT-File Format, MathWorks: a header of 128 bytes, elements with a tag of type and size, type 15 by zlib.
    """
    total, header, compressed, piece = 0, 128, 15, 1 << 20
    with path.open("rb") as file:
        order: Literal["little", "big"] = "big" if file.read(header)[126:] == b"MI" else "little"
        while total <= UNPACKED and len(tag := file.read(8)) == 8:
            kind, size = (int.from_bytes(tag[k : k + 4], order) for k in (0, 4))
            if kind != compressed:  # of version 4 and of no compression: as large as the file
                return path.stat().st_size
            data, unpack = file.read(size), zlib.decompressobj()
            try:
                while data and total <= UNPACKED:
                    total += len(unpack.decompress(data, piece))
                    data = unpack.unconsumed_tail
            except zlib.error:  # a damaged file: its reader says so
                return total
    return total


def _vectors(values: Mapping[str, Any]) -> dict[str, Cells | Array]:
    """The columns among them: vectors of the length that most have, the longest of those."""
    arrays = {name: np.asarray(value) for name, value in values.items() if not isinstance(value, Mapping)}
    vectors = {name: array for name, array in arrays.items() if array.ndim == 1 and array.size > 1}
    lengths = [array.size for array in vectors.values()]
    usual = max(lengths, key=lambda size: (lengths.count(size), size), default=0)
    return {name: _column(array) for name, array in vectors.items() if array.size == usual}


def _column(array: np.ndarray) -> Cells | Array:
    """Numbers as floats, everything else as texts; times as ISO texts."""
    if array.dtype.kind in "biuf":
        return array.astype(float)
    if array.dtype.kind == "M":
        texts = np.datetime_as_string(array.astype("datetime64[us]")).tolist()
        return tuple("" if text == "NaT" else text for text in texts)
    if array.dtype.kind == "m":
        return array / np.timedelta64(1, "s")
    return tuple(_text(value) for value in array.tolist())


def _of_columns(
    path: Path,
    columns: Mapping[str, Cells | Array],
    marks: Marks,
    notes_name: str,
    preamble: Sequence[str] = (),
) -> ColumnSheet:
    return _in_batches(path, list(columns), iter([list(columns.values())]), marks, notes_name, preamble)


def _in_batches(
    path: Path,
    names: Sequence[str],
    batches: Iterator[Sequence[Cells | Array]],
    marks: Marks,
    notes_name: str,
    preamble: Sequence[str] = (),
) -> ColumnSheet:
    names = [str(name).strip() for name in names]
    _check_repeated(path, names)
    first = next(batches, ())
    texts = [tuple(map(_text, column[:SHOWN])) for column in first]

    def all_batches() -> Iterator[Sequence[Cells | Array]]:
        yield first
        yield from batches

    return ColumnSheet(
        path,
        names,
        Problems(path, notes=notes_name),
        replace(marks, comma=True),
        header_line=1,
        preamble=tuple(preamble),
        sample=tuple(zip(*texts, strict=True)),
        batches=all_batches(),
    )


def open_parquet(path: Path, example: str, marks: Marks, table: str | None, notes_name: str) -> Sheet:
    """The table of a Parquet file, batch by batch."""
    parquet = _library("pyarrow.parquet", path, "'pliant[parquet]'")
    try:
        file = parquet.ParquetFile(path)
    except Exception as error:  # of pyarrow's many kinds
        raise UserError(f"{path}: it cannot be read as a Parquet file ({error}).") from None

    def batches() -> Iterator[Sequence[Cells | Array]]:
        with file:
            for batch in file.iter_batches():
                yield [_column(column.to_numpy(zero_copy_only=False)) for column in batch.columns]

    return _in_batches(path, file.schema_arrow.names, batches(), marks, notes_name)


def open_frame(frame: Any, path: Path, marks: Marks, notes_name: str) -> Sheet:
    """A pandas frame; an index that has a name is a column too."""
    named = [name for name in getattr(frame.index, "names", ()) if name is not None]
    if named:
        frame = frame.reset_index()
    columns = [_column(_numpy(frame.iloc[:, k])) for k in range(frame.shape[1])]
    return _in_batches(path, list(frame.columns), iter([columns]), marks, notes_name or "the notes")


def _numpy(series: Any) -> np.ndarray:
    """A column of a frame; pandas' own numbers and strings with missing values too."""
    kind = getattr(series.dtype, "kind", "O")
    if kind in "biuf":
        return np.asarray(series.to_numpy(dtype=float, na_value=np.nan))
    if kind == "M":
        return np.asarray(series.dt.tz_localize(None).to_numpy("datetime64[us]"))
    values = series.to_numpy(dtype=object, na_value=None) if kind == "O" else series.to_numpy()
    return np.asarray(values)


# By the first bytes of a file.
OPENERS = {
    b"PK\x03\x04": open_spreadsheet,
    b"MATLAB 5.0": open_matlab,
    b"PAR1": open_parquet,
}
