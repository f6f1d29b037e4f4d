"""Designs that an optimizer with contexts proposes for each condition: their spread at the end of the search."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.report.figures import style
from pliant.report.figures.search_answer import discrete
from pliant.report.figures.search_small import small_png
from pliant.report.search_view import Axis, SearchView

LAST = 0.25  # of the search
COLUMNS = 3
MOST_DOTS = 150  # of a condition
LABEL = 22


def search_policy(read: SearchView) -> style.Png | None:
    """One panel per variable, one row per condition; None for searches without contexts."""
    axes_of = read.varied()
    if not read.contextual or not axes_of:
        return None
    columns = min(COLUMNS, len(axes_of))
    rows, count = -(-len(axes_of) // columns), len(read.result.conditions)
    with style.canvas(480 * columns + 240, rows * (42 * count + 130) + 20, pad=(0.07, 0.07)) as figure:
        grid = figure.subplots(rows, columns, squeeze=False, sharey=True).ravel()
        for axes, axis in zip(grid, axes_of, strict=False):
            _panel(axes, read, axis)
        for axes in grid[len(axes_of) :]:
            axes.set_axis_off()
        for axes in grid[::columns]:
            axes.set_yticks(range(count), [textwrap.fill(n, LABEL) for n in read.result.conditions])
        grid[0].set_ylim(count - 0.4, -0.6)
        return small_png(figure)


def last_rows(read: SearchView, context: int) -> NDArray[np.int64]:
    """Rows of a condition's evaluated candidates in the last quarter of the search."""
    own = np.asarray(read.result.history.context) == context
    late = np.arange(len(own)) >= (1 - LAST) * len(own)
    return np.flatnonzero(own & late & read.ok)


def _panel(axes: Any, read: SearchView, axis: Axis) -> None:
    for context in range(len(read.result.conditions)):
        rows, colour = last_rows(read, context), style.SERIES[context % 6]
        values = axis.values[rows][np.isfinite(axis.values[rows])]
        if len(values):
            few = values[np.unique(np.linspace(0, len(values) - 1, MOST_DOTS).astype(int))]
            spread = np.random.default_rng(context).uniform(-0.22, 0.22, (2, len(few)))
            steps = discrete(axis)
            wide = 0.12 if steps else 0.0
            axes.scatter(few + wide * spread[1], context + spread[0], 8, color=colour, lw=0, alpha=0.45)
            if not steps:
                low, q1, middle, q3, high = np.percentile(values, [5, 25, 50, 75, 95])
                axes.plot([low, high], [context] * 2, color=colour, lw=1.5)
                axes.plot([q1, q3], [context] * 2, color=colour, lw=5, solid_capstyle="butt")
                axes.plot([middle] * 2, [context - 0.2, context + 0.2], color=colour, lw=2)
    for design in read.result.best:
        at = axis.place(read.value(design, axis.name))
        if np.isfinite(at) and design.context >= 0:
            axes.plot(
                [at], [design.context], "*", ms=12, color=style.INK, mec="white", zorder=6, clip_on=False
            )
    pad = 0.06 * (axis.high - axis.low) or 0.5
    axes.set_xlim(axis.low - pad, axis.high + pad)
    if axis.choices:
        axes.set_xticks(range(len(axis.choices)), [textwrap.fill(text, 10) for text in axis.choices])
    else:
        axes.locator_params(axis="x", nbins=5, integer=axis.type == "integer")
    axes.grid(axis="y", visible=False)
    axes.tick_params(axis="y", length=0)
    axes.set_title(textwrap.fill(axis.title, 32), fontsize=9.5)
