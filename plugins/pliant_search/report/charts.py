"""Charts of a search: its course, the front, the best designs, slopes at their values, scenarios, verified metrics."""

from __future__ import annotations

import itertools
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
    padded,
    staircase,
)
from pliant.report.chart_colours import FAINT, INK, SERIES, SOFT, WARN
from pliant.report.contact_charts import TOP, instant_panel, outlines
from pliant.report.pose_charts import SIDE, upright_planes, world_line, world_panel
from pliant_counts.success_chart import Series, success_chart
from pliant_search.records import STATUSES, FoundDesign, Slope
from pliant_search.report.folder import DrawnDesign
from pliant_search.report.variable_charts import variable_axis
from pliant_search.report.view import (
    Axis,
    SearchView,
    labelled_metric_unit,
    log_suits,
    measure_words,
    shown_range,
)

NAMED = 24  # branches that are all named; of more, only the first few are
FIRST_NAMED = 5
WINDOW = 0.05  # share of the search over which a moving median is taken
CANDIDATE = "#8fb3d0"
MOST_DRAWN = 8000  # candidates; of more every n-th is drawn, while the best so far uses all of them
CAUSES = (("refused", SERIES[4]), ("failed", SERIES[1]), ("not_a_number", SERIES[3]))


def history_chart(read: SearchView) -> Chart:
    """Return candidates over their number, failures at the rim, best so far; with contexts a moving median."""
    scores, branches = read.scores(), len(read.result.branches)
    x = np.arange(1.0, len(scores) + 1)
    branch = np.asarray(read.result.history.branch)
    if branches > 1:  # the number within its branch
        for k in np.unique(branch):
            x[branch == k] = np.arange(1, (branch == k).sum() + 1)
    y = _objective_axis(read, scores)
    marks: list[Mark] = []
    if read.ok.any():
        marks += _candidates(read, x, scores, y.ends)
        marks += (_branch_lines if branches > 1 else _medians if read.contextual else _best_so_far)(
            read, x, scores
        )
    marks += _failures(read, x)
    each = " of its search" if branches > 1 else ""
    across = ChartAxis(
        f"candidate{each}, in the order of evaluation", ends=(0.0, 1.01 * float(x.max(initial=1.0)))
    )
    title = f"Objective of every candidate ({read.objective.best_word})"
    return Chart((Panel(across, y, tuple(marks), title),), cell=(1560, 580))


def _objective_axis(read: SearchView, scores: Array) -> ChartAxis:
    """Return a log axis where it helps; else an axis without the worst few, which are drawn at its edge."""
    unit, finite = read.objective.unit, scores[np.isfinite(scores)]
    if not len(finite):
        return ChartAxis(unit.label, unit.symbol, ends=(0.0, 1.0))
    if log_suits(scores):
        ends = float(finite.min() / 1.25), float(finite.max() * 1.9)
        return ChartAxis(unit.label, unit.symbol, ends=ends, log=True)
    low, high = shown_range(scores, read.objective.maximised)
    pad = 0.06 * (high - low) or 0.05 * max(abs(high), 1e-12)
    return ChartAxis(unit.label, unit.symbol, ends=(low - pad, high + 2.6 * pad))


def _candidates(read: SearchView, x: Array, scores: Array, ends: tuple[float, float] | None) -> list[Mark]:
    stride = -(-len(scores) // MOST_DRAWN)
    x, shown = x[::stride], (scores if ends is None else np.clip(scores, *ends))[::stride]
    n = int(np.isfinite(shown).sum())
    size, opacity = (4.0, "cc") if n < 500 else ((2.8, "80") if n < 6000 else (1.6, "40"))
    if not read.contextual:
        return [ChartLine("candidate", x, shown, "", CANDIDATE + opacity, 0.0, size)]
    context = np.asarray(read.result.history.context)[::stride]
    return [
        ChartLine("candidate", x[mine], shown[mine], read.condition(k), SERIES[k % 6] + "60", 0.0, size)
        for k in np.unique(context[context >= 0]).tolist()
        if (mine := context == k).any()
    ]


def _best_so_far(read: SearchView, x: Array, scores: Array) -> list[Mark]:
    best = (np.fmax if read.objective.maximised else np.fmin).accumulate(scores)
    marks: list[Mark] = [ChartLine("best so far", *staircase(x, best), "", SERIES[0], 1.8)]
    row = int(read.order()[0])
    return [*marks, ChartLine("best", x[row : row + 1], scores[row : row + 1], "", WARN, 0.0, 13.0, "*")]


def _branch_lines(read: SearchView, x: Array, scores: Array) -> list[Mark]:
    """Return the best so far of every branch, that of the winner in front."""
    better, names = np.fmax if read.objective.maximised else np.fmin, read.branch_names()
    branch, found = np.asarray(read.result.history.branch), read.branch_winners()
    marks: list[Mark] = []
    for number, row in reversed(found):
        mine, first = branch == number, number == found[0][0]
        colour, width = (WARN, 2.4) if first else (f"{SERIES[0]}73", 0.8)
        name = (
            f"best so far of the winning search ({names[number]})" if first else "best so far of each search"
        )
        at = staircase(x[mine], better.accumulate(scores[mine]))
        marks.append(ChartLine(name, *at, names[number], colour, width))
        if first:
            star = x[row : row + 1], scores[row : row + 1]
            marks.append(ChartLine("best", *star, names[number], WARN, 0.0, 13.0, "*"))
    return marks


def _medians(read: SearchView, x: Array, scores: Array) -> list[Mark]:
    """Return the moving median of each condition: the result of a policy at that time."""
    context = np.asarray(read.result.history.context)
    marks: list[Mark] = []
    for k in np.unique(context[context >= 0]).tolist():
        mine = np.flatnonzero((context == k) & np.isfinite(scores))
        if len(mine):
            at, name = moving_median(x[mine], scores[mine]), read.condition(k)
            marks.append(ChartLine(name, *at, name, SERIES[k % 6], 2.0, dashed=k > 5))
    return marks


def moving_median(x: Array, values: Array) -> tuple[Array, Array]:
    """Return the median over windows of a twentieth of the search (at least five candidates), at their middles."""
    width = max(5, int(WINDOW * len(x)))
    starts = np.unique(np.linspace(0, max(len(x) - width, 0), 60).astype(int))
    return (
        np.array([x[s : s + width].mean() for s in starts]),
        np.array([np.median(values[s : s + width]) for s in starts]),
    )


def _failures(read: SearchView, x: Array) -> list[Mark]:
    """Return candidates without an objective as strokes at the upper rim, one row per status."""
    status = np.asarray(read.result.history.status)
    kinds = [(name, colour, status == STATUSES.index(name)) for name, colour in CAUSES]
    kinds.append(("breaks a constraint on metrics", SOFT, read.broken))
    marks: list[Mark] = []
    for row, (name, colour, mine) in enumerate(kind for kind in kinds if kind[2].any()):
        stride = -(-int(mine.sum()) // MOST_DRAWN)
        at, label = x[mine][::stride], f"{name.replace('_', ' ')} ({int(mine.sum())})"
        height = np.full(len(at), 0.985 - 0.035 * row)
        marks.append(ChartLine(label, at, height, "", f"{colour}b0", 0.0, 6.0, "|", rim=True))
    return marks


def branches_chart(read: SearchView) -> Chart | None:
    """Return the best of every branch, sorted, a few with names; None for one branch, or without a design."""
    found = read.branch_winners()
    if len(read.result.branches) < 2 or not found:
        return None
    names, scores, unit = read.branch_names(), read.scores(), read.objective.unit
    values, rank = np.array([scores[row] for _, row in found]), np.arange(float(len(found)))
    labels = [names[branch] for branch, _ in found]
    few, best = len(found) <= NAMED, ChartAxis(f"best {unit.label}", unit.symbol, log=log_suits(values))
    title = f"Best of each of {len(found)} searches ({read.branch_title()})"
    x, y = (values, rank) if few else (rank + 1, values)
    marks: list[Mark] = [
        ChartLine("search", x, y, "", SERIES[0], 0.0, 7.0 if few else 4.5),
        ChartLine("best search", x[:1], y[:1], "", WARN, 0.0, 10.0),
    ]
    if few:
        panel = Panel(best, ChartAxis("search", names=tuple(labels)), tuple(marks), title)
        return Chart((panel,), cell=(1300, 40 * len(found) + 200), legend=())
    # The names are in the free corner, on the side where the curve is far from the best.
    rising = bool(values[-1] > values[0])
    for k, label in enumerate(labels[:FIRST_NAMED]):
        height = 0.95 - 0.06 * k if rising else 0.05 + 0.06 * (FIRST_NAMED - 1 - k)
        marks.append(ChartNote(f"{k + 1}.  {label}", 0.01 * len(values), height, rim=True))
    across = ChartAxis("rank of the search", ends=(0.0, len(values) + 1.0))
    return Chart((Panel(across, best, tuple(marks), title),), cell=(1560, 560), legend=())


MOST_PAIRS = 3


def front_chart(read: SearchView) -> Chart | None:
    """Return a panel per pair of objectives; None for one objective."""
    pairs = _pairs(read)
    if not pairs or not read.result.best:
        return None
    panels = [_front_panel(read, pair) for pair in pairs]
    return optional_chart(panels, cell=(1000 if len(pairs) == 1 else 560, 600))


def _front_panel(read: SearchView, pair: tuple[int, int]) -> Panel:
    both, points = [read.objectives[k] for k in pair], _front(read, pair)
    scores = [read.scores(k) for k in pair]
    stride, axes = -(-len(scores[0]) // MOST_DRAWN), []
    for objective, score, values in zip(both, scores, points.T, strict=True):
        low, high = shown_range(score, objective.maximised)
        ends = padded(min(low, float(values.min())), max(high, float(values.max())))
        axes.append(
            ChartAxis(f"{objective.unit.label}, {objective.best_word}", objective.unit.symbol, ends=ends)
        )
    joined = 1.2 if len(read.objectives) == 2 else 0.0
    marks = (
        ChartLine("candidate", scores[0][::stride], scores[1][::stride], "", f"{CANDIDATE}99", 0.0, 3.5),
        ChartLine(f"front ({len(points)} designs)", points[:, 0], points[:, 1], "", WARN, joined, 6.0),
    )
    return Panel(axes[0], axes[1], marks, "The front among all candidates")


def _pairs(read: SearchView) -> list[tuple[int, int]]:
    """Return the first pairs of objectives, by number."""
    return list(itertools.combinations(range(len(read.objectives)), 2))[:MOST_PAIRS]


def _front(read: SearchView, pair: tuple[int, int]) -> Array:
    """Return (n, 2) a pair's objectives of the best designs, in their units, sorted by the first."""
    both = [read.objectives[k] for k in pair]
    points = np.array([[d.objectives[o.name] * o.unit.factor for o in both] for d in read.result.best])
    return np.asarray(points[np.argsort(points[:, 0])])


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
