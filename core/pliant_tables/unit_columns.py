"""Columns that hold nothing but the unit of the column before them, as multimeters write them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pliant_tables.cells import CellBlock
from pliant_tables.units import is_unit, unit_in

NAMES = ("", "unit", "units", "einheit", "einheiten")


def with_units_beside(
    names: Sequence[str], rows: Sequence[Sequence[str]]
) -> tuple[list[str], dict[int, tuple[str, str]]]:
    """Return names with the unit of a column of units behind them, in brackets; that column loses its name.

    The place of each such column comes with the name of the column before it and its unit, which all rows must have.

    Args:
        names: of the columns; one of units is called so, or has no name.
        rows: cells of the first rows.
    """
    found, beside = list(names), dict[int, tuple[str, str]]()
    for place in range(1, len(names)):
        before = names[place - 1]
        if names[place].lower() not in NAMES or not before or unit_in(before) is not None:
            continue
        cells = [unit for row in rows if place < len(row) and (unit := row[place].strip("[]() "))]
        if cells and all(map(is_unit, cells)):
            found[place - 1 : place + 1] = [f"{before} [{cells[0]}]", ""]
            beside[place] = before, cells[0]
    return found, beside


def note_other_units(block: CellBlock, beside: Mapping[int, tuple[str, str]]) -> None:
    """Note the first row in which a column of units says another unit, as a change of range makes it."""
    for place, (name, unit) in beside.items():
        cells = block.texts(place)
        if set(cells) <= {unit, ""}:
            continue
        for cell, line in zip(cells, block.lines.tolist(), strict=True):
            if (other := cell.strip("[]() ")) not in (unit, ""):
                text = f"column {name} is in '{other}' there, and in '{unit}' above; convert it to one unit"
                block.problems.add(line, text)
                break
