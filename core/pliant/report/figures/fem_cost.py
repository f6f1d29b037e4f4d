"""What each state cost: seconds and Newton steps, in the order of solution."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.patches import Patch

from pliant.records.fem import ModuleData
from pliant.report.fem_reading import explored_kinds, solved_rows
from pliant.report.figures import style


def cost_picture(data: ModuleData) -> style.Png:
    """Bars of seconds above bars of Newton steps, coloured by the axis that each state explores."""
    rows = solved_rows(data)
    kinds = explored_kinds(data)
    colour = dict(zip(kinds, style.SERIES, strict=False))
    shades = [colour.get(str(name), style.SOFT) for name in data.explored[rows]]
    place = np.arange(1, int(rows.sum()) + 1)
    with style.canvas(1560, 520) as figure:
        above, below = figure.subplots(2, 1, sharex=True)
        _bars(above, place, data.wall_s[rows], shades, "seconds")
        _bars(below, place, data.iterations[rows], shades, "Newton steps")
        below.set_xlabel("state, in the order of solution")
        above.set_xlim(0.2, len(place) + 0.8)
        above.set_title("Time and Newton steps of each state")
        if len(kinds) > 1:
            words = {"coupling": "all axes held"}
            handles = [Patch(color=colour[k], label=words.get(k, f"axis {k}")) for k in kinds]
            figure.legend(handles=handles, loc="outside right upper")
        figure.set_layout_engine("constrained", w_pad=0.09, h_pad=0.06)
        return style.png(figure)


def _bars(axes: Any, place: Any, heights: Any, shades: list[str], label: str) -> None:
    axes.bar(place, heights, width=0.8, color=shades)
    axes.set_ylabel(label)
    axes.grid(False, axis="x")
