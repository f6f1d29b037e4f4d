"""Candidates as lines through all variables at once, coloured by their objective, the best on top."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import Colormap, LinearSegmentedColormap
from numpy.typing import NDArray

from pliant.formatting import number
from pliant.records.design import Array
from pliant.report.figures import style
from pliant.report.figures.search_answer import discrete
from pliant.report.figures.search_history import shown_range
from pliant.report.figures.search_small import small_png
from pliant.report.search_view import Axis, SearchView, log_suits

MOST_LINES = 400
BEST_SHARE = 0.1
WIDTH_PX, ROW_PX = 1560, 74
LABEL = 32  # characters of a variable's name on one line
JITTER = 0.03  # of the range: candidates with the same integer or choice lie beside one another


def search_parallel(read: SearchView) -> style.Png | None:
    """A row per variable, the objective in the last one; None where fewer than two candidates have an objective."""
    rows, axes_of = thinned(read.order()), read.varied()
    if len(rows) < 2 or not axes_of:
        return None
    with style.canvas(WIDTH_PX, ROW_PX * (len(axes_of) + 1) + 130, pad=(0.08, 0.06)) as figure:
        axes = figure.subplots()
        scores, scale = read.scores()[rows], _Scale.of(read)
        places = [*(_places(axis, rows) for axis in axes_of), scale.places(scores)]
        levels = np.arange(len(places))
        order = np.arange(len(rows))[::-1]  # the best comes last, on top
        lines = [np.column_stack([[p[k] for p in places], levels]) for k in order]
        colours = _map()(1 - scale.places(scores)[order])
        widths = np.where(order < max(BEST_SHARE * len(rows), 1), 1.1, 0.7)
        axes.add_collection(LineCollection(lines, colors=colours, linewidths=widths, alpha=0.75, zorder=2))
        axes.plot([p[0] for p in places], levels, color=style.WARN, lw=2.4, marker="o", ms=5, zorder=5)
        for level, axis in enumerate(axes_of):
            _axis(axes, axis, level)
        scale.draw(axes, len(axes_of))
        names = [
            *(textwrap.fill(a.title, LABEL) for a in axes_of),
            textwrap.fill(read.objective.title, LABEL),
        ]
        axes.set_yticks(levels, names)
        axes.get_yticklabels()[-1].set_fontweight("bold")
        axes.set(ylim=(len(places) - 0.5, -0.5), xlim=(-0.13, 1.13))
        axes.set_xticks([])
        axes.grid(visible=False)
        axes.tick_params(axis="y", length=0)
        for side in ("left", "bottom"):
            axes.spines[side].set_visible(False)
        axes.set_title(f"{len(rows)} of {int(read.ok.sum())} evaluated candidates, the best in orange")
        return small_png(figure)


def thinned(order: NDArray[np.int64], most: int = MOST_LINES) -> NDArray[np.int64]:
    """At most `most` of the rows, best first: the best tenth (up to half of `most`), the rest evenly by rank."""
    if len(order) <= most:
        return order
    kept = min(int(np.ceil(BEST_SHARE * len(order))), most // 2)
    rest = np.unique(np.linspace(kept, len(order) - 1, most - kept).astype(int))
    return np.concatenate([order[:kept], order[rest]])


class _Scale:
    """The objective's axis: best at the left; logarithmic where that shows more."""

    def __init__(self, best: float, worst: float, log: bool) -> None:
        self.best, self.worst, self.log = best, worst, log

    @staticmethod
    def of(read: SearchView) -> _Scale:
        scores, up = read.scores(), read.objective.maximised
        log = log_suits(scores)
        finite = scores[np.isfinite(scores)]
        low, high = (float(finite.min()), float(finite.max())) if log else shown_range(scores, up)
        return _Scale(*((high, low) if up else (low, high)), log)

    def places(self, scores: Array | list[float]) -> Array:
        """0 at the best, 1 at the worst that is shown, and beyond it."""
        warp = np.log if self.log else np.asarray
        best, worst, own = (np.asarray(warp(np.asarray(v, float))) for v in (self.best, self.worst, scores))
        span = float(worst - best)
        return np.clip((own - best) / span, 0, 1) if span else np.zeros(len(own))

    def draw(self, axes: Any, level: int) -> None:
        """A coloured bar with a few values under it."""
        strip = _map()(np.linspace(1, 0, 256))[None]
        axes.imshow(strip, extent=(0, 1, level + 0.2, level + 0.06), aspect="auto", zorder=3)
        shares = np.linspace(0, 1, 5)
        values = (
            np.exp(np.log(self.best) + shares * (np.log(self.worst) - np.log(self.best)))
            if self.log
            else self.best + shares * (self.worst - self.best)
        )
        for share, value in zip(shares, values, strict=True):
            axes.annotate(
                number(float(value), 3), (share, level + 0.22), (0, -3), textcoords="offset points",
                ha="center", va="top", fontsize=8.5,
            )  # fmt: skip


def _places(axis: Axis, rows: NDArray[np.int64]) -> Array:
    """Where the candidates stand on an axis; those of few values are spread a little, the same way every time."""
    share = axis.share(axis.values[rows])
    if steps := discrete(axis):
        spread = np.random.default_rng(len(rows)).uniform(-1, 1, len(rows)) * min(JITTER, 0.25 / len(steps))
        spread[0] = 0.0
        share = share + spread
    return share


def _axis(axes: Any, axis: Axis, level: int) -> None:
    """Its line, its ends in human units, a tick at every choice or integer."""
    axes.plot([0, 1], [level, level], color=style.INK, lw=1.0, zorder=4, alpha=0.7)
    box = {"boxstyle": "round,pad=0.12", "fc": "white", "ec": "none", "alpha": 0.75}
    steps = discrete(axis, 13)
    if steps:
        axes.plot(
            axis.share(np.array(steps)), [level] * len(steps), "|", ms=9, mew=1.3, color=style.INK, zorder=4
        )
        for step in steps:
            axes.annotate(
                textwrap.shorten(axis.tick(step), 18, placeholder="…"), (float(axis.share(step)), level), (0, 8),
                textcoords="offset points", ha="center", fontsize=8, zorder=6, bbox=box,
            )  # fmt: skip
        return
    for end, value, side in ((0, axis.low, "right"), (1, axis.high, "left")):
        axes.annotate(
            axis.tick(value), (end, level), (-7 if end == 0 else 7, 0), textcoords="offset points", ha=side,
            va="center", fontsize=8.5, color=style.INK,
        )  # fmt: skip


def _map() -> Colormap:
    """Pale for the worst, dark blue for the best."""
    return LinearSegmentedColormap.from_list(
        "search", ["#e8ecf2", "#b9cde1", "#6fa8d3", "#0072B2", "#12305c"]
    )
