"""The chain at rest, on its way and settled in every engine, at equal scales."""

from __future__ import annotations

import numpy as np

from pliant.formatting import actuation_unit, display_unit
from pliant.records.design import Array
from pliant.report.chart import Chart, ChartAxis, ChartLine, Panel
from pliant.report.figures import style
from pliant.report.figures.finger import LEVELS, views
from pliant.report.folder import FinishedRun
from pliant.report.run_view import history_levels, rest_markers


def pose_chart(run: FinishedRun) -> Chart:
    """A panel for each view of the chain."""
    unit = display_unit("m")
    levels = actuation_unit(run.designs[0].law.actuation_name)
    rest = rest_markers(run)
    panels = []
    for across, up in views(run):

        def line(points: Array, name: str, colour: str, width: float, dot: float, of: str = "") -> ChartLine:
            x, y = np.asarray(points)[:, [across, up]].T * unit.factor  # noqa: B023
            return ChartLine(name, x, y, of, colour, width, dot)

        lines = [] if rest is None else [line(rest, "at rest", "#9fa8b8", 2.4, 3.0)]
        for value, _, markers in history_levels(run.engines[0].result, LEVELS):
            lines.append(line(markers, "on the way", "#9cc3de", 1.1, 2.0, levels.text(value, 3)))
        for k, engine in enumerate(run.engines):
            lines.append(line(engine.markers_m, engine.kind, style.SERIES[k % 6], 2.6 if not k else 1.3, 6.0))
        axes = [ChartAxis("xyz"[k], unit.symbol) for k in (across, up)]
        title = f"{'xyz'[across]} and {'xyz'[up]} of the world"
        panels.append(Panel(axes[0], axes[1], tuple(lines), title=title, equal=True))
    return Chart(tuple(panels))
