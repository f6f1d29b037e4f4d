"""Headers of several lines, as motion capture writes them: marker, quantity and axis are combined into one name.

Layouts: OptiTrack Motive (Type, Name, ID, Position, X), Vicon Nexus (the marker over the first of its columns), TRC
(the same, with X1, Y1, Z1 below), DeepLabCut (scorer, bodyparts, coords).
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

# Lines that state the kind of a column, or its number: they are not names.
NOT_NAMES = ("type", "id", "parent", "scorer")
AXIS = re.compile(r"([XYZ])\d+")  # of TRC: the marker's number follows the axis


def combined_names(names: Sequence[str], upper: Sequence[Sequence[str]], filled: set[int]) -> list[str]:
    """Return names that distinguish the columns, by the lines above the header; unchanged if none helps.

    Their parts are joined by a colon ("tip:X"), so that none is read as Pliant's tip_x_m without confirmation: the
    frame of a camera is not the world's, and Motive's y is up.

    Args:
        names: of the header.
        upper: the lines above it, the nearest last; narrower ones end in blanks.
        filled: columns that contain data.
    """
    width = len(names)
    levels = [
        [*(cell.strip() for cell in row), *[""] * width][:width] for row in upper if not any(row[width:])
    ]
    whole = [
        name or next((row[c] for row in reversed(levels) if c in filled and row[c]), "")
        for c, name in enumerate(names)
    ]
    count = Counter(filter(None, whole))
    many = [c for c, name in enumerate(whole) if count[name] > 1 or (AXIS.fullmatch(name) and not names[0])]
    if not many:
        return whole
    used = [row for row in (_filled_on(row, many) for row in levels) if len({row[c] for c in many}) > 1]
    for c in many:
        axis = AXIS.fullmatch(whole[c])
        last = axis[1] if axis else whole[c]
        whole[c] = ":".join([*dict.fromkeys(row[c] for row in used if row[c]), last])
    return whole


def _filled_on(row: Sequence[str], many: Sequence[int]) -> list[str]:
    """Return a line in which each cell is repeated to the right up to the next, over contiguous columns."""
    whole, last = list(row), -2
    for c in many:
        if not whole[c] and last == c - 1:
            whole[c] = whole[last]
        last = c
    return whole
