"""The designs of a search on the axes of its variables: the best ones, all candidates, designs by condition."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pliant.formatting import number
from pliant.records.design import Array
from pliant.report.chart import Chart, ChartAxis, ChartLine, ChartNote, Mark, Panel, optional_chart
from pliant.report.chart_colours import INK, SERIES, SOFT, WARN, ColourScale
from pliant_search.records import FoundDesign
from pliant_search.report.view import Axis, SearchView, log_suits, shown_range

SHAPES = ("o", "s", "D", "^", "v", "P", "x", "*")
MOST_MARKED = 8  # number of designs with separate colours and markers


def answer_chart(read: SearchView) -> Chart | None:
    """Return ranges as bars, the best designs as marks on them; None without a design."""
    best = read.result.best
    shown = [a for a in read.axes if any(np.isfinite(a.place(read.value(d, a.name))) for d in best)]
    if not shown:
        return None
    several = len(best) > 1
    marks: list[Mark] = []
    for row, axis in enumerate(shown):
        marks.append(ChartLine("", np.array([0.0, 1.0]), np.full(2, float(row)), "", "#e3e7ee", 7.0))
        if steps := discrete(axis):
            at = axis.share(np.array(steps))
            marks.append(ChartLine("", at, np.full(len(at), float(row)), "", SOFT, 0.0, 7.0, "|"))
        marks += _ends(axis, row)
    for k, design in enumerate(best):
        marks += _marked_design(shown, design, k, read, several)
    x = ChartAxis(ends=(-0.14, 1.14 if several else 1.24))
    y = ChartAxis("", names=tuple(a.title for a in shown))
    panel = Panel(x, y, tuple(marks), f"The best design{'s' * several} in what was searched")
    names = read.design_names() if several and len(best) <= MOST_MARKED else ()
    return Chart((panel,), cell=(1500, 62 * len(shown) + 110), legend=tuple(names))


def _ends(axis: Axis, row: int) -> list[Mark]:
    """Return the ends of a range next to its bar."""
    ends = ((0.0, axis.low, "left"), (1.0, axis.high, "right"))
    return [ChartNote(axis.tick(value), at, row, side, SOFT) for at, value, side in ends]


def _marked_design(
    axes: list[Axis], design: FoundDesign, number: int, read: SearchView, several: bool
) -> list[Mark]:
    """Return one design's marks; the values of a single one are written at the right."""
    count = len(read.result.best)
    own = count <= MOST_MARKED
    colour = SERIES[number % 6] if own else f"{SERIES[0]}80"
    shift = 0.36 * (number / (count - 1) - 0.5) if several else 0.0
    places = np.array([float(axis.share(axis.place(read.value(design, axis.name)))) for axis in axes])
    rows: Array = np.arange(float(len(axes))) + shift
    size = (7.0 if own else 4.5) if several else 10.0
    marker = SHAPES[number % len(SHAPES)] if own else "o"
    name = read.design_names()[number]
    marks: list[Mark] = [ChartLine(name, places, rows, "", colour, 0.0, size, marker)]
    for row, axis in enumerate(() if several else axes):
        marks.append(
            ChartNote(axis.text(read.value(design, axis.name)), 1.09, row, "right", colour, bold=True)
        )
    return marks


def discrete(axis: Axis, most: int = 24) -> list[float]:
    """Return the values of an integer or of choices, if they are few."""
    if axis.choices:
        return [float(k) for k in range(len(axis.choices))]
    if axis.variable.type == "integer" and axis.high - axis.low < most:
        return np.arange(axis.low, axis.high + 0.5).tolist()
    return []


MOST_LINES = 400
BEST_SHARE = 0.1
SHADES = ("#12305c", "#0072b2", "#6fa8d3", "#b9cde1", "#e8ecf2")  # the best dark blue, the worst pale
JITTER = 0.03  # of the range: candidates with the same integer or choice are drawn next to each other


def parallel_chart(read: SearchView) -> Chart | None:
    """Return a row per variable, the objective in the last one; None if fewer than two candidates have an objective."""
    rows, axes = thinned(read.order()), read.varied()
    if len(rows) < 2 or not axes:
        return None
    scores, scale = read.scores()[rows], _Scale.from_view(read)
    places = np.array([*(_places(axis, rows) for axis in axes), scale.places(scores)])
    levels = np.arange(float(len(places)))
    shades = ColourScale.even("", "", (0.0, 1.0), SHADES)
    colours, good = shades.to_hex(scale.places(scores)), BEST_SHARE * len(rows)
    marks: list[Mark] = [
        ChartLine("candidate", places[:, k], levels, "", f"{colours[k]}bf", 1.1 if k < good else 0.7)
        for k in range(len(rows) - 1, 0, -1)
    ]
    for level, axis in enumerate(axes):
        marks += _parallel_axis(axis, level)
    marks += scale.marks(len(axes))
    marks.append(ChartLine("best", places[:, 0], levels, "", WARN, 2.4, 5.0))
    y = ChartAxis(
        "", names=(*(a.title for a in axes), read.objective.unit.axis), ends=(-0.5, len(levels) - 0.3)
    )
    title = f"{len(rows)} of {int(read.ok.sum())} evaluated candidates, the best in orange"
    panel = Panel(ChartAxis(ends=(-0.13, 1.13)), y, tuple(marks), title, scale=None)
    return Chart((panel,), cell=(1560, 74 * len(levels) + 130), legend=())


def thinned(order: NDArray[np.int64], most: int = MOST_LINES) -> NDArray[np.int64]:
    """Return at most `most` of the rows, best first: the best tenth (up to half of `most`), the rest evenly by rank."""
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
    def from_view(read: SearchView) -> _Scale:
        scores, up = read.scores(), read.objective.maximised
        log = log_suits(scores)
        finite = scores[np.isfinite(scores)]
        low, high = (float(finite.min()), float(finite.max())) if log else shown_range(scores, up)
        return _Scale(*((high, low) if up else (low, high)), log)

    def places(self, scores: Array | list[float]) -> Array:
        """Return positions: 0 at the best value, 1 at the worst shown one and beyond it."""
        warp = np.log if self.log else np.asarray
        best, worst, own = (np.asarray(warp(np.asarray(v, float))) for v in (self.best, self.worst, scores))
        span = float(worst - best)
        return np.clip((own - best) / span, 0, 1) if span else np.zeros(len(own))

    def marks(self, level: int) -> list[Mark]:
        """Return the axis line with a few values under it."""
        marks: list[Mark] = [ChartLine("", np.array([0.0, 1.0]), np.full(2, float(level)), "", INK, 1.0)]
        for share in np.linspace(0, 1, 5).tolist():
            if self.log:
                value = np.exp(np.log(self.best) + share * (np.log(self.worst) - np.log(self.best)))
            else:
                value = self.best + share * (self.worst - self.best)
            marks.append(ChartNote(number(float(value), 3), share, level, "below"))
        return marks


def _places(axis: Axis, rows: NDArray[np.int64]) -> Array:
    """Return the candidates' positions on an axis; those of few values are spread slightly, always in the same way."""
    share = axis.share(axis.values[rows])
    if steps := discrete(axis):
        spread = np.random.default_rng(len(rows)).uniform(-1, 1, len(rows)) * min(JITTER, 0.25 / len(steps))
        spread[0] = 0.0
        share = share + spread
    return share


def _parallel_axis(axis: Axis, level: int) -> list[Mark]:
    """Return an axis line, its ends in display units, and a tick at every choice or integer."""
    row = float(level)
    marks: list[Mark] = [ChartLine("", np.array([0.0, 1.0]), np.full(2, row), "", INK, 1.0)]
    if not (steps := discrete(axis, 13)):
        return [*marks, *_ends(axis, level)]
    at = axis.share(np.array(steps))
    marks.append(ChartLine("", at, np.full(len(at), row), "", INK, 0.0, 9.0, "|"))
    for step, share in zip(steps, at.tolist(), strict=True):
        text = axis.tick(step)
        marks.append(ChartNote(text if len(text) <= 18 else text[:17] + "…", share, row, "above"))
    return marks


LAST = 0.25  # of the search
MOST_DOTS = 150  # of a condition


def policy_chart(read: SearchView) -> Chart | None:
    """Return one panel per variable, one row per condition; None for searches without contexts."""
    if not read.contextual:
        return None
    panels = [_condition_panel(read, axis) for axis in read.varied()]
    count = len(read.result.conditions)
    return optional_chart(panels, cell=(600, 42 * count + 150), legend=())


def variable_axis(axis: Axis, pad: float) -> ChartAxis:
    """Return the axis of a variable: its range with a pad at both ends, choices by name."""
    return ChartAxis(axis.title, names=axis.choices, ends=(axis.low - pad, axis.high + pad))


def last_rows(read: SearchView, context: int) -> NDArray[np.int64]:
    """Return the rows of a condition's evaluated candidates in the last quarter of the search."""
    own = np.asarray(read.result.history.context) == context
    late = np.arange(len(own)) >= (1 - LAST) * len(own)
    return np.flatnonzero(own & late & read.ok)


def _condition_panel(read: SearchView, axis: Axis) -> Panel:
    marks: list[Mark] = []
    for context, name in enumerate(read.result.conditions):
        rows, colour = last_rows(read, context), SERIES[context % 6]
        values = axis.values[rows][np.isfinite(axis.values[rows])]
        if not len(values):
            continue
        few = values[np.unique(np.linspace(0, len(values) - 1, MOST_DOTS).astype(int))]
        spread = np.random.default_rng(context).uniform(-0.22, 0.22, (2, len(few)))
        steps, row = discrete(axis), float(context)
        wide = 0.12 if steps else 0.0
        marks.append(
            ChartLine("candidate", few + wide * spread[1], row + spread[0], name, f"{colour}73", 0.0, 3.0)
        )
        if not steps:
            low, q1, middle, q3, high = np.percentile(values, [5, 25, 50, 75, 95]).tolist()
            level = np.full(2, row)
            marks.append(ChartLine("5 to 95 %", np.array([low, high]), level, name, colour, 1.5))
            marks.append(ChartLine("25 to 75 %", np.array([q1, q3]), level, name, colour, 5.0))
            marks.append(
                ChartLine("median", np.full(2, middle), row + np.array([-0.2, 0.2]), name, colour, 2.0)
            )
    for design in read.result.best:
        at = axis.place(read.value(design, axis.name))
        if np.isfinite(at) and design.context >= 0:
            star = np.array([at]), np.array([float(design.context)])
            marks.append(
                ChartLine("best", *star, read.result.conditions[design.context], INK, 0.0, 12.0, "*")
            )
    x = variable_axis(axis, 0.06 * (axis.high - axis.low) or 0.5)
    return Panel(x, ChartAxis("", names=tuple(read.result.conditions)), tuple(marks))
