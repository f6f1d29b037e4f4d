"""The still picture of a chart's panels: the same lines and bands that the moving one shows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pliant.report.chart import Panel

NOT_KEYED: Mapping[str, str] = {}


def draw(axes: Any, panel: Panel, key: Mapping[str, str] = NOT_KEYED) -> None:
    """Bands, the line at zero, then lines in their order, on matplotlib axes.

    `key`: words of a legend by the name of a part.
    """
    for band in panel.bands:
        axes.fill_between(band.x, band.low, band.high, color=band.colour, lw=0, label=key.get(band.name))
    if panel.zero:
        axes.axhline(0, color=panel.zero, lw=1.0)
    for line in panel.lines:
        dots = {"marker": "o", "ms": line.dot, "mew": 0} if line.dot else {}
        axes.plot(line.x, line.y, color=line.colour, lw=line.width, label=key.get(line.name), **dots)
        if line.outside and panel.bands:
            outside = (line.y < panel.bands[0].low) | (line.y > panel.bands[0].high)
            look = {"color": line.outside, "alpha": 0.75, "lw": 0, "interpolate": False}
            axes.fill_between(line.x, 0, line.y, where=outside, **look)


def level_line(x: Any, value: float) -> tuple[Any, Any]:
    """Ends of a level stripe or line under readings at `x` (n,): where it begins and ends, and its value there."""
    known = np.asarray(x, float)[np.isfinite(x)]
    ends = np.array([known.min(), known.max()]) if len(known) else np.zeros(2)
    return ends, np.full(2, value)
