"""The objective about the best design, one small picture per variable."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np

from pliant.formatting import number
from pliant.records.search import Slope
from pliant.report.figures import style
from pliant.report.figures.search_small import small_png
from pliant.report.search_view import Axis, SearchView

COLUMNS, PANEL_PX = 4, 390
LABEL = 26


def by_influence(read: SearchView) -> list[Slope]:
    """Slopes of known variables, those whose range changes the objective most first."""
    known = {axis.name for axis in read.axes}
    return sorted((s for s in read.result.slopes if s.name in known), key=lambda s: -influence(s))


def influence(slope: Slope) -> float:
    """Largest change of the objective over the range that could be evaluated."""
    finite = np.asarray(slope.objective, float)[np.isfinite(slope.objective)]
    return float(np.ptp(finite)) if len(finite) else 0.0


def search_slopes(read: SearchView) -> style.Png | None:
    """Small multiples on one scale of the objective; None where nothing was tried."""
    slopes, best = by_influence(read), read.best
    if not slopes or best is None:
        return None
    columns = min(COLUMNS, len(slopes))
    rows = -(-len(slopes) // columns)
    with style.canvas(max(PANEL_PX * columns + 60, 820), 330 * rows + 20, pad=(0.06, 0.07)) as figure:
        grid = figure.subplots(rows, columns, squeeze=False, sharey=True).ravel()
        axes_of = {axis.name: axis for axis in read.axes}
        for axes, slope in zip(grid, slopes, strict=False):
            _panel(axes, read, slope, axes_of[slope.name])
        for axes in grid[len(slopes) :]:
            axes.set_axis_off()
        for row in range(rows):
            grid[row * columns].set_ylabel(textwrap.fill(read.objective.title, 22))
        return small_png(figure)


def _panel(axes: Any, read: SearchView, slope: Slope, axis: Axis) -> None:
    shares, objective = np.asarray(slope.shares, float), read.objective.stated(slope.objective)
    x = shares if axis.choices else axis.low + shares * (axis.high - axis.low)
    good = np.isfinite(objective)
    line = "" if axis.choices else "-"
    axes.plot(x[good], objective[good], ls=line, marker="o", ms=3.5, color=style.SERIES[0], lw=1.5)
    if (~good).any():
        axes.plot(
            x[~good], np.full((~good).sum(), 0.96), "x", ms=5, mew=1.4, color=style.SERIES[1], clip_on=False,
            transform=axes.get_xaxis_transform(),
        )  # fmt: skip
    assert read.best is not None
    at = axis.place(read.best.values.get(axis.name))
    value = float(read.best.objectives[read.objective.name]) * read.objective.unit.factor
    axes.plot([at], [value], "*", ms=13, color=style.WARN, mec="white", zorder=6, clip_on=False)
    if slope.at_bound:
        edge = axis.low if slope.at_bound == "low" else axis.high
        axes.axvline(edge, color=style.WARN, lw=3.5, zorder=1, clip_on=False)
        side = {"low": (6, "left"), "high": (-6, "right")}[slope.at_bound]
        axes.annotate(
            "at its bound", (edge, 0.9), (side[0], 0), xycoords=("data", "axes fraction"), textcoords="offset points",
            ha=side[1], fontsize=8, color=style.WARN, bbox={"boxstyle": "round,pad=0.1", "fc": "white", "ec": "none"},
        )  # fmt: skip
    pad = 0.05 * (axis.high - axis.low)
    axes.set_xlim(axis.low - pad, axis.high + pad)
    if axis.choices:
        axes.set_xlim(-0.4, len(axis.choices) - 0.6)
        axes.set_xticks(range(len(axis.choices)), [textwrap.fill(text, 9) for text in axis.choices])
    else:
        axes.locator_params(axis="x", nbins=4, integer=axis.type == "integer")
    axes.set_title(textwrap.fill(axis.title, LABEL), fontsize=9)
    if np.isfinite(slope.change):
        change = abs(slope.change) * read.objective.unit.factor
        axes.set_xlabel(
            f"{number(change, 2)} {read.objective.unit.symbol}".strip() + " for 1 % of the range",
            fontsize=8,
        )
