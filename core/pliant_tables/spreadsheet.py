"""Spreadsheets: the worksheet of an .xlsx that contains a table."""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pliant_tables.cells import Marks, Problems
from pliant_tables.columns import SHOWN, UNPACKED, cell_text, check_repeated, chosen_table, library
from pliant_tables.errors import UserError
from pliant_tables.header import WINDOW, find_header
from pliant_tables.notes import Notes
from pliant_tables.preamble import with_length_unit
from pliant_tables.sheet import RowSheet, Sheet


def open_spreadsheet(path: Path, example: str, marks: Marks, notes: Notes, notes_name: str) -> Sheet:
    """Open the only worksheet of an .xlsx that contains a table, or the named one."""
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
    openpyxl = library("openpyxl", path, "openpyxl")
    try:
        book = openpyxl.load_workbook(path, read_only=True, data_only=True)
        sheets = {sheet.title: _rows(sheet) for sheet in book.worksheets}
        book.close()
    except Exception:  # a damaged archive raises many kinds
        raise no_table from None
    there = {title: rows for title, rows in sheets.items() if len(rows) > 1}
    if not there:
        raise UserError(f"{path}: the table is empty; it needs a header such as {example}.")
    title = chosen_table(path, list(there), notes.table, "sheet", notes_name)
    rows = [(line, cells) for line, cells in there[title] if line >= (notes.header or 1)]
    if not rows:
        raise UserError(f"{path}, sheet '{title}': 'header: {notes.header}' is below the table.")
    shown = [(k, list(cells)) for k, (_, cells) in enumerate(rows[:WINDOW])]
    found = find_header(shown, marks)
    if found is None:
        line = rows[0][0]
        raise UserError(
            f"{path}, sheet '{title}', line {line}: no row looks like a header; it needs one such as {example}."
        )
    preamble = tuple("\t".join(filter(None, cells)) for _, cells in rows[: found.at])
    names = with_length_unit(found.names, preamble, "\t")
    check_repeated(path, names, f", line {rows[found.at][0]}")
    return RowSheet(
        path,
        names,
        Problems(path, notes=notes_name),
        marks,
        header_line=rows[found.at][0],
        preamble=preamble,
        sample=tuple(cells for _, cells in rows[found.start : found.start + SHOWN]),
        rows=rows[found.start :],
    )


def _rows(sheet: Any) -> list[tuple[int, Sequence[str]]]:
    """Return rows that are not blank, each with its number, as wide as the widest."""
    rows = [
        (k, [cell_text(value) for value in row]) for k, row in enumerate(sheet.iter_rows(values_only=True), 1)
    ]
    rows = [(k, cells) for k, cells in rows if any(cells)]
    width = max((max(i for i, cell in enumerate(cells) if cell) + 1 for _, cells in rows), default=0)
    return [(k, (cells + [""] * width)[:width]) for k, cells in rows]
