"""Hysteresis loops: an output over the input that drives it, measured and predicted; below, the error over the same."""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.evidence.covariates import phases
from pliant.evidence.scores import GroupError
from pliant.formatting import NamedUnit, unit_of
from pliant.records.design import Array
from pliant.report.comparison_view import (
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
SENSES = ((1, "rising", style.SERIES[2]), (-1, "falling", style.SERIES[1]), (0, "held", "#8a93a5"))
BAND_COLOUR = "#dcebf6"


def loops(compared: Compared, output: str) -> style.Png | None:
    """Small multiples of conditions, the worst first; None where no input varies."""
    found = abscissa(compared)
    if found is None:
        return None
    driver, across = found
    conditions = sorted(compared.comparison.conditions, key=lambda c: -c.share_of_error / max(c.n, 1))[:MOST]
    rows, columns = grid(len(conditions), COLUMNS)
    words = (across, unit_of(output))
    with style.canvas(max(460 * columns, 900), 600 * rows + 90) as figure:
        axes = figure.subplots(
            2 * rows, columns, squeeze=False, sharex=True, gridspec_kw={"height_ratios": [2.2, 1.3] * rows}
        )
        for place in range(rows * columns):
            row, column = divmod(place, columns)
            pair = (axes[2 * row, column], axes[2 * row + 1, column])
            if place >= len(conditions):
                hide_rest(pair)
                continue
            _pair(pair, compared, conditions[place], driver, output, words)
            _frame(pair, words, column, last=place + columns >= len(conditions))
        for half in (0, 1):
            _share_height([axes[2 * (k // columns) + half, k % columns] for k in range(len(conditions))])
        _legend(figure, axes)
        figure.set_layout_engine("constrained", w_pad=0.05, h_pad=0.04, hspace=0.02)
        return style.png(figure)


def _pair(
    pair: tuple[Any, Any], compared: Compared, condition: GroupError, driver: str, output: str,
    words: tuple[NamedUnit, NamedUnit],
) -> None:  # fmt: skip
    top, bottom = pair
    across, up = words
    floor = compared.comparison.outputs[output].noise_floor * up.factor
    if np.isfinite(floor):
        bottom.axhspan(-2 * floor, 2 * floor, color=BAND_COLOUR, lw=0)
    bottom.axhline(0, color=style.SERIES[0], lw=1.0)
    for k, name in enumerate(condition.runs):
        run, model = compared.run(name)
        pick = thin(len(run))
        x = across.factor * input_of(run, driver)
        measured, predicted = (up.factor * np.asarray(v[output], float) for v in (run.outputs, model))
        dots = "o" if len(pick) < 40 else ""
        label = "measured (shades: repeats)" if k == 0 else None
        top.plot(
            x[pick], measured[pick], color=REPEATS[k % 3], lw=1.0, marker=dots, ms=3, zorder=3, label=label
        )
        if k == 0:
            top.plot(
                x[pick], predicted[pick], color=style.SERIES[0], lw=2.0, label="model", zorder=4, alpha=0.85
            )
        _error(bottom, x, measured - predicted, phases(x, run.history.time_s).direction, pick, dots)
    top.set_title(f"{fitting(with_ratio(condition), 32)}\n", fontsize=9.5, pad=2)
    top.annotate(
        fitting(condition.words, 44), (0, 1), (0, 3), xycoords="axes fraction", textcoords="offset points",
        fontsize=7.5, color=style.SOFT,
    )  # fmt: skip


def _error(panel: Any, x: Array, error: Array, direction: Array, pick: Any, dots: str) -> None:
    """The error over the input, in the colour of what the input does."""
    for sense, name, colour in SENSES:
        shown_error = np.where(direction == sense, error, np.nan)[pick]
        panel.plot(
            x[pick],
            shown_error,
            color=colour,
            lw=1.0,
            marker=dots or ".",
            ms=2.2,
            label=f"error, {name}",
            mew=0,
        )


def _frame(pair: tuple[Any, Any], words: tuple[NamedUnit, NamedUnit], column: int, last: bool) -> None:
    across, up = words
    top, bottom = pair
    top.tick_params(labelbottom=False, labelleft=column == 0)
    bottom.tick_params(labelbottom=last, labelleft=column == 0)
    if column == 0:
        top.set_ylabel(up.axis)
        bottom.set_ylabel(f"error ({up.symbol})" if up.symbol else "error")
    if last:
        bottom.set_xlabel(across.axis)


def _share_height(axes: list[Any]) -> None:
    low, high = min(a.get_ylim()[0] for a in axes), max(a.get_ylim()[1] for a in axes)
    for one in axes:
        one.set_ylim(low, high)


def _legend(figure: Any, axes: Any) -> None:
    top, below = (axes[k, 0].get_legend_handles_labels() for k in (0, 1))
    entries = dict(zip([*top[1], *below[1]], [*top[0], *below[0]], strict=True))
    figure.legend(list(entries.values()), list(entries), loc="outside upper right", ncols=len(entries))
