"""What a search tried, on the axes of its variables: the best designs, all candidates, designs by condition."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap
from numpy.typing import NDArray

from pliant.formatting import number
from pliant.records.design import Array
from pliant.records.search import FoundDesign
from pliant.report.figures import style
from pliant.report.figures.search_course import shown_range
from pliant.report.search_view import Axis, SearchView, log_suits

ANSWER_ROW_PX, ANSWER_PX = 62, 1500
LABEL_OF_ANSWER = 34  # characters of a variable's name on one line
MARKS = ("o", "s", "D", "^", "v", "P", "X", "*")
MOST_MARKED = 8  # designs that get a colour and a mark of their own


def search_answer(read: SearchView) -> style.Png | None:
    """Ranges as bars, the best designs as marks on them; None without a design."""
    best = read.result.best
    shown = [a for a in read.axes if any(np.isfinite(a.place(read.value(d, a.name))) for d in best)]
    if not shown:
        return None
    several = len(best) > 1
    height = ANSWER_ROW_PX * len(shown) + 110 + 60 * several
    with style.canvas(ANSWER_PX, height, pad=(0.08, 0.06)) as figure:
        axes = figure.subplots()
        for row, axis in enumerate(shown):
            axes.plot([0, 1], [row, row], color="#e3e7ee", lw=7, solid_capstyle="round", zorder=1)
            _ends(axes, axis, row, 8, fontsize=8, color=style.SOFT)
            if steps := discrete(axis):
                look = {"color": style.SOFT, "ms": 7, "mew": 1.0, "zorder": 2}
                axes.plot(axis.share(np.array(steps)), [row] * len(steps), "|", **look)
        for number, design in enumerate(best):
            _marked_design(axes, shown, design, number, read, several)
        _rows(axes, [a.title for a in shown], LABEL_OF_ANSWER)
        axes.set(ylim=(len(shown) - 0.45, -0.55), xlim=(-0.14, 1.14 if several else 1.24))
        axes.set_title(f"The best design{'s' * several} in what was searched")
        if several and len(best) <= MOST_MARKED:
            figure.legend(loc="outside lower center", ncols=min(4, len(best)))
        return style.small_png(figure)


def _ends(axes: Any, axis: Axis, level: int, apart: float, **look: Any) -> None:
    """The ends of a range beside its bar, so many points apart."""
    for end, value, side in ((0, axis.low, "right"), (1, axis.high, "left")):
        place = (end, level), (apart * (2 * end - 1), 0)
        style.note(axes, axis.tick(value), *place, ha=side, va="center", **look)


def _marked_design(
    axes: Any, axes_of: list[Axis], design: FoundDesign, number: int, read: SearchView, several: bool
) -> None:
    """One design's marks; a single one is written out at the right."""
    count = len(read.result.best)
    own = count <= MOST_MARKED
    colour = style.SERIES[number % 6] if own else style.SERIES[0]
    shift = 0.36 * (number / (count - 1) - 0.5) if several else 0.0
    places = [float(axis.share(axis.place(read.value(design, axis.name)))) for axis in axes_of]
    axes.plot(
        places, np.arange(len(axes_of)) + shift, ls="", marker=MARKS[number % len(MARKS)] if own else "o",
        ms=(7 if own else 4.5) if several else 10,
        color=colour, mec="white", mew=0.8 if own else 0, alpha=1 if own else 0.5, zorder=4,
        label=read.design_names()[number],
    )  # fmt: skip
    for row, axis in enumerate(() if several else axes_of):
        text = axis.text(read.value(design, axis.name))
        axes.annotate(text, (1.09, row), va="center", fontsize=10, weight="bold", color=colour)


def discrete(axis: Axis, most: int = 24) -> list[float]:
    """The values of an integer or of choices, where there are few."""
    if axis.choices:
        return [float(k) for k in range(len(axis.choices))]
    if axis.variable.type == "integer" and axis.high - axis.low < most:
        return np.arange(axis.low, axis.high + 0.5).tolist()
    return []


MOST_LINES = 400
BEST_SHARE = 0.1
WIDTH_PX, ROW_PX = 1560, 74
LABEL_OF_PARALLEL = 32  # characters of a variable's name on one line
SHADES = ["#e8ecf2", "#b9cde1", "#6fa8d3", "#0072B2", "#12305c"]
PALE_TO_DARK = LinearSegmentedColormap.from_list("search", SHADES)  # the worst pale, the best dark blue
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
        colours = PALE_TO_DARK(1 - scale.places(scores)[order])
        widths = np.where(order < max(BEST_SHARE * len(rows), 1), 1.1, 0.7)
        axes.add_collection(LineCollection(lines, colors=colours, linewidths=widths, alpha=0.75, zorder=2))
        axes.plot([p[0] for p in places], levels, color=style.WARN, lw=2.4, marker="o", ms=5, zorder=5)
        for level, axis in enumerate(axes_of):
            _parallel_axis(axes, axis, level)
        scale.draw(axes, len(axes_of))
        _rows(axes, [*(a.title for a in axes_of), read.objective.unit.axis], LABEL_OF_PARALLEL)
        axes.get_yticklabels()[-1].set_fontweight("bold")
        axes.set(ylim=(len(places) - 0.5, -0.5), xlim=(-0.13, 1.13))
        axes.set_title(f"{len(rows)} of {int(read.ok.sum())} evaluated candidates, the best in orange")
        return style.small_png(figure)


def _rows(axes: Any, names: list[str], width: int) -> None:
    """A name at each row, and nothing else around the panel."""
    axes.set_yticks(range(len(names)), [textwrap.fill(name, width) for name in names])
    axes.set_xticks([])
    axes.grid(visible=False)
    axes.tick_params(axis="y", length=0)
    for side in ("left", "bottom"):
        axes.spines[side].set_visible(False)


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
        strip = PALE_TO_DARK(np.linspace(1, 0, 256))[None]
        axes.imshow(strip, extent=(0, 1, level + 0.2, level + 0.06), aspect="auto", zorder=3)
        for share in np.linspace(0, 1, 5):
            if self.log:
                value = np.exp(np.log(self.best) + share * (np.log(self.worst) - np.log(self.best)))
            else:
                value = self.best + share * (self.worst - self.best)
            style.note(axes, number(float(value), 3), (share, level + 0.22), (0, -3), ha="center", va="top")


def _places(axis: Axis, rows: NDArray[np.int64]) -> Array:
    """Where the candidates stand on an axis; those of few values are spread a little, the same way every time."""
    share = axis.share(axis.values[rows])
    if steps := discrete(axis):
        spread = np.random.default_rng(len(rows)).uniform(-1, 1, len(rows)) * min(JITTER, 0.25 / len(steps))
        spread[0] = 0.0
        share = share + spread
    return share


def _parallel_axis(axes: Any, axis: Axis, level: int) -> None:
    """Its line, its ends in human units, a tick at every choice or integer."""
    axes.plot([0, 1], [level, level], color=style.INK, lw=1.0, zorder=4, alpha=0.7)
    if steps := discrete(axis, 13):
        shares = axis.share(np.array(steps))
        axes.plot(shares, [level] * len(steps), "|", ms=9, mew=1.3, color=style.INK, zorder=4)
        box = {"boxstyle": "round,pad=0.12", "fc": "white", "ec": "none", "alpha": 0.75}
        for step in steps:
            text = textwrap.shorten(axis.tick(step), 18, placeholder="…")
            look = {"ha": "center", "fontsize": 8, "zorder": 6, "bbox": box}
            style.note(axes, text, (float(axis.share(step)), level), (0, 8), **look)
        return
    _ends(axes, axis, level, 7, color=style.INK)


LAST = 0.25  # of the search
COLUMNS = 3
MOST_DOTS = 150  # of a condition
LABEL_OF_POLICY = 22


def search_policy(read: SearchView) -> style.Png | None:
    """One panel per variable, one row per condition; None for searches without contexts."""
    axes_of = read.varied()
    if not read.contextual or not axes_of:
        return None
    columns = min(COLUMNS, len(axes_of))
    rows, count = -(-len(axes_of) // columns), len(read.result.conditions)
    with style.canvas(480 * columns + 240, rows * (42 * count + 130) + 20, pad=(0.07, 0.07)) as figure:
        panels = style.panels(figure, len(axes_of), columns, sharey=True)
        for axes, axis in zip(panels, axes_of, strict=True):
            _condition_panel(axes, read, axis)
        for axes in panels[::columns]:
            axes.set_yticks(range(count), [textwrap.fill(n, LABEL_OF_POLICY) for n in read.result.conditions])
        panels[0].set_ylim(count - 0.4, -0.6)
        return style.small_png(figure)


def variable_axis(axes: Any, axis: Axis, pad: float, width: int, bins: int) -> None:
    """A variable along x: its range with a pad at both ends, choices by their names, `width` characters a line."""
    axes.set_xlim(axis.low - pad, axis.high + pad)
    if axis.choices:
        axes.set_xticks(range(len(axis.choices)), [textwrap.fill(text, width) for text in axis.choices])
    else:
        axes.locator_params(axis="x", nbins=bins, integer=axis.variable.type == "integer")


def last_rows(read: SearchView, context: int) -> NDArray[np.int64]:
    """Rows of a condition's evaluated candidates in the last quarter of the search."""
    own = np.asarray(read.result.history.context) == context
    late = np.arange(len(own)) >= (1 - LAST) * len(own)
    return np.flatnonzero(own & late & read.ok)


def _condition_panel(axes: Any, read: SearchView, axis: Axis) -> None:
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
    variable_axis(axes, axis, 0.06 * (axis.high - axis.low) or 0.5, 10, 5)
    axes.grid(axis="y", visible=False)
    axes.tick_params(axis="y", length=0)
    axes.set_title(textwrap.fill(axis.title, 32), fontsize=9.5)
