"""Surrogates side by side: worst error, time of the fit, evaluations a second."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pliant.formatting import number
from pliant.report.figures import style
from pliant.report.fit_reading import Fitted

SMALLEST = 1e-8


def surrogate_bars(fitted: Sequence[Fitted]) -> style.Png:
    """Three panels of horizontal bars on log scales, the first surrogate at the top."""
    names = [one.name for one in fitted]
    panels = (
        (
            "Worst error on states left out",
            "% of the effort's range",
            [100 * f.report.worst_of_range for f in fitted],
        ),
        ("Time of the fit", "s", [f.wall_s for f in fitted]),
        ("Evaluations with slopes", "million a second", [f.per_second / 1e6 for f in fitted]),
    )
    with style.canvas(1560, 170 + 70 * len(fitted)) as figure:
        grid = figure.subplots(1, 3, sharey=True)
        for axes, (title, unit, values) in zip(grid, panels, strict=True):
            _bars(axes, names, np.maximum(values, SMALLEST))
            axes.set_title(title)
            axes.set_xlabel(unit)
        grid[0].invert_yaxis()
        figure.set_layout_engine("constrained", w_pad=0.09, h_pad=0.09, wspace=0.04)
        return style.png(figure)


def _bars(axes: Any, names: Sequence[str], values: Any) -> None:
    low = 10.0 ** np.floor(np.log10(values.min() / 2))
    places = np.arange(len(names))
    colours = [style.SERIES[k % len(style.SERIES)] for k in places]
    axes.barh(places, values - low, left=low, height=0.6, color=colours, zorder=3)
    axes.set_xscale("log")
    axes.set_xlim(low, values.max() * (values.max() / low) ** 0.25)
    axes.set_yticks(places, names)
    axes.grid(axis="y", visible=False)
    style.log_labels(axes.xaxis)
    for place, value in zip(places, values, strict=True):
        axes.annotate(
            number(float(value), 3), (value, place), (4, 0), textcoords="offset points", va="center", fontsize=8.5
        )  # fmt: skip
