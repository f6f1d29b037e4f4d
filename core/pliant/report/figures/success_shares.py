"""Success by condition: measured shares with their Wilson intervals, one or more models beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pliant.evidence.binomial import Count, wilson
from pliant.report.figures import style


@dataclass(frozen=True)
class Series:
    """Counts of one source by condition; `emphasised` conditions are drawn filled, the others hollow."""

    label: str
    counts: Sequence[Count]
    emphasised: Sequence[bool]


MARKERS = ("o", "s", "D", "^")
SPREAD = 0.34  # of a row, over which the series lie apart


def success_shares(conditions: Sequence[str], measured: Series, models: Sequence[Series]) -> style.Png:
    """A row for each condition, shares from 0 to 100 %; bars are 95 % intervals of counting alone."""
    rows = len(conditions)
    colours = (style.INK, *style.SERIES)
    series = (measured, *models)
    with style.canvas(1350, 62 * rows + 200, pad=(0.06, 0.05)) as figure:
        axes, handles = figure.subplots(), []
        for k, one in enumerate(series):
            shift = SPREAD * (k / max(len(series) - 1, 1) - 0.5)
            look: dict[str, Any] = {"marker": MARKERS[k % len(MARKERS)], "color": colours[k]}
            handles.append(style.entry(one.label, **look))
            for row, (count, strong) in enumerate(zip(one.counts, one.emphasised, strict=True)):
                low, high = wilson(count)
                y, share = row + shift, 100 * count[0] / count[1]
                axes.plot([100 * low, 100 * high], [y, y], color=colours[k], lw=1.5, alpha=0.75)
                fill = colours[k] if strong else style.PAPER
                axes.plot([share], [y], ls="", ms=6.5, markerfacecolor=fill, clip_on=False, zorder=5, **look)
        for row in range(1, rows):
            axes.axhline(row - 0.5, color="#e6e9ef", lw=0.7)
        axes.set_yticks(range(rows), conditions)
        axes.set(ylim=(rows - 0.5, -0.5), xlim=(-1, 101))
        axes.set_xlabel("successes (%), with 95 % intervals (Wilson)")
        axes.grid(axis="y", visible=False)
        figure.legend(handles=handles, loc="outside upper left", ncols=len(series))
        return style.png(figure)
