"""Names that differ only by a number; clocks among them show that runs are in parallel columns."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from pliant_tables.errors import UserError
from pliant_tables.proposals import plain_words
from pliant_tables.units import fits, unit_at_the_end, unit_in
from pliant_tables.wording import listed


def is_clock(name: str) -> bool:
    """Return whether a name, with or without a number, is that of a clock: ``t2 [s]``, ``Sample 1:time``."""
    unit = unit_in(name) or unit_at_the_end(name)
    words = re.sub(r"\d+", " ", plain_words(name)).split()
    return bool({"t", "time", "zeit"} & set(words)) and (unit is None or fits(unit, "s"))


def group_numbered_names(names: Iterable[str]) -> dict[str, dict[str, int]]:
    """Return names that differ only by a number, with their numbers, by their common part."""
    rows: dict[str, dict[str, int]] = {}
    for name in names:
        if match := re.fullmatch(r"(.*?)(\d+)(\D*)", plain_words(name)):
            rows.setdefault(f"{match[1]}#{match[3]}", {})[name] = int(match[2])
    return rows


def check_side_by_side(path: Path, clock: str, unknown: Sequence[str]) -> None:
    """Raise `UserError` if several clocks that differ only by a number show that runs are in parallel columns.

    Args:
        path: the file, for messages.
        clock: the column that is read as time; "" without one.
        unknown: columns that are not known.
    """
    rows = group_numbered_names(filter(is_clock, unknown))
    clocks = max((list(row) for row in rows.values()), key=len, default=[])
    if clock:
        clocks = [clock, *rows.get(f"{plain_words(clock)} #", ()), *rows.get(f"{plain_words(clock)}#", ())]
    if len(clocks) > 1:
        named = listed([f"'{name}'" for name in clocks])
        raise UserError(
            f"{path}: {named} are clocks of {len(clocks)} runs that stand beside each other. Write them below each "
            "other with a column run, or each into a file of its own; where one clock is that of all, 'rename' it to "
            "time_s."
        )
