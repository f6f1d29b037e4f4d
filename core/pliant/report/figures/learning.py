"""Learning curves: error against the number of states, or of designs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.ticker import FixedLocator, NullLocator

from pliant.formatting import percent
from pliant.report.figures import style

SMALLEST = 1e-8


@dataclass(frozen=True)
class Curve:
    """One line: `points` of (n, share), several for one n where orders differ; `dashed` for the worst error."""

    label: str
    points: Sequence[tuple[int, float]]
    colour: int = 0
    dashed: bool = False


def state_curves(learning: Mapping[str, Any]) -> list[Curve]:
    """Lines of a surrogate's learning curve: RMS and worst, with slopes and without."""
    curves = []
    names = list(dict.fromkeys(p["slopes"] for p in learning["points"]))
    for name in names:
        colour = 0 if name == "with slopes" else 1
        chosen = [p for p in learning["points"] if p["slopes"] == name]
        curves.append(Curve(f"{name}, RMS", [(p["n"], p["rms"]) for p in chosen], colour))
        curves.append(Curve(f"{name}, worst", [(p["n"], p["worst"]) for p in chosen], colour, dashed=True))
    return curves


def learning_picture(
    panels: Mapping[str, Sequence[Curve]], x_label: str, y_label: str, mark: float | None = None
) -> style.Png:
    """One panel for each title; `mark` draws a line at a share that is of interest."""
    with style.canvas(1000 if len(panels) == 1 else 1560, 640, wspace=0.04) as figure:
        grid = figure.subplots(1, len(panels), squeeze=False)[0]
        for axes, (title, curves) in zip(grid, panels.items(), strict=True):
            _panel(axes, title, curves, mark)
            axes.set_xlabel(x_label)
        grid[0].set_ylabel(y_label)
        return style.png(figure)


def _panel(axes: Any, title: str, curves: Sequence[Curve], mark: float | None) -> None:
    for curve in curves:
        n = np.array(sorted({count for count, _ in curve.points}))
        by_n = [[100 * max(s, SMALLEST) for count, s in curve.points if count == size] for size in n]
        middle = [float(np.median(values)) for values in by_n]
        colour = style.SERIES[curve.colour % len(style.SERIES)]
        if any(len(values) > 1 for values in by_n):
            axes.fill_between(
                n, [min(v) for v in by_n], [max(v) for v in by_n], color=colour, alpha=0.13, lw=0, zorder=2
            )
        look: dict[str, Any] = (
            {"ls": "--", "marker": "D", "mfc": "white"} if curve.dashed else {"marker": "o"}
        )
        axes.plot(n, middle, color=colour, ms=5.5, zorder=4, label=curve.label, **look)
    if mark is not None:
        axes.axhline(100 * mark, color=style.SERIES[2], lw=1.2, zorder=1)
        axes.annotate(
            percent(mark), (1, 100 * mark), (-4, 3), xycoords=("axes fraction", "data"),
            textcoords="offset points", ha="right", fontsize=8.5, color=style.SERIES[2],
        )  # fmt: skip
    axes.set(xscale="log", yscale="log")
    sizes = sorted({count for curve in curves for count, _ in curve.points})
    axes.xaxis.set_major_locator(FixedLocator(_apart(sizes)))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:.0f}")
    style.log_labels(axes.yaxis)
    axes.set_title(title)
    axes.legend(loc="best", fontsize=8)


def _apart(sizes: Sequence[int]) -> list[int]:
    """Sizes far enough from each other for labels on a log axis."""
    kept: list[int] = []
    for size in reversed(sizes):
        if not kept or kept[-1] / size > 1.12:
            kept.append(size)
    return kept[::-1]
