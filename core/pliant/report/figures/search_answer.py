"""Where the best designs stand within what was searched: one bar per variable."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np

from pliant.records.search import FoundDesign
from pliant.report.figures import style
from pliant.report.figures.search_small import small_png
from pliant.report.search_view import Axis, SearchView

ROW_PX, WIDTH_PX = 62, 1500
LABEL = 34  # characters of a variable's name on one line
MARKS = ("o", "s", "D", "^", "v", "P", "X", "*")
MOST = 8  # designs that get a colour and a mark of their own


def search_answer(read: SearchView) -> style.Png | None:
    """Ranges as bars, the best designs as marks on them; None without a design."""
    axes_of = [
        a for a in read.axes if any(np.isfinite(a.place(read.value(d, a.name))) for d in read.result.best)
    ]
    if not axes_of:
        return None
    several = len(read.result.best) > 1
    with style.canvas(WIDTH_PX, ROW_PX * len(axes_of) + 110 + 60 * several, pad=(0.08, 0.06)) as figure:
        axes = figure.subplots()
        for row, axis in enumerate(axes_of):
            _range(axes, axis, row)
        for number, design in enumerate(read.result.best):
            _design(axes, axes_of, design, number, read, several)
        axes.set_yticks(range(len(axes_of)), [textwrap.fill(a.title, LABEL) for a in axes_of])
        axes.set(ylim=(len(axes_of) - 0.45, -0.55), xlim=(-0.14, 1.14 if several else 1.24))
        axes.set_xticks([])
        axes.grid(visible=False)
        axes.tick_params(axis="y", length=0)
        for side in ("left", "bottom"):
            axes.spines[side].set_visible(False)
        axes.set_title(
            "The best designs in what was searched" if several else "The best design in what was searched"
        )
        if several and len(read.result.best) <= MOST:
            figure.legend(loc="outside lower center", ncols=min(4, len(read.result.best)))
        return small_png(figure)


def _range(axes: Any, axis: Axis, row: int) -> None:
    axes.plot([0, 1], [row, row], color="#e3e7ee", lw=7, solid_capstyle="round", zorder=1)
    look: dict[str, Any] = {"fontsize": 8, "color": style.SOFT, "va": "center"}
    axes.annotate(axis.tick(axis.low), (0, row), (-8, 0), textcoords="offset points", ha="right", **look)
    axes.annotate(axis.tick(axis.high), (1, row), (8, 0), textcoords="offset points", ha="left", **look)
    if steps := discrete(axis):
        axes.plot(
            axis.share(np.array(steps)), [row] * len(steps), "|", color=style.SOFT, ms=7, mew=1.0, zorder=2
        )


def _design(
    axes: Any, axes_of: list[Axis], design: FoundDesign, number: int, read: SearchView, several: bool
) -> None:
    """One design's marks; a single one is written out at the right."""
    count = len(read.result.best)
    own = count <= MOST
    colour = style.SERIES[number % 6] if own else style.SERIES[0]
    shift = 0.36 * (number / (count - 1) - 0.5) if several else 0.0
    places = [float(axis.share(axis.place(read.value(design, axis.name)))) for axis in axes_of]
    rows = np.arange(len(axes_of)) + shift
    axes.plot(
        places, rows, ls="", marker=MARKS[number % len(MARKS)] if own else "o",
        ms=(7 if own else 4.5) if several else 10,
        color=colour, mec="white", mew=0.8 if own else 0, alpha=1 if own else 0.5, zorder=4,
        label=read.design_names()[number],
    )  # fmt: skip
    if several:
        return
    for row, axis in enumerate(axes_of):
        text = axis.text(read.value(design, axis.name))
        axes.annotate(text, (1.09, row), va="center", fontsize=10, weight="bold", color=colour)


def discrete(axis: Axis, most: int = 24) -> list[float]:
    """The values of an integer or of choices, where there are few."""
    if axis.choices:
        return [float(k) for k in range(len(axis.choices))]
    if axis.type == "integer" and axis.high - axis.low < most:
        return np.arange(axis.low, axis.high + 0.5).tolist()
    return []
