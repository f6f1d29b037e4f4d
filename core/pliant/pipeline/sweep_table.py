"""The data of a sweep as one table: the columns of a design's table, the swept parameters, the design's number."""

from __future__ import annotations

import csv
import io
import tempfile
from pathlib import Path

from pliant.pipeline.sweep_records import SweepRun
from pliant.store.store import write_atomically
from pliant.tabular.fem_writing import write_table

NUMBER = "design"


def write_sweep_table(run: SweepRun, path: Path, digits: int | None = None) -> None:
    """Write the states of all designs that are done; a parameter that a design lacks is blank.

    The file appears whole or not at all; without any design it has a header only.

    Args:
        run: the sweep.
        path: of the table.
        digits: significant ones of the states' numbers; all by default. Parameters of designs keep theirs.
    """
    swept = list(run.outcomes[0].design.changes) if run.outcomes else []
    columns: dict[str, None] = {}
    rows: list[dict[str, str]] = []
    with tempfile.TemporaryDirectory() as folder:
        part = Path(folder) / "part.csv"
        for design, data in run.data():
            write_table(data, part)
            with part.open(encoding="utf-8", newline="") as file:
                reader = csv.DictReader(file)
                columns |= dict.fromkeys(reader.fieldnames or ())
                for row in reader:
                    row = row if digits is None else {k: shortened(cell, digits) for k, cell in row.items()}
                    own = {name: str(value) for name, value in design.changes.items()}
                    rows.append({**own, **row, NUMBER: str(design.number)})
    columns |= dict.fromkeys([*swept, NUMBER])
    text = io.StringIO()
    writer = csv.DictWriter(text, list(columns), restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_atomically(path, text.getvalue())


def shortened(cell: str, digits: int) -> str:
    """A number with so many significant digits; whole numbers and words as they are."""
    try:
        value = float(cell)
    except ValueError:
        return cell
    return cell if cell.lstrip("-").isdecimal() else f"{value:.{digits}g}"
