"""Pictures of a recording before any model: every quantity of the runs over time, and readings over the input."""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.formatting import unit_of
from pliant.records.measurement import MeasuredRun, Measurement
from pliant.report.evidence_view import clock, fitting, grid, input_of, thin
from pliant.report.figures import style

MOST_RUNS, MOST_ROWS, MOST_LINES, COLUMNS = 6, 4, 6, 3
FEW = 40  # samples that are marked one by one


def in_time(measurement: Measurement) -> style.Png:
    """A column per run, the first runs alone of many; a row per kind of quantity, the inputs below the readings."""
    runs, inputs = measurement.runs[:MOST_RUNS], list(measurement.runs[0].history.actuation)
    rows = [*_kinds(list(measurement.outputs))[: MOST_ROWS - 1], *_kinds(inputs)[:1]]
    with style.canvas(max(380 * len(runs), 1500), 260 * len(rows) + 110, pad=(0.05, 0.04)) as figure:
        panels = figure.subplots(len(rows), len(runs), squeeze=False, sharex="col", sharey="row")
        for k, run in enumerate(runs):
            style.heading(panels[0][k], fitting(run.name, 30), f"{len(run)} samples")
            for row, names in zip(panels, rows, strict=True):
                _lines(row[k], run, names)
            panels[-1][k].set_xlabel(clock(run)[1])
        for row, names in zip(panels, rows, strict=True):
            row[0].set_ylabel(_label(names), fontsize=8.5)
            if len(names) > 1:
                row[0].legend(fontsize=7)
        return style.png(figure)


def loops(measurement: Measurement) -> style.Png:
    """A panel per reading over the first input, the first runs in it."""
    driver, outputs = next(iter(measurement.runs[0].history.actuation)), measurement.outputs[:MOST_LINES]
    across = unit_of(driver)
    rows, columns = grid(len(outputs), COLUMNS)
    with style.canvas(max(560 * columns, 900), 470 * rows + 90) as figure:
        panels = style.panels(figure, len(outputs), columns)
        for panel, name in zip(panels, outputs, strict=True):
            up = unit_of(name)
            for k, run in enumerate(measurement.runs[:MOST_RUNS]):
                pick = thin(len(run))
                x, y = across.factor * input_of(run, driver)[pick], up.factor * run.outputs[name][pick]
                look = {
                    "color": style.SERIES[k % len(style.SERIES)],
                    "lw": 1.0,
                    "label": fitting(run.name, 14),
                }
                panel.plot(x, y, marker="o" if len(pick) < FEW else "", ms=3, **look)
            panel.set(xlabel=across.axis, ylabel=up.axis)
        style.legend_above(figure, panels)
        return style.png(figure)


def _kinds(names: list[str]) -> list[list[str]]:
    """The names in groups of one unit, in their order."""
    groups: dict[str, list[str]] = {}
    for name in names:
        groups.setdefault(unit_of(name).symbol, []).append(name)
    return [group[:MOST_LINES] for group in groups.values()]


def _lines(axes: Any, run: MeasuredRun, names: list[str]) -> None:
    pick = thin(len(run))
    time = clock(run)[0][pick]
    for k, name in enumerate(names):
        unit = unit_of(name)
        values = unit.factor * np.asarray(run.outputs.get(name, run.input(name)), float)[pick]
        look = {"color": style.SERIES[k % len(style.SERIES)], "lw": 1.1, "label": unit.label}
        axes.plot(time, values, marker="o" if len(pick) < FEW else "", ms=3, **look)


def _label(names: list[str]) -> str:
    """Of several quantities the legend has the names."""
    return unit_of(names[0]).axis if len(names) == 1 else unit_of(names[0]).symbol
