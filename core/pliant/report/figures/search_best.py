"""The best designs of a search: settled, about their values, in scenarios, and as the check verified them."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np

from pliant.records.design import Array
from pliant.records.search import FoundDesign, Slope
from pliant.report.figures import style
from pliant.report.figures.search_axes import variable_axis
from pliant.report.figures.stills import SIDE, TOP, draw_still, outlines, upright_planes
from pliant.report.figures.success_shares import Series, success_shares
from pliant.report.search_files import DrawnDesign
from pliant.report.search_view import Axis, SearchView, measure_words, unit_of_measured

MOST = 8


def search_designs(drawn: Sequence[DrawnDesign]) -> style.Png | None:
    """A column per design, a row per view; None without designs."""
    shown = drawn[:MOST]
    if not shown:
        return None
    sets = [[one.result.final.markers_m, one.rest_m, _curve(one, "target_points_m")] for one in shown]
    for one, points in zip(shown, sets, strict=True):
        if one.result.stills:
            points[:] = [outlines(one.result.stills[-1:])]
    inside = np.concatenate([np.asarray(s) for of_one in sets for s in of_one if s is not None])
    size, low, high = np.ptp(inside, axis=0), inside.min(axis=0), inside.max(axis=0)
    planes = [SIDE, TOP] if all(d.result.stills for d in shown) else upright_planes(size)
    pad = 0.06 * float(size.max())
    width = 430 if len(shown) > 1 else 620
    with style.canvas(max(width * len(shown) + 90, 700), 500 * len(planes) + 60, pad=(0.06, 0.06)) as figure:
        grid = figure.subplots(len(planes), len(shown), squeeze=False, sharey="row", sharex="row")
        for (row, column), axes in np.ndenumerate(grid):
            i, j = planes[row]
            _draw(axes, shown[column], planes[row])
            axes.set(aspect="equal", xlabel=f"world {'xyz'[i]} (mm)")
            axes.set_xlim(1e3 * (low[i] - pad), 1e3 * (high[i] + pad))
            axes.set_ylim(1e3 * (low[j] - pad), 1e3 * (high[j] + pad))
            if column == 0:
                axes.set_ylabel(f"world {'xyz'[j]} (mm)")
            if row == 0:
                axes.set_title(textwrap.fill(shown[column].label, 26))
        handles = grid[0, 0].get_legend_handles_labels()
        if handles[0]:
            figure.legend(*handles, loc="outside lower center", ncols=4)
        return style.png(figure)


def _draw(axes: Any, one: DrawnDesign, plane: tuple[int, int]) -> None:
    if one.result.stills:
        draw_still(axes, one.result.stills[-1], plane)
        return

    def line(points: Array, *marks: str, **look: Any) -> None:
        axes.plot(*(1e3 * points[:, plane].T), *marks, **look)

    if one.rest_m is not None:
        line(one.rest_m, color=style.FAINT, lw=3, label="at rest")
    if (target := _curve(one, "target_points_m")) is not None:
        line(target, color=style.SERIES[1], lw=2, ls="--", label="target")
    markers, backbone = one.result.final.markers_m, _curve(one, "backbone_points_m")
    if backbone is not None and backbone.ndim == 2:
        line(backbone, color=style.SERIES[0], lw=2.2, label="settled")
        line(markers[1:-1], "o", ms=3.5, color=style.SERIES[0], label="joints")
    else:
        line(markers, "o-", ms=4, color=style.SERIES[0], label="settled")
    line(markers[:1], "s", ms=9, color=style.INK)


def _curve(one: DrawnDesign, name: str) -> Array | None:
    points = one.result.metrics.get(name)
    return None if points is None else np.array(points, float)


COLUMNS, PANEL_PX = 4, 390
LABEL = 26


def search_slopes(read: SearchView) -> style.Png | None:
    """Small multiples on one scale of the objective; None where nothing was tried."""
    slopes, best = read.by_influence(), read.best
    if not slopes or best is None:
        return None
    columns = min(COLUMNS, len(slopes))
    rows = -(-len(slopes) // columns)
    with style.canvas(max(PANEL_PX * columns + 60, 820), 330 * rows + 20, pad=(0.06, 0.07)) as figure:
        panels = style.panels(figure, len(slopes), columns, sharey=True)
        axes_of = {axis.name: axis for axis in read.axes}
        for axes, slope in zip(panels, slopes, strict=True):
            _slope_panel(axes, read, best, slope, axes_of[slope.name])
        for axes in panels[::columns]:
            axes.set_ylabel(textwrap.fill(read.objective.unit.axis, 22))
        return style.small_png(figure)


def _slope_panel(axes: Any, read: SearchView, best: FoundDesign, slope: Slope, axis: Axis) -> None:
    shares, objective = np.asarray(slope.shares, float), read.objective.stated(slope.objective)
    x = shares if axis.choices else axis.low + shares * (axis.high - axis.low)
    good = np.isfinite(objective)
    line = "" if axis.choices else "-"
    axes.plot(x[good], objective[good], ls=line, marker="o", ms=3.5, color=style.SERIES[0], lw=1.5)
    if (~good).any():
        look = {"color": style.SERIES[1], "clip_on": False, "transform": axes.get_xaxis_transform()}
        axes.plot(x[~good], np.full((~good).sum(), 0.96), "x", ms=5, mew=1.4, **look)
    at = axis.place(best.values.get(axis.name))
    value = float(best.objectives[read.objective.name]) * read.objective.unit.factor
    axes.plot([at], [value], "*", ms=13, color=style.WARN, mec="white", zorder=6, clip_on=False)
    if slope.at_bound:
        edge, shift, side = {"low": (axis.low, 6, "left"), "high": (axis.high, -6, "right")}[slope.at_bound]
        axes.axvline(edge, color=style.WARN, lw=3.5, zorder=1, clip_on=False)
        look = {"color": style.WARN, "bbox": {"boxstyle": "round,pad=0.1", "fc": "white", "ec": "none"}}
        place = {"xycoords": ("data", "axes fraction"), "ha": side, "fontsize": 8}
        style.note(axes, "at its bound", (edge, 0.9), (shift, 0), **place, **look)
    variable_axis(axes, axis, 0.4 if axis.choices else 0.05 * (axis.high - axis.low), 9, 4)
    axes.set_title(textwrap.fill(axis.title, LABEL), fontsize=9)
    if np.isfinite(slope.change):
        axes.set_xlabel(f"{read.objective.unit.text(abs(slope.change), 2)} for 1 % of the range", fontsize=8)


LOOKS = {"nominal": style.SERIES[1], "robust": style.SERIES[0]}


def search_robust(read: SearchView) -> style.Png | None:
    """Left: share of scenarios up to an objective. Right: every scenario of both designs as a dot."""
    found = read.result.robustness
    if found is None or not found.spread:
        return None
    factor = read.objective.unit.factor
    known = {
        "nominal": (found.nominal_of_nominal, found.robust_of_nominal),
        "robust": (found.nominal_of_robust, found.robust_of_robust),
    }
    with style.canvas(1500, 580, pad=(0.09, 0.06)) as figure:
        left, right = figure.subplots(1, 2)
        for row, (name, values) in enumerate(found.spread.items()):
            shown = factor * np.sort(np.asarray(values, float)[np.isfinite(values)])
            if not len(shown):
                continue
            colour = LOOKS.get(name, style.SERIES[2])
            share = 100 * np.arange(1, len(shown) + 1) / len(shown)
            look: dict[str, Any] = {"color": colour, "lw": 4 - 2 * row, "label": f"{name} design"}
            left.step([shown[0], *shown], [0, *share], where="post", **look)
            spread = np.random.default_rng(row).uniform(-0.16, 0.16, len(shown))
            right.scatter(shown, row + spread, 22, color=colour, lw=0, alpha=0.6)
            right.plot([np.median(shown)] * 2, [row - 0.22, row + 0.22], color=colour, lw=2.5)
            nominal, measured = known.get(name, (np.nan, np.nan))
            marks = (nominal, -0.3, "v", colour, "without any deviation"), (
                measured, 0.3, "^", style.INK, measure_words(found),
            )  # fmt: skip
            for value, shift, marker, shade, label in marks:
                look = {"ms": 10, "color": shade, "zorder": 6, "ls": "", "clip_on": False}
                right.plot(factor * value, row + shift, marker=marker, label=None if row else label, **look)
        left.set(ylim=(0, 103), ylabel="scenarios up to here (%)", title="Share of the scenarios")
        left.legend(loc="best")
        right.set_yticks(range(len(found.spread)), [f"{name}\ndesign" for name in found.spread])
        right.set(ylim=(len(found.spread) - 0.45, -0.55), title=f"Each of {found.samples} scenarios")
        for axes in (left, right):
            axes.set_xlabel(f"{read.objective.unit.axis}, {read.objective.best_word}")
        figure.legend(*right.get_legend_handles_labels(), loc="outside lower right", ncols=2)
        return style.png(figure)


MOST_METRICS = 4  # metrics that get a panel


def search_verified(read: SearchView) -> style.Png | None:
    """A panel per metric, a row per engine; None where nothing was verified."""
    found = read.result.verification
    names = read.checked_metrics()[:MOST_METRICS]
    engines = [e for e in found.verified if e in found.predicted] if found is not None else []
    if found is None or not names or not engines:
        return None
    with style.canvas(max(430 * len(names), 900), 130 + 90 * len(engines) + 60, pad=(0.08, 0.06)) as figure:
        panels = figure.subplots(1, len(names), squeeze=False, sharey=True)[0]
        for axes, name in zip(panels, names, strict=True):
            unit = unit_of_measured(name)
            for row, engine in enumerate(engines):
                both = (found.predicted[engine], found.verified[engine])
                pair = [float(side.get(name, np.nan)) * unit.factor for side in both]
                axes.plot(pair, [row, row], color=style.FAINT, lw=3, zorder=1)
                first = row == 0 and name == names[0]
                how = "verified by direct FEM" if found.laws else "simulated again"
                open_ = {"mfc": "white", "mew": 1.8, "label": "predicted" if first else None}
                axes.plot(pair[0], row, "o", ms=9, color=style.SERIES[0], **open_)
                axes.plot(pair[1], row, "D", ms=8, color=style.WARN, label=how if first else None)
            axes.set_yticks(range(len(engines)), engines)
            axes.set_ylim(len(engines) - 0.5, -0.5)
            axes.margins(x=0.25)
            axes.locator_params(axis="x", nbins=4)
            axes.set_title(textwrap.fill(unit.axis, 28))
        figure.legend(loc="outside lower center", ncols=2)
        return style.png(figure)


def search_successes(read: SearchView) -> style.Png | None:
    """Success of every condition in every engine with the interval of counting; None where nothing is counted."""
    counts = read.success_counts()
    conditions = list(dict.fromkeys(name for one in counts.values() for name in one))
    series = [
        Series(engine, [one[c] for c in conditions], [True] * len(conditions))
        for engine, one in counts.items()
        if all(c in one for c in conditions)
    ]
    return success_shares(conditions, series[0], series[1:]) if series else None
