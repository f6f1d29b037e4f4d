"""Columns that hold nothing but the unit of the column before them, as multimeters write them."""

from __future__ import annotations

from collections.abc import Sequence

from pliant_tables.units import is_unit, unit_in

NAMES = ("", "unit", "units", "einheit", "einheiten")


def with_units_beside(names: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return names with the unit of a column of units behind them, in brackets; that column loses its name.

    Args:
        names: of the columns; one of units is called so, or has no name.
        rows: cells of the first rows.
    """
    found = list(names)
    for place in range(1, len(names)):
        if names[place].lower() not in NAMES:
            continue
        cells = {row[place].strip("[]() ") for row in rows if place < len(row)} - {""}
        unit = next(iter(cells)) if len(cells) == 1 else ""
        if is_unit(unit) and unit_in(names[place - 1]) is None and names[place - 1]:
            found[place - 1 : place + 1] = [f"{names[place - 1]} [{unit}]", ""]
    return found
