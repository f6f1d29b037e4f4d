"""The course of a search: every candidate's objective, the best of every branch, the front."""

from __future__ import annotations

import itertools

import numpy as np

from pliant.records.design import Array
from pliant.report.chart import (
    Chart,
    ChartAxis,
    ChartLine,
    ChartNote,
    Mark,
    Panel,
    optional_chart,
    padded,
    staircase,
)
from pliant.report.chart_colours import SERIES, SOFT, WARN
from pliant_search.records import STATUSES
from pliant_search.report.view import SearchView, log_suits

NAMED = 24  # branches that are all named; of more, only the first few are
FIRST_NAMED = 5
SHOWN_SHARE = 97.0  # percent of the candidates that a linear axis shows; the rest is drawn at its edge
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


def shown_range(scores: Array, maximised: bool) -> tuple[float, float]:
    """Return the range, without the worst few where these would take most of it."""
    finite = scores[np.isfinite(scores)]
    low, high = float(finite.min()), float(finite.max())
    cut = float(np.percentile(finite, 100 - SHOWN_SHARE if maximised else SHOWN_SHARE))
    if maximised:
        return (cut, high) if high - low > 2.5 * (high - cut) > 0 else (low, high)
    return (low, cut) if high - low > 2.5 * (cut - low) > 0 else (low, high)


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
