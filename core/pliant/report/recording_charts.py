"""The charts of a recording without a model: every quantity of the runs over time, and readings over the input."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pliant.formatting import output_unit
from pliant.records.measurement import MeasuredRun, Measurement
from pliant.report.chart import Chart, ChartAxis, ChartLine, Panel, one_height
from pliant.report.chart_colours import SERIES
from pliant.report.evidence_view import clock, clock_words, fitting, input_values, thin

MOST_RUNS, MOST_ROWS, MOST_LINES = 6, 4, 6
FEW = 40  # samples that are marked individually


def recording_chart(measurement: Measurement) -> Chart:
    """Return a cell per run, only the first runs of many: a panel per kind of quantity, the inputs at the bottom."""
    runs, inputs = measurement.runs[:MOST_RUNS], list(measurement.runs[0].history.actuation)
    kinds = [*_kinds(list(measurement.outputs))[: MOST_ROWS - 1], *_kinds(inputs)[:1]]
    panels = []
    for run in runs:
        cell = [_time_panel(run, names) for names in kinds]
        cell[0] = replace(cell[0], title=fitting(run.name, 30), below=f"{len(run)} samples")
        panels += cell
    width = max(380, 1500 // len(runs))
    shown = one_height(panels, every=len(kinds))
    return Chart(shown, column=len(kinds), across=MOST_RUNS, cell=(width, 260 * len(kinds) + 110))


def recording_loops_chart(measurement: Measurement) -> Chart:
    """Return a panel per reading over the first input, with the first runs."""
    driver = next(iter(measurement.runs[0].history.actuation))
    across, panels = output_unit(driver), []
    for name in measurement.outputs[:MOST_LINES]:
        up, lines = output_unit(name), []
        for k, run in enumerate(measurement.runs[:MOST_RUNS]):
            pick = thin(len(run))
            x, y = across.factor * input_values(run, driver)[pick], up.factor * run.outputs[name][pick]
            lines.append(ChartLine(run.name, x, y, run.name, SERIES[k % 6], 1.0, 3.0 * (len(pick) < FEW)))
        panels.append(
            Panel(ChartAxis(across.label, across.symbol), ChartAxis(up.label, up.symbol), tuple(lines))
        )
    return Chart(tuple(panels), cell=(560, 470))


def _kinds(names: list[str]) -> list[list[str]]:
    """Return the names in groups of one unit, in their order."""
    groups: dict[str, list[str]] = {}
    for name in names:
        groups.setdefault(output_unit(name).symbol, []).append(name)
    return [group[:MOST_LINES] for group in groups.values()]


def _time_panel(run: MeasuredRun, names: list[str]) -> Panel:
    pick, lines, first = thin(len(run)), [], output_unit(names[0])
    time = clock(run)[0][pick]
    for k, name in enumerate(names):
        unit = output_unit(name)
        values = unit.factor * np.asarray(run.outputs.get(name, run.input(name)), float)[pick]
        lines.append(ChartLine(unit.label, time, values, "", SERIES[k % 6], 1.1, 3.0 * (len(pick) < FEW)))
    label = (
        first.label if len(names) == 1 else fitting(", ".join(output_unit(name).label for name in names), 30)
    )
    return Panel(ChartAxis(*clock_words(run)), ChartAxis(label, first.symbol), tuple(lines), linked=run.name)
