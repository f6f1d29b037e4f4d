"""The best designs of a search: settled poses, slopes at their values, scenarios, and verified metrics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pliant.formatting import display_unit
from pliant.records.design import Array
from pliant.report.chart import (
    Chart,
    ChartAxis,
    ChartLine,
    ChartNote,
    ChartRule,
    Mark,
    Panel,
    one_height,
    optional_chart,
)
from pliant.report.chart_colours import FAINT, INK, SERIES, WARN
from pliant.report.contact_charts import TOP, instant_panel, outlines
from pliant.report.pose_charts import SIDE, upright_planes, world_line, world_panel
from pliant_counts.success_chart import Series, success_chart
from pliant_search.records import FoundDesign, Slope
from pliant_search.report.axes import variable_axis
from pliant_search.report.folder import DrawnDesign
from pliant_search.report.view import Axis, SearchView, labelled_metric_unit, measure_words

MOST = 8


def designs_chart(drawn: Sequence[DrawnDesign]) -> Chart | None:
    """Return a cell per design, a panel per view; None without designs."""
    shown = drawn[:MOST]
    if not shown:
        return None
    points = np.concatenate([_points(one) for one in shown])
    planes = [SIDE, TOP] if all(d.result.stills for d in shown) else upright_planes(np.ptp(points, axis=0))
    factor = display_unit("m").factor
    pad, low, high = 0.06 * float(np.ptp(points, axis=0).max()), points.min(axis=0), points.max(axis=0)
    panels = []
    for one in shown:
        for k, plane in enumerate(planes):
            panel = _view(one, plane)
            x, y = ((float(factor * (low[j] - pad)), float(factor * (high[j] + pad))) for j in plane)
            title = "" if k else one.label
            panels.append(replace(panel, x=replace(panel.x, ends=x), y=replace(panel.y, ends=y), title=title))
    cell = (430 if len(shown) > 1 else 700, 480 * len(planes))
    return Chart(tuple(panels), column=len(planes), across=MOST, cell=cell)


def _points(one: DrawnDesign) -> Array:
    """Return all points (n, 3) of a design's picture."""
    if one.result.stills:
        return outlines(one.result.stills[-1:])
    sets = [one.result.final.markers_m, one.rest_m, _curve(one, "target_points_m")]
    return np.concatenate([np.asarray(points) for points in sets if points is not None])


def _view(one: DrawnDesign, plane: tuple[int, int]) -> Panel:
    if one.result.stills:
        return instant_panel(one.result.stills[-1], plane)
    marks: list[Mark] = []
    if one.rest_m is not None:
        marks.append(world_line("at rest", one.rest_m, plane, FAINT, 3.0))
    if (target := _curve(one, "target_points_m")) is not None:
        marks.append(world_line("target", target, plane, SERIES[1], 2.0, dashed=True))
    markers, backbone = one.result.final.markers_m, _curve(one, "backbone_points_m")
    if backbone is not None and backbone.ndim == 2:
        marks.append(world_line("settled", backbone, plane, SERIES[0], 2.2))
        marks.append(world_line("joints", markers[1:-1], plane, SERIES[0], 0.0, 3.5))
    else:
        marks.append(world_line("settled", markers, plane, SERIES[0], 1.6, 4.0))
    marks.append(world_line("base", markers[:1], plane, INK, 0.0, 9.0, marker="s"))
    return world_panel(plane, marks, one.label)


def _curve(one: DrawnDesign, name: str) -> Array | None:
    points = one.result.metrics.get(name)
    return None if points is None else np.array(points, float)


def slopes_chart(read: SearchView) -> Chart | None:
    """Return small multiples on one scale of the objective; None where nothing was tried."""
    slopes, best = read.by_influence(), read.best
    if not slopes or best is None:
        return None
    axes = {axis.name: axis for axis in read.axes}
    panels = [_slope_panel(read, best, slope, axes[slope.name]) for slope in slopes]
    return optional_chart(one_height(panels), across=4, cell=(400, 350), legend=())


def _slope_panel(read: SearchView, best: FoundDesign, slope: Slope, axis: Axis) -> Panel:
    shares, objective = np.asarray(slope.shares, float), read.objective.stated(slope.objective)
    x = shares if axis.choices else axis.low + shares * (axis.high - axis.low)
    good, unit = np.isfinite(objective), read.objective.unit
    width = 0.0 if axis.choices else 1.5
    marks: list[Mark] = [ChartLine("objective", x[good], objective[good], "", SERIES[0], width, 3.5)]
    if (~good).any():
        rim = np.full(int((~good).sum()), 0.96)
        marks.append(ChartLine("no result", x[~good], rim, "", SERIES[1], 0.0, 5.0, "x", rim=True))
    star = np.array([axis.place(best.values.get(axis.name))])
    value = np.array([float(best.objectives[read.objective.name]) * unit.factor])
    marks.append(ChartLine("best", star, value, "", WARN, 0.0, 13.0, "*"))
    if slope.at_bound:
        edge, side = {"low": (axis.low, "right"), "high": (axis.high, "left")}[slope.at_bound]
        marks.append(ChartRule(edge, WARN, 3.5, upright=True))
        marks.append(ChartNote("at its bound", edge, 0.9, side, WARN, rim=True))
    across = variable_axis(axis, 0.4 if axis.choices else 0.05 * (axis.high - axis.low))
    title = f"{unit.text(abs(slope.change), 2)} per 1 % of the range" if np.isfinite(slope.change) else ""
    return Panel(across, ChartAxis(unit.label, unit.symbol), tuple(marks), title)


LOOKS = {"nominal": SERIES[1], "robust": SERIES[0]}


def robust_chart(read: SearchView) -> Chart | None:
    """Return the share of scenarios up to an objective (left), and every scenario of both designs as a dot (right)."""
    found = read.result.robustness
    if found is None or not found.spread:
        return None
    factor, unit = read.objective.unit.factor, read.objective.unit
    known = {
        "nominal": (found.nominal_of_nominal, found.robust_of_nominal),
        "robust": (found.nominal_of_robust, found.robust_of_robust),
    }
    shares: list[Mark] = []
    dots: list[Mark] = []
    for row, (name, values) in enumerate(found.spread.items()):
        shown = factor * np.sort(np.asarray(values, float)[np.isfinite(values)])
        if not len(shown):
            continue
        colour, label = LOOKS.get(name, SERIES[2]), f"{name} design"
        share = 100 * np.arange(len(shown) + 1) / len(shown)
        steps = np.repeat([shown[0], *shown], 2)[1:], np.repeat(share, 2)[:-1]
        shares.append(ChartLine(label, *steps, "", colour, 4.0 - 2 * row))
        spread = np.random.default_rng(row).uniform(-0.16, 0.16, len(shown))
        dots.append(ChartLine(label, shown, row + spread, "", f"{colour}99", 0.0, 4.7))
        middle = np.full(2, np.median(shown)), row + np.array([-0.22, 0.22])
        dots.append(ChartLine(label, *middle, "", colour, 2.5))
        nominal, measured = known.get(name, (np.nan, np.nan))
        for value, shift, marker, shade, words in (
            (nominal, -0.3, "v", colour, "without any deviation"),
            (measured, 0.3, "^", INK, measure_words(found)),
        ):
            at = np.array([factor * value]), np.array([row + shift])
            dots.append(ChartLine(words, *at, "", shade, 0.0, 10.0, marker))
    x = ChartAxis(f"{unit.label}, {read.objective.best_word}", unit.symbol)
    names = ChartAxis("design", names=tuple(f"{name} design" for name in found.spread))
    left = Panel(
        x, ChartAxis("scenarios up to here", "%", ends=(0.0, 103.0)), tuple(shares), "Share of the scenarios"
    )
    return Chart((left, Panel(x, names, tuple(dots), f"Each of {found.samples} scenarios")), cell=(750, 540))


MOST_METRICS = 4  # number of metrics with a panel


def verified_chart(read: SearchView) -> Chart | None:
    """Return a panel per metric, a row per engine; None where nothing was verified."""
    found = read.result.verification
    names = read.checked_metrics()[:MOST_METRICS]
    engines = [e for e in found.verified if e in found.predicted] if found is not None else []
    if found is None or not names or not engines:
        return None
    how = "verified by direct FEM" if found.laws else "simulated again"
    panels, rows = [], np.arange(float(len(engines)))
    for name in names:
        unit = labelled_metric_unit(name)
        predicted, verified = (
            unit.factor * np.array([float(side[engine].get(name, np.nan)) for engine in engines])
            for side in (found.predicted, found.verified)
        )
        marks: list[Mark] = [
            ChartLine("", np.array([a, b]), np.full(2, row), "", FAINT, 3.0)
            for a, b, row in zip(predicted, verified, rows, strict=True)
        ]
        marks.append(ChartLine("predicted", predicted, rows, "", SERIES[0], 0.0, 9.0, hollow=True))
        marks.append(ChartLine(how, verified, rows, "", WARN, 0.0, 8.0, "D"))
        y = ChartAxis("engine", names=tuple(engines))
        panels.append(Panel(ChartAxis(unit.label, unit.symbol), y, tuple(marks)))
    return Chart(tuple(panels), across=4, cell=(460, 150 + 90 * len(engines)))


def successes_chart(read: SearchView) -> Chart | None:
    """Return successes of every condition in every engine with counting intervals; None where nothing is counted."""
    counts = read.success_counts()
    conditions = list(dict.fromkeys(name for one in counts.values() for name in one))
    series = [
        Series(engine, [one[c] for c in conditions], [True] * len(conditions))
        for engine, one in counts.items()
        if all(c in one for c in conditions)
    ]
    return success_chart(conditions, series[0], series[1:]) if series else None
