"""A map of conditions: the error of every run in units of the noise, by output and by what the actuation does."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.colors import Colormap, LinearSegmentedColormap, TwoSlopeNorm

from pliant.evidence.covariates import Bins
from pliant.evidence.places import all_bins
from pliant.formatting import number, unit_of
from pliant.records.design import Array
from pliant.report.comparison_view import Compared, fitting
from pliant.report.figures import style

MOST_RUNS = 40
PREFERRED = ("direction × pressure", "direction × tendon", "direction", "pressure", "moment")
NO_DATA = "#eceef2"
DARK = 0.78  # of the colour range: white digits from here on


def condition_map(compared: Compared) -> style.Png | None:
    """Rows are runs; columns are outputs (if several) and bins of the actuation. None where there is no column."""
    runs = sorted(compared.comparison.runs, key=lambda run: -run.share_of_error / max(run.n, 1))[:MOST_RUNS]
    order = {run.name: k for k, run in enumerate(compared.measurement.runs)}
    rows = sorted(order[run.name] for run in runs)
    parts = []
    if len(compared.comparison.outputs) > 1:
        parts.append(
            ("by output", [unit_of(o).label for o in compared.comparison.outputs], _by_output(compared, rows))
        )
    bins = _bins(compared)
    if bins is not None:
        parts.append(("by what the actuation does", list(bins.words), _by_bin(compared, rows, bins)))
    if not parts:
        return None
    widths = [len(words) for _, words, _ in parts]
    longest = max(len(word) for _, words, _ in parts for word in words)
    judged = compared.comparison.judged
    with style.canvas(420 + 96 * sum(widths) + 60 * len(parts), 190 + 44 * len(rows) + 9 * longest) as figure:
        axes = figure.subplots(1, len(parts), squeeze=False, width_ratios=widths)[0]
        top = max(float(np.nanmax(values)) for _, _, values in parts)
        norm = TwoSlopeNorm(1.0, 0.0, max(top, 2.0))
        for axis, (title, words, values) in zip(axes, parts, strict=True):
            picture = _heat(axis, values, words, norm)
            axis.set_title(title)
        names = [_row_words(compared, k) for k in rows]
        axes[0].set_yticks(range(len(rows)), names)
        for axis in axes[1:]:
            axis.set_yticks([])
        label = "rms error in noise floors" if judged else "rms error against that of all runs"
        figure.colorbar(
            picture, ax=list(axes), label=label, shrink=min(1.0, 8 / max(len(rows), 1)), aspect=18
        )
        figure.set_layout_engine("constrained", w_pad=0.06, h_pad=0.06)
        return style.png(figure)


def _heat(axis: Any, values: Array, words: list[str], norm: TwoSlopeNorm) -> Any:
    picture = axis.imshow(values, aspect="auto", cmap=_colours(), norm=norm, interpolation="nearest")
    axis.set_xticks(
        range(len(words)), [fitting(word, 42) for word in words], rotation=35, ha="right", fontsize=8
    )
    axis.grid(False)
    axis.set_facecolor(NO_DATA)
    for side in axis.spines.values():
        side.set_visible(False)
    axis.tick_params(length=0)
    for (i, j), value in np.ndenumerate(values):
        if np.isfinite(value):
            colour = "white" if norm(value) > DARK else style.INK
            axis.text(j, i, number(value, 2), ha="center", va="center", fontsize=7.5, color=colour)
    return picture


def _colours() -> Colormap:
    """Blue below the noise, white at it, orange to dark red above."""
    return LinearSegmentedColormap.from_list(
        "floors",
        [
            (0.0, "#a9c4de"),
            (0.5, "#ffffff"),
            (0.62, "#fbd3a6"),
            (0.75, "#ee8a4a"),
            (0.88, "#c4421f"),
            (1.0, "#6e1410"),
        ],
    )


def _bins(compared: Compared) -> Bins | None:
    made = all_bins(compared.covariates)
    for name in PREFERRED:
        for bins in made:
            if bins.name.startswith(name) and len(bins) <= 16:
                return bins
    return None


def _by_output(compared: Compared, rows: list[int]) -> Array:
    table = np.full((len(rows), len(compared.comparison.outputs)), np.nan)
    for j, (name, error) in enumerate(compared.comparison.outputs.items()):
        for i, k in enumerate(rows):
            table[i, j] = _rms(compared.residuals[k][name]) / error.noise.total
    return table


def _by_bin(compared: Compared, rows: list[int], bins: Bins) -> Array:
    table = np.full((len(rows), len(bins)), np.nan)
    for i, k in enumerate(rows):
        scaled = np.stack(
            [compared.residuals[k][n] / error.noise.total for n, error in compared.comparison.outputs.items()]
        )
        for j in range(len(bins)):
            table[i, j] = _rms(scaled[:, bins.codes[k] == j])
    return table


def _rms(values: Array) -> float:
    there = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(there**2))) if len(there) else np.nan


def _row_words(compared: Compared, k: int) -> str:
    run = compared.comparison.runs[k]
    return fitting(f"{run.name}: {run.words}" if run.words else run.name, 40)
