"""Tables that come as columns: Parquet files and pandas frames; parts of the readers of other formats."""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from pliant_tables.arrays import Array
from pliant_tables.cells import Cells, Marks, Problems
from pliant_tables.errors import MissingDependencyError, UserError, closest
from pliant_tables.notes import Notes
from pliant_tables.sheet import ColumnSheet, Sheet
from pliant_tables.wording import listed

SHOWN = 200  # rows that a sample has
UNPACKED = 200_000_000  # maximum unpacked size of a spreadsheet or a .mat, bytes


def is_frame(source: object) -> bool:
    """Return whether an object is a table in memory, like those of pandas."""
    return hasattr(source, "columns") and hasattr(source, "dtypes")


def open_parquet(path: Path, example: str, marks: Marks, notes: Notes, notes_name: str) -> Sheet:
    """Open the table of a Parquet file, batch by batch."""
    parquet = library("pyarrow.parquet", path, "'pliant[parquet]'")
    try:
        file = parquet.ParquetFile(path)
    except Exception as error:  # of pyarrow's many kinds
        raise UserError(f"{path}: it cannot be read as a Parquet file ({error}).") from None

    def batches() -> Iterator[Sequence[Cells | Array]]:
        with file:
            for batch in file.iter_batches():
                yield [as_column(column.to_numpy(zero_copy_only=False)) for column in batch.columns]

    return sheet_in_batches(path, file.schema_arrow.names, batches(), marks, notes_name)


def open_frame(frame: Any, path: Path, marks: Marks, notes_name: str) -> Sheet:
    """Open a pandas frame; a named index is a column too."""
    named = [name for name in getattr(frame.index, "names", ()) if name is not None]
    if named:
        frame = frame.reset_index()
    columns = [as_column(_numpy(frame.iloc[:, k])) for k in range(frame.shape[1])]
    return sheet_in_batches(path, list(frame.columns), iter([columns]), marks, notes_name or "the notes")


def _numpy(series: Any) -> np.ndarray:
    """Return a column of a frame as an array, including pandas' own numbers and strings with missing values."""
    kind = getattr(series.dtype, "kind", "O")
    if kind in "biuf":
        return np.asarray(series.to_numpy(dtype=float, na_value=np.nan))
    if kind == "M":
        return np.asarray(series.dt.tz_localize(None).to_numpy("datetime64[us]"))
    values = series.to_numpy(dtype=object, na_value=None) if kind == "O" else series.to_numpy()
    return np.asarray(values)


def sheet_from_columns(
    path: Path,
    columns: Mapping[str, Cells | Array],
    marks: Marks,
    notes_name: str,
    preamble: Sequence[str] = (),
) -> ColumnSheet:
    """Return a sheet of columns in memory, by their names."""
    return sheet_in_batches(path, list(columns), iter([list(columns.values())]), marks, notes_name, preamble)


def sheet_in_batches(
    path: Path,
    names: Sequence[str],
    batches: Iterator[Sequence[Cells | Array]],
    marks: Marks,
    notes_name: str,
    preamble: Sequence[str] = (),
) -> ColumnSheet:
    """Return a sheet of columns that come in batches; raise `UserError` for two columns of one name."""
    names = [str(name).strip() for name in names]
    check_repeated(path, names)
    first = next(batches, ())
    texts = [tuple(map(cell_text, column[:SHOWN])) for column in first]

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


def as_column(array: np.ndarray) -> Cells | Array:
    """Return numbers as floats, everything else as texts; times as ISO texts."""
    if array.dtype.kind in "biuf":
        return array.astype(float)
    if array.dtype.kind == "M":
        texts = np.datetime_as_string(array.astype("datetime64[us]")).tolist()
        return tuple("" if text == "NaT" else text for text in texts)
    if array.dtype.kind == "m":
        return array / np.timedelta64(1, "s")
    return tuple(cell_text(value) for value in array.tolist())


def cell_text(value: object) -> str:
    """Return a cell's value as text, as a CSV would have it."""
    if value is None or value != value:
        return ""
    if isinstance(value, bool):
        return str(int(value))
    if isinstance(value, datetime.timedelta):
        return repr(value.total_seconds())
    if isinstance(value, datetime.datetime):
        return value.isoformat(" ")
    if isinstance(value, float):
        return repr(float(value)).removesuffix(".0")  # numpy's own repr is "np.float64(1.0)"
    return str(value).strip()


def check_repeated(path: Path, names: Sequence[str], where: str = "") -> None:
    """Raise `UserError` for two columns of one name."""
    for name in names:
        if name and names.count(name) > 1:
            raise UserError(f"{path}{where}: column '{name}' stands {names.count(name)} times; keep one.")


def chosen_table(path: Path, tables: Sequence[str], wanted: str | None, what: str, notes_name: str) -> str:
    """Return the only table of a file, or the one that the notes name."""
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


def library(name: str, path: Path, install: str) -> Any:
    """Return a library that reads a format; raise `MissingDependencyError` with how to install it."""
    try:
        return import_module(name)
    except ImportError:
        raise MissingDependencyError(
            f"{path}: reading it needs {name.partition('.')[0]}: pip install {install}"
        ) from None
