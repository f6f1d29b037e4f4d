"""Table of the states of many designs, a row for each state."""

from __future__ import annotations

import csv
import io
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from pliant.config.design_parameters import material_parameters
from pliant.fem_tables.writing import write_table
from pliant.records.fem import ModuleData
from pliant.store.store import (
    write_atomically,
)
from pliant_designs.sweep import SweepRun

NUMBER = "design"  # column of a sweep's table


def write_sweep_table(run: SweepRun, path: Path, digits: int | None = None) -> None:
    """Write the states of all finished designs; a parameter that a design lacks is blank.

    Columns `material.…` state the rubber, so that a study with another one is refused.
    The file is written atomically; without any design it has only a header.

    Args:
        run: the sweep.
        path: of the table.
        digits: significant digits of the states' numbers; all by default. Parameters of designs are not rounded.
    """
    designs = ((d.number, d.changes, data, material_parameters(d.material)) for d, data in run.data())
    write_designs(designs, path, digits, tuple(run.outcomes[0].design.changes if run.outcomes else ()))


def write_designs(
    designs: Iterable[tuple[int, Mapping[str, Any], ModuleData, Mapping[str, Any] | None]],
    path: Path,
    digits: int | None = None,
    names: Sequence[str] = (),
) -> None:
    """Write the states of several designs as one table.

    Args:
        designs: number, parameters, data and material constants of each.
        path: of the table.
        digits: as for `write_sweep_table`.
        names: parameters that have a column even without a design.
    """
    columns: dict[str, None] = {}
    rows: list[dict[str, str]] = []
    with tempfile.TemporaryDirectory() as folder:
        part = Path(folder) / "part.csv"
        for number, changes, data, material in designs:
            write_table(data, part, material)
            with part.open(encoding="utf-8", newline="") as file:
                reader = csv.DictReader(file)
                columns |= dict.fromkeys(reader.fieldnames or ())
                for row in reader:
                    row = row if digits is None else {k: shortened(cell, digits) for k, cell in row.items()}
                    own = {name: str(value) for name, value in changes.items()}
                    rows.append({**own, **row, NUMBER: str(number)})
    columns |= dict.fromkeys([*names, NUMBER])
    text = io.StringIO()
    writer = csv.DictWriter(text, list(columns), restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_atomically(path, text.getvalue())


def shortened(cell: str, digits: int) -> str:
    """Return a number with `digits` significant digits; integers and words are unchanged."""
    try:
        return cell if cell.lstrip("-").isdecimal() else f"{float(cell):.{digits}g}"
    except ValueError:
        return cell
