"""Success by condition: measured shares with their Wilson intervals, next to those of one or more models."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pliant.report.chart import Chart, ChartAxis, ChartLine, Mark, Panel
from pliant.report.chart_colours import INK, SERIES
from pliant_counts.binomial import Count, wilson


@dataclass(frozen=True)
class Series:
    """Counts of one source by condition; `emphasised` conditions are drawn filled, the others hollow."""

    label: str
    counts: Sequence[Count]
    emphasised: Sequence[bool]


SHAPES = ("o", "s", "D", "^")
SPREAD = 0.34  # share of a row over which the series are spread


def success_chart(conditions: Sequence[str], measured: Series, models: Sequence[Series]) -> Chart:
    """Return a row for each condition, shares from 0 to 100 %; strokes are 95 % intervals of counting alone."""
    colours, series = (INK, *SERIES), (measured, *models)
    marks: list[Mark] = []
    for k, one in enumerate(series):
        rows = np.arange(len(conditions)) + SPREAD * (k / max(len(series) - 1, 1) - 0.5)
        share = np.array([100 * hits / trials for hits, trials in one.counts])
        low, high = 100 * np.array([wilson(count) for count in one.counts]).T
        gap = np.full(len(rows), np.nan)
        across, level = np.stack([low, high, gap], axis=1).ravel(), np.repeat(rows, 3)
        intervals = ChartLine(one.label, across, level, "", f"{colours[k]}bf", 1.5)
        strong = np.array(one.emphasised, bool)
        for chosen, hollow in ((strong, False), (~strong, True)):
            if chosen.any():
                x, y, marker = share[chosen], rows[chosen], SHAPES[k % len(SHAPES)]
                marks.append(ChartLine(one.label, x, y, "", colours[k], 0.0, 6.5, marker, hollow))
        marks.append(intervals)
    axis = ChartAxis("successes, with 95 % intervals (Wilson)", "%", ends=(-1.0, 101.0))
    panel = Panel(axis, ChartAxis("condition", names=tuple(conditions)), tuple(marks))
    return Chart((panel,), cell=(1350, 62 * len(conditions) + 140), legend=tuple(one.label for one in series))
