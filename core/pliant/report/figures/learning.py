"""Curves of error: against the number of states or of designs, and step by step on runs that were never fitted."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.ticker import FixedLocator, NullLocator

from pliant.diagnosis.steps import Improvement
from pliant.formatting import number, percent, unit_of
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


MOST_OUTPUTS = 2
HEIGHT_PX, WIDEST_PX = 600, 1770
STEP_PX, MARGIN_PX, SMALLEST_PX, NARROWEST_PX = 200, 160, 880, 1400


def error_steps(found: Improvement) -> style.Png:
    """A panel per output, the farthest above its floor first: a staircase with short labels."""
    first = found.steps[0].locked.rmse

    def above(name: str) -> float:
        floor = found.floors[name].value
        return first[name] / floor if floor > 0.0 else math.inf

    outputs = sorted(first, key=above, reverse=True)[:MOST_OUTPUTS]
    width = max(SMALLEST_PX, STEP_PX * len(found.steps) + MARGIN_PX) * len(outputs)
    with style.canvas(min(max(width, NARROWEST_PX), WIDEST_PX), HEIGHT_PX) as figure:
        for panel, name in zip(style.panels(figure, len(outputs), len(outputs)), outputs, strict=True):
            _step_panel(panel, found, name)
        return style.png(figure)


def _step_panel(axes: Any, found: Improvement, name: str) -> None:
    words, floor = unit_of(name), found.floors[name]
    places = np.arange(1, len(found.steps) + 1)
    locked = np.array([step.locked.rmse[name] for step in found.steps]) * words.factor
    training = np.array([step.training.rmse.get(name, np.nan) for step in found.steps]) * words.factor
    share = np.nan_to_num([step.locked_se / step.locked.over_floor for step in found.steps])
    level, error = floor.value * words.factor, floor.se * words.factor
    ends = (0.5, len(places) + 0.5)
    axes.fill_between(ends, level - 2 * error, level + 2 * error, color=style.FAINT, alpha=0.6, lw=0)
    axes.plot(ends, [level, level], color=style.SOFT, ls="--", lw=1.2)
    look: dict[str, Any] = {"ha": "right", "va": "top", "color": style.SOFT}
    known = f"noise floor {words.text(floor.value, 2)}" if level > 0.0 else "no noise floor is known"
    style.note(axes, known, (ends[1], level if level > 0.0 else 0.0), (-4, -5), **look)
    treads = [ends[0], *(places[:-1] + 0.5), ends[1]]
    axes.stairs(locked, treads, baseline=None, color=style.SERIES[0], alpha=0.35, lw=2.2)
    axes.plot(places, training, "o:", color=style.SOFT, ms=4, lw=1, label="training runs, left out in turn")
    label = "runs put aside at the start" if found.locked.runs else found.scored_on
    look = {"fmt": "o", "color": style.SERIES[0], "ms": 8, "lw": 2.2, "capsize": 4}
    axes.errorbar(places, locked, yerr=locked * share, label=label, **look)
    for x, value in zip(places, locked, strict=True):
        look = {"fontsize": 9.5, "weight": "bold", "color": style.SERIES[0]}
        style.note(axes, number(value, 3), (x, value), (9, 9), **look)
    axes.set_xticks(places, [_label(k, step.added) for k, step in enumerate(found.steps, start=1)])
    axes.grid(visible=False, axis="x")
    axes.set_xlim(*ends)
    axes.set_ylim(0, 1.38 * float(np.nanmax([*(locked * (1 + share)), *training, level])) or 1.0)
    axes.set_ylabel(f"rms error ({words.symbol})")
    axes.set_title(words.label)
    axes.legend(loc="upper right")


def _label(place: int, added: Sequence[str]) -> str:
    name = " + ".join(kind.replace("_", " ") for kind in added)
    return f"{place}\n+ {textwrap.fill(name, 14)}" if added else f"{place}\nas it was"
