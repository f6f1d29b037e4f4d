"""Parts of the lab files: one recording in the units and formats of labs."""

from __future__ import annotations

import io
from collections.abc import Sequence
from datetime import datetime, timedelta

import numpy as np
from tests.lab_files.lab_file import RECORDING, Array, part

TPA = ("time_s", "pressure_pa", "angle_rad")
SLOW, FAST = RECORDING["slow"], RECORDING["fast"]
T, P, A = (SLOW[name] for name in TPA)
MS, MBAR, KPA, BAR, DEG = 1000 * T, P / 100, P / 1000, P / 1e5, np.round(np.degrees(A), 2)
PSI = P / 6894.757293168361
ONE, BOTH = part(*TPA), part(*TPA, runs=("slow", "fast"))


def named(stem: str) -> dict[str, dict[str, Array]]:
    """Return the slow run, named as the file."""
    return {stem: dict(ONE["slow"])}


def both(column: str) -> Array:
    """Return a column of both runs, one after the other."""
    return np.concatenate([SLOW[column], FAST[column]])


def stamps(pattern: str, cut: int | None = None) -> list[str]:
    begin = datetime(2026, 8, 2, 10, 0, 0)
    written = [(begin + timedelta(milliseconds=float(ms))).strftime(pattern) for ms in MS]
    return [stamp[:cut] for stamp in written]


def spreadsheet(sheets: dict[str, Sequence[Sequence[object]]]) -> bytes:
    import openpyxl

    book, file = openpyxl.Workbook(), io.BytesIO()
    book.remove(book.active)
    for name, lines in sheets.items():
        sheet = book.create_sheet(name)
        for line in lines:
            sheet.append(list(line))
    book.save(file)
    return file.getvalue()


def matlab(variables: dict[str, object]) -> bytes:
    from scipy.io import savemat

    file = io.BytesIO()
    savemat(file, variables)
    return file.getvalue()


def parquet(columns: dict[str, Array]) -> bytes:
    import pyarrow
    import pyarrow.parquet

    file = io.BytesIO()
    pyarrow.parquet.write_table(pyarrow.table(columns), file)
    return file.getvalue()
