"""A search as it went, and the front of several objectives."""

from __future__ import annotations

import itertools

import numpy as np

from pliant.records.design import Array
from pliant.report.chart import Chart, ChartAxis, ChartLine, Panel
from pliant.report.figures import style
from pliant.report.figures.search_course import MOST_PAIRS, moving_median, shown_range
from pliant.report.search_view import SearchView

CANDIDATE = "#6f9dc2"
MOST_DRAWN = 8000  # candidates; of more every n-th, while the best so far has all of them


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


def front_chart(read: SearchView) -> Chart | None:
    """A panel per pair of objectives; None for one objective."""
    pairs = list(itertools.combinations(range(len(read.objectives)), 2))[:MOST_PAIRS]
    if not pairs or not read.result.best:
        return None
    panels, stride = [], -(-len(read.scores()) // MOST_DRAWN)
    for pair in pairs:
        one, other = (read.objectives[k] for k in pair)
        points = np.array(
            [[d.objectives[o.name] * o.unit.factor for o in (one, other)] for d in read.result.best]
        )
        scores = [read.scores(k)[::stride] for k in pair]
        points = points[np.argsort(points[:, 0])]
        width = 1.2 if len(read.objectives) == 2 else 0.0
        lines = (
            ChartLine("candidate", scores[0], scores[1], "", CANDIDATE, 0.0, 3.5),
            ChartLine("front", points[:, 0], points[:, 1], "", style.WARN, width, 6.0),
        )
        axes = [ChartAxis(o.unit.label, o.unit.symbol) for o in (one, other)]
        below = "; ".join(f"{o.unit.label}: {o.best_word}" for o in (one, other))
        panels.append(Panel(axes[0], axes[1], lines, title="The front among all candidates", below=below))
    return Chart(tuple(panels))


def _steps(x: Array, y: Array) -> tuple[Array, Array]:
    """Corners of a staircase that keeps each value until it changes."""
    turns = np.flatnonzero(np.append(True, y[1:] != y[:-1]) | (np.arange(len(y)) == len(y) - 1))
    return np.repeat(x[turns], 2)[1:], np.repeat(y[turns], 2)[:-1]
