"""MATLAB files to version 7: vectors of one length, of a struct or among the variables."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np

from pliant_tables.arrays import Array
from pliant_tables.cells import Cells, Marks
from pliant_tables.columns import UNPACKED, as_column, chosen_table, sheet_from_columns
from pliant_tables.errors import UserError
from pliant_tables.notes import Notes
from pliant_tables.sheet import Sheet


def open_matlab(path: Path, example: str, marks: Marks, notes: Notes, notes_name: str) -> Sheet:
    """Open vectors of one length in a .mat: those of a struct, or variables."""
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
    columns = tables[chosen_table(path, list(tables), notes.table, "variable", notes_name)]
    scalars = tuple(f"{name}: {value!s}" for name, value in variables.items() if np.isscalar(value))
    return sheet_from_columns(path, columns, marks, notes_name, scalars)


def _unpacked_matlab(path: Path) -> int:
    """Return the bytes of a .mat's variables, counted up to `UNPACKED`; version 5 and up may be compressed.

    Source: MAT-File Format, MathWorks: a header of 128 bytes, elements with a tag of type and size, type 15 by zlib.
    """
    total, header, compressed, piece = 0, 128, 15, 1 << 20
    with path.open("rb") as file:
        order: Literal["little", "big"] = "big" if file.read(header)[126:] == b"MI" else "little"
        while total <= UNPACKED and len(tag := file.read(8)) == 8:
            kind, size = (int.from_bytes(tag[k : k + 4], order) for k in (0, 4))
            if kind != compressed:  # version 4 or uncompressed: as large as the file
                return path.stat().st_size
            data, unpack = file.read(size), zlib.decompressobj()
            try:
                while data and total <= UNPACKED:
                    total += len(unpack.decompress(data, piece))
                    data = unpack.unconsumed_tail
            except zlib.error:  # a damaged file, which its reader reports
                return total
    return total


def _vectors(values: Mapping[str, Any]) -> dict[str, Cells | Array]:
    """Return the columns among some values: vectors of the most frequent length, the longest of those."""
    arrays = {name: np.asarray(value) for name, value in values.items() if not isinstance(value, Mapping)}
    vectors = {name: array for name, array in arrays.items() if array.ndim == 1 and array.size > 1}
    lengths = [array.size for array in vectors.values()]
    usual = max(lengths, key=lambda size: (lengths.count(size), size), default=0)
    return {name: as_column(array) for name, array in vectors.items() if array.size == usual}
