"""Opener of tables of any format, by the first bytes of the file; all become a `Sheet`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pliant_tables.cells import Marks
from pliant_tables.columns import is_frame, open_frame, open_parquet
from pliant_tables.errors import UserError
from pliant_tables.matlab import open_matlab
from pliant_tables.notes import Notes, StatedNotes
from pliant_tables.regular import require_regular
from pliant_tables.sheet import Sheet
from pliant_tables.spreadsheet import open_spreadsheet
from pliant_tables.text_header import open_text

# First bytes of files that are mistaken for tables.
NO_TABLES = {
    b"%PDF": "it is a PDF; export the numbers as CSV",
    b"\xd0\xcf\x11\xe0": "it is an old spreadsheet; save the table as .xlsx or 'CSV UTF-8'",
    b"MATLAB 7.3": "it is of MATLAB 7.3; write it by save(…, '-v7')",
    b"TDSm": "it is a TDMS file of LabVIEW; export its channels as CSV or .xlsx, or by nptdms in Python",
    b"#ROSBAG": "it is a ROS bag; write a topic as CSV by 'rostopic echo -b FILE -p TOPIC'",
    b"\x89MCAP": "it is a bag of ROS 2; write a topic as CSV, as PlotJuggler does",
    b"SQLite format 3": "it is a database, as of a ROS 2 bag; write a table or a topic as CSV",
    b"\x1f\x8b": "it is compressed by gzip; unpack it",
    b"\x89HDF": "it is an HDF5 file; write MATLAB's by save(…, '-v7'), others as CSV or Parquet",
}
MOST_COLUMNS, LONGEST_NAME = 2000, 300
FRAME = "DataFrame"  # name of a table in memory in messages


def open_sheet(source: Path | Any, example: str, notes: Notes | None = None, notes_name: str = "") -> Sheet:
    """Open a table and read its header.

    Args:
        source: a text, .xlsx, .mat (to version 7) or Parquet file, or a pandas frame.
        example: a header for messages.
        notes: what the table does not state: the mark of its decimals, words for missing values, which of
            several tables.
        notes_name: where the user would write notes, for messages; the YAML of the same stem by default.

    Raises `UserError` where there is no file, no table, or no header.
    """
    notes = notes or StatedNotes()
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
                return _checked(opened(path, example, marks, notes, notes_name))
        return _checked(open_text(path, example, marks, notes_name, notes.header))
    except (OSError, ValueError) as error:
        cause = (
            "no such file"
            if isinstance(error, FileNotFoundError)
            else getattr(error, "strerror", None) or error
        )
        raise UserError(f"{path}: the table cannot be read ({cause}).") from None


def _checked(sheet: Sheet) -> Sheet:
    """Return the sheet; raise `UserError` for an implausible header, because its names are parsed word by word."""
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


# Keyed by the first bytes of a file.
OPENERS = {
    b"PK\x03\x04": open_spreadsheet,
    b"MATLAB 5.0": open_matlab,
    b"PAR1": open_parquet,
}
