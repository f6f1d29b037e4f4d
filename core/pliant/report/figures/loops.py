"""Hysteresis loops: an output over the input that drives it, measured and predicted, condition by condition."""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.evidence.words import Shown, shown
from pliant.records.design import Array
from pliant.report.evidence_reading import (
    Compared,
    abscissa,
    fitting,
    grid,
    hide_rest,
    input_of,
    thin,
    with_ratio,
)
from pliant.report.figures import style

MOST = 8
COLUMNS = 4
REPEATS = (style.INK, "#7b8496", "#a9b1bf")
ARROWS_AT = 0.45  # of the input's range


def loops(compared: Compared, output: str) -> style.Png | None:
    """Small multiples of conditions, the worst first; None where no input varies."""
    found = abscissa(compared)
    if found is None:
        return None
    driver, across = found
    conditions = sorted(compared.comparison.conditions, key=lambda c: -c.share_of_error / max(c.n, 1))[:MOST]
    rows, columns = grid(len(conditions), COLUMNS)
    up = shown(output)
    with style.canvas(max(460 * columns, 900), 440 * rows + 80) as figure:
        axes = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
        for place, condition in enumerate(conditions):
            panel = axes.flat[place]
            for k, name in enumerate(condition.runs):
                _loop(panel, compared, name, driver, output, (across, up), REPEATS[k % len(REPEATS)], k == 0)
            panel.set_title(f"{with_ratio(condition)}\n", fontsize=9.5, pad=2)
            panel.annotate(
                fitting(condition.words, 44), (0, 1), (0, 3), xycoords="axes fraction",
                textcoords="offset points", fontsize=7.5, color=style.SOFT,
            )  # fmt: skip
            if place % columns == 0:
                panel.set_ylabel(up.axis)
            if place >= len(conditions) - columns:
                panel.set_xlabel(across.axis)
                panel.tick_params(labelbottom=True)
        hide_rest(list(axes.flat[len(conditions) :]))
        handles, labels = axes.flat[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper right", ncols=len(labels))
        figure.set_layout_engine("constrained", w_pad=0.05, h_pad=0.04)
        return style.png(figure)


def _loop(
    panel: Any, compared: Compared, name: str, driver: str, output: str, words: tuple[Shown, Shown],
    colour: str, first: bool,
) -> None:  # fmt: skip
    run, model = compared.run(name)
    across, up = words
    pick = thin(len(run))
    x = across.factor * input_of(run, driver)[pick]
    measured = up.factor * np.asarray(run.outputs[output], float)[pick]
    sparse = len(pick) < 40
    panel.plot(
        x, measured, color=colour, lw=1.0, marker="o" if sparse else "", ms=3,
        label="measured (shades: repeats)" if first else None, zorder=3,
    )  # fmt: skip
    if first:
        predicted = up.factor * np.asarray(model[output], float)[pick]
        panel.plot(x, predicted, color=style.SERIES[0], lw=2.0, label="model", zorder=4, alpha=0.85)
        _arrows(panel, x, measured, colour)


def _arrows(panel: Any, x: Array, y: Array, colour: str) -> None:
    """The sense in which the measured loop is run through, once up and once down."""
    there = np.isfinite(x) & np.isfinite(y)
    x, y = x[there], y[there]
    if len(x) < 12 or np.ptp(x) == 0:
        return
    middle = x.min() + ARROWS_AT * np.ptp(x)
    passes = np.flatnonzero((x[:-1] - middle) * (x[1:] - middle) < 0)
    reach = 0.05 * np.ptp(x)
    for sign in (1, -1):
        for k in passes[np.sign(x[passes + 1] - x[passes]) == sign][:1]:
            after = np.flatnonzero(sign * (x[k:] - x[k]) > reach)[:1]
            if len(after):
                end = k + int(after[0])
                style_of = {"arrowstyle": "-|>", "color": colour, "lw": 1.2, "shrinkA": 0, "shrinkB": 0}
                panel.annotate("", (x[end], y[end]), (x[k], y[k]), arrowprops=style_of, zorder=6)
