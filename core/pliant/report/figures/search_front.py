"""Several objectives: all candidates, and those that none other beats in every respect."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from pliant.report.figures import style
from pliant.report.figures.search_history import shown_range
from pliant.report.figures.search_small import small_png
from pliant.report.search_view import SearchView

MOST_PAIRS = 3


def search_front(read: SearchView) -> style.Png | None:
    """A panel per pair of objectives; None for one objective."""
    pairs = list(itertools.combinations(range(len(read.objectives)), 2))[:MOST_PAIRS]
    if not pairs or not read.result.best:
        return None
    with style.canvas(1000 if len(pairs) == 1 else 560 * len(pairs), 640) as figure:
        for axes, pair in zip(figure.subplots(1, len(pairs), squeeze=False)[0], pairs, strict=True):
            _panel(axes, read, pair)
        figure.axes[0].legend(loc="best")
        figure.axes[0].set_title("The front among all candidates")
        return small_png(figure)


def _panel(axes: Any, read: SearchView, pair: tuple[int, int]) -> None:
    one, other = (read.objectives[k] for k in pair)
    axes.scatter(
        read.scores(pair[0]), read.scores(pair[1]), 10, color="#8fb3d0", lw=0, alpha=0.6, label="candidate"
    )
    points = np.array(
        [[d.objectives[o.name] * o.unit.factor for o in (one, other)] for d in read.result.best]
    )
    points = points[np.argsort(points[:, 0])]
    line = "-" if len(read.objectives) == 2 else ""
    axes.plot(
        *points.T, ls=line, marker="o", ms=6, color=style.WARN, lw=1.2, label=f"front ({len(points)} designs)"
    )
    for limit, objective, values in (
        (axes.set_xlim, one, points[:, 0]),
        (axes.set_ylim, other, points[:, 1]),
    ):
        low, high = shown_range(read.scores(objective.column), objective.maximised)
        low, high = min(low, values.min()), max(high, values.max())
        pad = 0.06 * (high - low) or 1e-9
        limit(low - pad, high + pad)
    axes.set(xlabel=f"{one.title}, {one.best_word}", ylabel=f"{other.title}, {other.best_word}")
