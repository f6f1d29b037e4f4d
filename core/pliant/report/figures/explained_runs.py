"""What an explanation changes: measured, model as it is, model with it; in time, as errors, over the input."""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.diagnosis.verdict import NOTHING, Kinds, named
from pliant.evidence.prediction import RunReadings
from pliant.formatting import NamedUnit, unit_of
from pliant.records.measurement import MeasuredRun
from pliant.report.comparison_view import abscissa, clock, fitting, input_of, thin
from pliant.report.diagnosis_view import Diagnosed
from pliant.report.figures import style

MOST = 3
BAND = 2.0  # floors
BAND_COLOUR = "#e8ecf2"
DASHES = ((4, 2), (), (2, 2))  # lines that lie on one another are all seen
AS_IT_IS = style.WARN
WITH = (style.SERIES[0], style.SERIES[2])


def explained_runs(diagnosed: Diagnosed, output: str) -> style.Png:
    """Up to three runs, one per column: readings over time, errors over a band of ±2 floors, loops over the input."""
    names = diagnosed.telling_runs(MOST)
    driver = abscissa(diagnosed.before)
    lines = _lines(diagnosed)
    rows = 2 if driver is None else 3
    size = (520 * len(names), 330 * rows + 110) if len(names) > 1 else (1560, 560)
    with style.canvas(*size) as figure:
        axes = _panels(figure, rows, len(names))
        for column, name in enumerate(names):
            run = next(k for k, one in enumerate(diagnosed.measurement.runs) if one.name == name)
            _column(axes[:, column], diagnosed, run, output, lines, driver, first=column == 0)
        for row in axes:
            _share_height(row)
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper left", ncols=len(labels))
        figure.set_layout_engine("constrained", w_pad=0.05, h_pad=0.05)
        return style.png(figure)


def _panels(figure: Any, rows: int, columns: int) -> Any:
    """(rows, columns) panels; those of a single run stand side by side."""
    if columns == 1:
        return figure.subplots(1, rows, squeeze=False).T
    return figure.subplots(
        rows, columns, squeeze=False, gridspec_kw={"height_ratios": [2.2, 1.4, 2.4][:rows]}
    )


Line = tuple[str, str, tuple[RunReadings, ...]]


def _lines(diagnosed: Diagnosed) -> list[Line]:
    """Label, colour and predictions of each model to draw, the best on top."""
    chosen: list[tuple[Kinds, str]] = [(NOTHING, AS_IT_IS), *zip(diagnosed.explanations, WITH, strict=False)]
    return [
        (
            "model as it is" if kinds == NOTHING else f"model with {named(kinds)}",
            colour,
            diagnosed.predicted(kinds),
        )
        for kinds, colour in chosen
    ]


def _column(
    panels: Any, diagnosed: Diagnosed, index: int, output: str, lines: list[Line],
    driver: tuple[str, NamedUnit] | None, first: bool,
) -> None:  # fmt: skip
    run, words = diagnosed.measurement.runs[index], unit_of(output)
    time, label = clock(run)
    band = BAND * diagnosed.floor(output) * words.factor
    _draw(panels[0], run, index, output, lines, time)
    if np.isfinite(band):
        panels[1].axhspan(-band, band, color=BAND_COLOUR, lw=0)
    pick = thin(len(run))
    marker = "o" if len(pick) < 40 else ""
    for order, (_, colour, predicted) in enumerate(lines):
        error = words.factor * (run.outputs[output] - predicted[index][output])
        dashes = DASHES[2] if order == 2 else ()
        panels[1].plot(time[pick], error[pick], color=colour, lw=1.0, dashes=dashes, marker=marker, ms=3)
    panels[1].axhline(0, color=style.SOFT, lw=0.8)
    panels[1].set_xlabel(label)
    panels[0].set_title(f"{name_of(diagnosed, run.name)}\n", fontsize=9.5, pad=2)
    panels[0].annotate(
        fitting(diagnosed.before.words(run.name), 52), (0, 1), (0, 3), xycoords="axes fraction",
        textcoords="offset points", fontsize=7.5, color=style.SOFT,
    )  # fmt: skip
    if first:
        panels[0].set_ylabel(words.axis)
        panels[1].set_ylabel(f"error ({words.symbol})" if words.symbol else "error")
    if driver is not None:
        name, across = driver
        _draw(panels[2], run, index, output, lines, across.factor * input_of(run, name))
        panels[2].set_xlabel(across.axis)
        if first:
            panels[2].set_ylabel(words.axis)


def _draw(panel: Any, run: MeasuredRun, index: int, output: str, lines: list[Line], x: Any) -> None:
    """Readings and models over x."""
    factor, pick = unit_of(output).factor, thin(len(run))
    marker = "o" if len(pick) < 40 else ""
    panel.plot(
        x[pick],
        factor * run.outputs[output][pick],
        color=style.INK,
        lw=0.9,
        marker=marker,
        ms=3,
        zorder=5,
        label="measured",
    )
    for order, (label, colour, predicted) in enumerate(lines):
        dashes = DASHES[order] if len(lines) > 1 else ()
        panel.plot(
            x[pick], factor * predicted[index][output][pick], color=colour, lw=1.5, dashes=dashes, label=label
        )


def name_of(diagnosed: Diagnosed, name: str) -> str:
    """A run's name with its error in floors before and after."""
    now = _ratio(diagnosed, name, NOTHING)
    if not diagnosed.explanations or not np.isfinite(now):
        return diagnosed.before.title(name)
    return f"{name}: {now:.1f} → {_ratio(diagnosed, name, diagnosed.explanations[0]):.1f} × noise"


def _ratio(diagnosed: Diagnosed, name: str, kinds: Kinds) -> float:
    """Root mean square error of a run in noise floors, all outputs."""
    index = next(k for k, run in enumerate(diagnosed.measurement.runs) if run.name == name)
    mine = diagnosed.found.readings.run == index
    square = np.mean(diagnosed.found.fits[kinds].residual[mine] ** 2) if mine.any() else np.nan
    return diagnosed.found.table.over_floor(float(square))


def _share_height(row: Any) -> None:
    low, high = min(a.get_ylim()[0] for a in row), max(a.get_ylim()[1] for a in row)
    for k, one in enumerate(row):
        one.set_ylim(low, high)
        one.tick_params(labelleft=k == 0)
