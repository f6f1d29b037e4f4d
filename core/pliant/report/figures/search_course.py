"""A search as it went, still and moving: every candidate's objective, the best of every branch, the front."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from matplotlib.colors import to_rgba

from pliant.records.design import Array
from pliant.records.search import STATUSES
from pliant.report.chart import Chart, ChartAxis, ChartLine, Panel
from pliant.report.figures import style
from pliant.report.search_view import SearchView, log_suits

WIDTH_PX, HEIGHT_PX = 1560, 620
NAMED = 24  # branches that stand with their names; of more, the first few are named
FIRST_NAMED = 5
SHOWN_SHARE = 97.0  # percent of the candidates that a linear axis shows; the rest stands at its edge
MOST_TICKS, BINS = 400, 240  # failures drawn one by one; beyond that, parts of the search
WINDOW = 0.05  # of the search, over which a moving median is taken
CANDIDATE = "#6f9dc2"
MOST_DRAWN = 8000  # candidates; of more every n-th, while the best so far has all of them
CAUSES = (("refused", style.SERIES[4]), ("failed", style.SERIES[1]), ("not_a_number", style.SERIES[3]))


def search_history(read: SearchView) -> style.Png:
    """Candidates against their number, failures at the rim, best so far; with contexts a moving median."""
    scores, branches = read.scores(), len(read.result.branches)
    x: Array = np.arange(1.0, len(scores) + 1)
    if branches > 1:  # the number within its own branch
        branch = np.asarray(read.result.history.branch)
        for k in np.unique(branch):
            x[branch == k] = np.arange(1, (branch == k).sum() + 1)
    with style.canvas(WIDTH_PX, HEIGHT_PX, pad=(0.08, 0.06)) as figure:
        axes = figure.subplots()
        _limits(axes, read, scores)
        if read.ok.any():
            _candidates(axes, read, x, scores)
            lines = _branch_lines if branches > 1 else _medians if read.contextual else _best_so_far
            lines(axes, read, x, scores)
        _rim(axes, read, x)
        axes.set_xlim(0, max(float(x.max(initial=1)), 1) * 1.01)
        each = " of its search" if branches > 1 else ""
        axes.set(
            xlabel=f"candidate{each}, in the order of evaluation",
            ylabel=read.objective.unit.axis,
            title=f"Objective of every candidate ({read.objective.best_word})",
        )
        figure.legend(loc="outside upper right", ncols=6, markerscale=1.6)
        return style.small_png(figure)


def branch_strip(read: SearchView) -> style.Png | None:
    """The best of every branch, sorted, a few with their names; None for one branch, or where none has a design."""
    found = read.best_of_branches()
    if len(read.result.branches) < 2 or not found:
        return None
    names, scores = read.branch_names(), read.scores()
    values = np.array([scores[row] for _, row in found])
    labels = [names[branch] for branch, _ in found]
    few, rank = len(found) <= NAMED, np.arange(len(found))
    size = (1300, 40 * len(found) + 200) if few else (WIDTH_PX, 560)
    with style.canvas(*size, pad=(0.08, 0.06)) as figure:
        axes = figure.subplots()
        for count, colour, ms in (
            (None, style.SERIES[0], 7 if few else 4.5),
            (1, style.WARN, 10 if few else 9),
        ):
            pair = (values[:count], rank[:count]) if few else (rank[:count] + 1, values[:count])
            axes.plot(*pair, "o", ms=ms, color=colour)
        if few:
            axes.set_yticks(rank, labels)
            axes.set_ylim(len(values) - 0.5, -0.5)
        else:
            text = "\n".join(f"{k + 1}.  {label}" for k, label in enumerate(labels[:FIRST_NAMED]))
            # the free corner lies on the side where the curve is far from the best
            height, side = (0.95, "top") if values[-1] > values[0] else (0.05, "bottom")
            look = {"xycoords": "axes fraction", "va": side, "fontsize": 9, "linespacing": 1.5}
            axes.annotate(text, (0.02, height), **look)
            axes.set(xlim=(0, len(values) + 1), xlabel="rank of the search")
        if log_suits(values):
            (axes.set_xscale if few else axes.set_yscale)("log")
            style.log_labels(axes.xaxis if few else axes.yaxis)
        (axes.set_xlabel if few else axes.set_ylabel)(f"best {read.objective.unit.axis}")
        axes.set_title(f"Best of each of {len(found)} searches ({read.branch_title()})")
        return style.png(figure)


def _limits(axes: Any, read: SearchView, scores: Array) -> None:
    """A log axis where it helps; else the axis leaves out the worst few, which stand at its edge."""
    finite = scores[np.isfinite(scores)]
    if not len(finite):
        axes.set_ylim(0, 1)
        axes.set_yticks([])
        return
    if log_suits(scores):
        axes.set(yscale="log", ylim=(finite.min() / 1.25, finite.max() * 1.9))
        style.log_labels(axes.yaxis)
        return
    low, high = shown_range(scores, read.objective.maximised)
    pad = 0.06 * (high - low) or 0.05 * max(abs(high), 1e-12)
    axes.set_ylim(low - pad, high + 2.6 * pad)


def shown_range(scores: Array, maximised: bool) -> tuple[float, float]:
    """The range without the worst few, where these would take most of it."""
    finite = scores[np.isfinite(scores)]
    low, high = float(finite.min()), float(finite.max())
    cut = float(np.percentile(finite, 100 - SHOWN_SHARE if maximised else SHOWN_SHARE))
    if maximised:
        return (cut, high) if high - low > 2.5 * (high - cut) > 0 else (low, high)
    return (low, cut) if high - low > 2.5 * (cut - low) > 0 else (low, high)


def _candidates(axes: Any, read: SearchView, x: Array, scores: Array) -> None:
    n, shown = int(np.isfinite(scores).sum()), np.clip(scores, *axes.get_ylim())
    size, alpha = (14, 0.8) if n < 500 else ((7, 0.5) if n < 6000 else (2.5, 0.25))
    if not read.contextual:
        axes.scatter(x, shown, size, color="#8fb3d0", lw=0, alpha=alpha, label="candidate")
        return
    context = np.asarray(read.result.history.context)
    for k in np.unique(context[context >= 0]).tolist():
        mine = context == k
        axes.scatter(x[mine], shown[mine], size, color=style.SERIES[k % 6], lw=0, alpha=0.5 * alpha)


def _best_so_far(axes: Any, read: SearchView, x: Array, scores: Array) -> None:
    better = np.fmax if read.objective.maximised else np.fmin
    best = better.accumulate(scores)
    axes.plot(x, best, color=style.SERIES[0], lw=1.8, drawstyle="steps-post", label="best so far")
    if np.isfinite(best).any():
        row = int(read.order()[0])
        axes.plot([x[row]], [scores[row]], "*", ms=13, color=style.WARN, mec="white", zorder=6, label="best")


def _branch_lines(axes: Any, read: SearchView, x: Array, scores: Array) -> None:
    """Best so far of every branch, that of the winner in front."""
    better = np.fmax if read.objective.maximised else np.fmin
    branch = np.asarray(read.result.history.branch)
    found = read.best_of_branches()
    for order, (number, row) in enumerate(reversed(found)):
        mine, first = branch == number, order == len(found) - 1
        axes.plot(
            x[mine], better.accumulate(scores[mine]), drawstyle="steps-post",
            color=style.WARN if first else style.SERIES[0], lw=2.4 if first else 0.8, alpha=1 if first else 0.45,
            label=f"best so far of the winning search ({read.branch_names()[number]})" if first else
            ("best so far of each search" if order == 0 else None),
        )  # fmt: skip
        if first:
            axes.plot([x[row]], [scores[row]], "*", ms=13, color=style.WARN, mec="white", zorder=6)


def _medians(axes: Any, read: SearchView, x: Array, scores: Array) -> None:
    """Moving median of each condition: what a policy would give at that time."""
    context = np.asarray(read.result.history.context)
    for k in np.unique(context[context >= 0]).tolist():
        mine = np.flatnonzero((context == k) & np.isfinite(scores))
        if len(mine):
            axes.plot(*moving_median(x[mine], scores[mine]), color=style.SERIES[k % 6], lw=2.0,
                      ls="-" if k < 6 else "--", label=read.condition(k))  # fmt: skip


def moving_median(x: Array, values: Array) -> tuple[Array, Array]:
    """Median over windows of a twentieth of the search (at least five candidates), at their middles."""
    width = max(5, int(WINDOW * len(x)))
    starts = np.unique(np.linspace(0, max(len(x) - width, 0), 60).astype(int))
    return (
        np.array([x[s : s + width].mean() for s in starts]),
        np.array([np.median(values[s : s + width]) for s in starts]),
    )


def _rim(axes: Any, read: SearchView, x: Array) -> None:
    """Candidates without an objective, at the upper rim, one row per status: ticks, or of many a strip of shades."""
    status = np.asarray(read.result.history.status)
    kinds = [(name, colour, status == STATUSES.index(name)) for name, colour in CAUSES]
    kinds.append(("breaks a constraint on metrics", style.SOFT, read.broken))
    look = {"clip_on": False, "zorder": 5, "transform": axes.get_xaxis_transform()}
    for row, (name, colour, mine) in enumerate(kind for kind in kinds if kind[2].any()):
        label, top = f"{name.replace('_', ' ')} ({int(mine.sum())})", 0.985 - 0.035 * row
        if mine.sum() <= MOST_TICKS:
            axes.plot(
                x[mine], np.full(mine.sum(), top), "|", ms=6, mew=0.9, color=colour, label=label, **look
            )
            continue
        edges = np.linspace(float(x.min()), float(x.max()) + 1, BINS + 1)
        every, own = (np.histogram(values, edges)[0] for values in (x, x[mine]))
        shades = [to_rgba(colour, float(np.sqrt(share))) for share in own / np.maximum(every, 1)]
        axes.bar(edges[:-1], 0.026, np.diff(edges), top - 0.013, align="edge", color=shades, lw=0, **look)
        axes.plot([], [], "s", ms=4, color=colour, label=label)


def history_chart(read: SearchView) -> Chart | None:
    """Candidates' objectives and the best so far, branch by branch; None where none has an objective."""
    scores = read.scores()
    finite = np.isfinite(scores)
    if not finite.any():
        return None
    better = np.fmax if read.objective.maximised else np.fmin
    branch, context = np.asarray(read.result.history.branch), np.asarray(read.result.history.context)
    names = read.branch_names()
    lines: list[ChartLine] = []
    stride = -(-len(scores) // MOST_DRAWN)
    winner = read.best_of_branches()[0][0] if read.best_of_branches() else -1
    for k in np.unique(branch).tolist():
        mine = np.flatnonzero(branch == k)
        x, run = np.arange(1.0, len(mine) + 1), names[k] if len(names) > 1 else ""
        lines.append(ChartLine("candidate", x[::stride], scores[mine][::stride], run, CANDIDATE, 0.0, 3.5))
        if not read.contextual:
            won = len(names) > 1 and k == winner
            look = (style.WARN, 2.4) if won else (style.SERIES[0], 1.8 if len(names) < 2 else 0.7)
            at, best = _steps(x, better.accumulate(scores[mine]))
            lines.append(ChartLine("best so far", at, best, run, *look))
            continue
        for which in np.unique(context[context >= 0]).tolist():
            rows = np.flatnonzero((context[mine] == which) & finite[mine])
            if len(rows):
                at, median = moving_median(x[rows], scores[mine][rows])
                shade = style.SERIES[which % 6]
                lines.append(ChartLine("moving median", at, median, read.condition(which), shade, 2.0))
    low, high = shown_range(scores, read.objective.maximised)
    pad = 0.06 * (high - low) or 0.05 * max(abs(high), 1e-12)
    y = ChartAxis(read.objective.unit.label, read.objective.unit.symbol)
    title = f"Objective of every candidate ({read.objective.best_word})"
    panel = Panel(ChartAxis("candidate"), y, tuple(lines), title=title, y_range=(low - pad, high + pad))
    return Chart((panel,))


def _steps(x: Array, y: Array) -> tuple[Array, Array]:
    """Corners of a staircase that keeps each value until it changes."""
    turns = np.flatnonzero(np.append(True, y[1:] != y[:-1]) | (np.arange(len(y)) == len(y) - 1))
    return np.repeat(x[turns], 2)[1:], np.repeat(y[turns], 2)[:-1]


MOST_PAIRS = 3


def search_front(read: SearchView) -> style.Png | None:
    """A panel per pair of objectives; None for one objective."""
    pairs = _pairs(read)
    if not pairs or not read.result.best:
        return None
    with style.canvas(1000 if len(pairs) == 1 else 560 * len(pairs), 640) as figure:
        for axes, pair in zip(figure.subplots(1, len(pairs), squeeze=False)[0], pairs, strict=True):
            _panel(axes, read, pair)
        figure.axes[0].legend(loc="best")
        figure.axes[0].set_title("The front among all candidates")
        return style.small_png(figure)


def _panel(axes: Any, read: SearchView, pair: tuple[int, int]) -> None:
    one, other = (read.objectives[k] for k in pair)
    axes.scatter(
        read.scores(pair[0]), read.scores(pair[1]), 10, color="#8fb3d0", lw=0, alpha=0.6, label="candidate"
    )
    points = _front(read, pair)
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
    axes.set(xlabel=f"{one.unit.axis}, {one.best_word}", ylabel=f"{other.unit.axis}, {other.best_word}")


def front_chart(read: SearchView) -> Chart | None:
    """A panel per pair of objectives; None for one objective."""
    pairs = _pairs(read)
    if not pairs or not read.result.best:
        return None
    panels, stride = [], -(-len(read.scores()) // MOST_DRAWN)
    for pair in pairs:
        one, other = (read.objectives[k] for k in pair)
        points, scores = _front(read, pair), [read.scores(k)[::stride] for k in pair]
        width = 1.2 if len(read.objectives) == 2 else 0.0
        lines = (
            ChartLine("candidate", scores[0], scores[1], "", CANDIDATE, 0.0, 3.5),
            ChartLine("front", points[:, 0], points[:, 1], "", style.WARN, width, 6.0),
        )
        axes = [ChartAxis(o.unit.label, o.unit.symbol) for o in (one, other)]
        below = "; ".join(f"{o.unit.label}: {o.best_word}" for o in (one, other))
        panels.append(Panel(axes[0], axes[1], lines, title="The front among all candidates", below=below))
    return Chart(tuple(panels))


def _pairs(read: SearchView) -> list[tuple[int, int]]:
    """The first pairs of objectives, by number."""
    return list(itertools.combinations(range(len(read.objectives)), 2))[:MOST_PAIRS]


def _front(read: SearchView, pair: tuple[int, int]) -> Array:
    """(n, 2) a pair's objectives of the best designs, in their units, along the first."""
    both = [read.objectives[k] for k in pair]
    points = np.array([[d.objectives[o.name] * o.unit.factor for o in both] for d in read.result.best])
    return np.asarray(points[np.argsort(points[:, 0])])
