"""How well runs with the same inputs repeat: each reading less the mean of its repeats."""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.formatting import NamedUnit, unit_of
from pliant.measurements.repeats import RepeatGroup, aligned, repeat_groups
from pliant.records.design import Array
from pliant.report.comparison_view import clock, thin
from pliant.report.diagnosis_view import Diagnosed
from pliant.report.figures import style
from pliant.report.figures.explained_runs import BAND, BAND_COLOUR

MOST = 3


def repeats(diagnosed: Diagnosed, output: str) -> style.Png | None:
    """The groups that scatter most, over a band of ±2 times the noise within a run; None without repeats."""
    found = [
        (group, values)
        for group in repeat_groups(diagnosed.measurement)
        if len(values := _scatter(diagnosed, group, output))
    ]
    if not found:
        return None
    found = sorted(found, key=lambda item: -float(np.nanmean(item[1] ** 2)))[:MOST]
    words = unit_of(output)
    with style.canvas(max(520 * len(found), 900), 430) as figure:
        axes = figure.subplots(1, len(found), squeeze=False, sharey=True)[0]
        for panel, (group, values) in zip(axes, found, strict=True):
            _panel(panel, diagnosed, group, values, output, words)
        axes[0].set_ylabel(f"less their mean ({words.symbol})" if words.symbol else "less their mean")
        figure.set_layout_engine("constrained", w_pad=0.05, h_pad=0.05)
        return style.png(figure)


def _scatter(diagnosed: Diagnosed, group: RepeatGroup, output: str) -> Array:
    """(runs, t) readings less their mean; empty where the group has too few readings in common."""
    runs = [diagnosed.measurement.runs[k] for k in group.runs]
    values = aligned(runs, [run.outputs[output] for run in runs]).values
    if values.shape[0] < 2 or values.shape[1] < 2:
        return np.zeros((0, 0))
    return np.asarray(values - values.mean(axis=0), float)


def _panel(
    panel: Any, diagnosed: Diagnosed, group: RepeatGroup, values: Array, output: str, words: NamedUnit
) -> None:
    runs = [diagnosed.measurement.runs[k] for k in group.runs]
    band = BAND * diagnosed.found.noise.floors[output].within * words.factor
    if np.isfinite(band):
        panel.axhspan(-band, band, color=BAND_COLOUR, lw=0)
    time, label = clock(runs[0])
    same = len(time) == values.shape[1]
    x = time if same else np.arange(1.0, values.shape[1] + 1)
    pick = thin(len(x))
    for k, (run, row) in enumerate(zip(runs, values, strict=False)):
        panel.plot(
            x[pick],
            words.factor * row[pick],
            lw=1.0,
            color=style.SERIES[k % len(style.SERIES)],
            label=run.name,
        )
    panel.axhline(0, color=style.SOFT, lw=0.8)
    panel.set_xlabel(label if same else "reading in common")
    many = ", ".join(run.name for run in runs[:5]) + (" …" if len(runs) > 5 else "")
    panel.set_title(f"{many}: the same inputs", fontsize=9.5)
    panel.legend(ncols=min(len(runs), 5), loc="upper right")
