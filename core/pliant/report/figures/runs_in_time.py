"""Measured over predicted, run by run in time, with the residual against the noise below each."""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.formatting import NamedUnit, unit_of
from pliant.report.comparison_view import Compared, clock, fitting, grid, thin
from pliant.report.figures import style

MOST = 12
COLUMNS = 4
BAND = 2.0  # floors
BAND_COLOUR = "#bcd9ee"


def runs_in_time(compared: Compared, output: str) -> style.Png:
    """Small multiples: the reading in ink over the model in blue; below, measured − model over a band of ±2 floors."""
    names, _ = compared.worst_runs(MOST)
    rows, columns = grid(len(names), COLUMNS)
    words, floor = unit_of(output), compared.comparison.outputs[output].noise_floor
    with style.canvas(max(460 * columns, 900), 430 * rows + 90) as figure:
        ratios = [3.0, 1.25] * rows
        axes = figure.subplots(2 * rows, columns, squeeze=False, gridspec_kw={"height_ratios": ratios})
        reach = _reach(compared, names, output, floor) * words.factor
        span = _span(compared, names, output, words)
        for place, name in enumerate(names):
            row, column = divmod(place, columns)
            top, bottom = axes[2 * row, column], axes[2 * row + 1, column]
            bottom.sharex(top)
            _panel(top, bottom, compared, name, output, words, floor)
            top.set_ylim(*span)
            bottom.set_ylim(-reach, reach)
            if column == 0:
                top.set_ylabel(words.axis)
                bottom.set_ylabel(f"error ({words.symbol})" if words.symbol else "error")
            else:
                top.tick_params(labelleft=False)
                bottom.tick_params(labelleft=False)
            if place >= len(names) - columns:
                bottom.set_xlabel(clock(compared.run(name)[0])[1])
        for place in range(len(names), rows * columns):
            row, column = divmod(place, columns)
            axes[2 * row, column].set_axis_off()
            axes[2 * row + 1, column].set_axis_off()
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper right", ncols=len(labels))
        figure.set_layout_engine("constrained", w_pad=0.05, h_pad=0.04, hspace=0.02, wspace=0.03)
        return style.png(figure)


def _panel(
    top: Any, bottom: Any, compared: Compared, name: str, output: str, words: NamedUnit, floor: float
) -> None:
    run, model = compared.run(name)
    pick = thin(len(run))
    time = clock(run)[0][pick]
    measured, predicted = (words.factor * np.asarray(v[output], float)[pick] for v in (run.outputs, model))
    band = BAND * floor * words.factor
    known = np.isfinite(band)
    sparse = len(pick) < 40
    if known:
        top.fill_between(
            time, predicted - band, predicted + band, color=BAND_COLOUR, lw=0, label="model ± 2 floors"
        )
        bottom.axhspan(-band, band, color=BAND_COLOUR, lw=0)
    top.plot(time, predicted, color=style.SERIES[0], lw=1.5, label="model")
    top.plot(time, measured, color=style.INK, lw=0.9, label="measured", marker="o" if sparse else "", ms=3)
    error = measured - predicted
    outside = np.abs(error) > band if known else np.zeros(len(error), bool)
    bottom.axhline(0, color=style.SERIES[0], lw=1.0)
    bottom.plot(time, error, color=style.INK, lw=0.7, marker="o" if sparse else "", ms=3)
    bottom.fill_between(time, 0, error, where=outside, color=style.WARN, alpha=0.75, lw=0, interpolate=False)
    top.tick_params(labelbottom=False)
    top.set_title(f"{compared.title(name)}\n", fontsize=9.5, pad=2)
    text = fitting(compared.words(name), 44)
    top.annotate(
        text,
        (0, 1),
        (0, 3),
        xycoords="axes fraction",
        textcoords="offset points",
        fontsize=7.5,
        color=style.SOFT,
    )


def _reach(compared: Compared, names: list[str], output: str, floor: float) -> float:
    """Half the height of the residual panels: nearly all residuals and the band."""
    shown_runs = [run.name in names for run in compared.measurement.runs]
    errors = [r[output] for r, show in zip(compared.residuals, shown_runs, strict=True) if show]
    there = np.concatenate(errors)
    there = np.abs(there[np.isfinite(there)])
    high = float(np.quantile(there, 0.998)) if len(there) else 1.0
    return 1.12 * max(high, 2.4 * floor if np.isfinite(floor) else 0.0, 1e-12)


def _span(compared: Compared, names: list[str], output: str, words: NamedUnit) -> tuple[float, float]:
    values = []
    for name in names:
        run, model = compared.run(name)
        values += [run.outputs[output], model[output]]
    flat = np.concatenate(values) * words.factor
    flat = flat[np.isfinite(flat)]
    low, high = (float(flat.min()), float(flat.max())) if len(flat) else (0.0, 1.0)
    margin = 0.06 * max(high - low, 1e-9)
    return low - margin, high + margin
