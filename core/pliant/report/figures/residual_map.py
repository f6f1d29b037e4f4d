"""Where a law misses its states, over actuation and u, beside the study's form on one scale of colours."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.lines import Line2D

from pliant.formatting import actuation_unit, deformation_unit, number, percent
from pliant.pipeline.law_misses import Misses
from pliant.report.figures import style
from pliant.report.figures.fem_states import actuation_word, coordinate_words
from pliant.report.fit_reading import Fitted

LOWEST = 1e-8  # share of the range below which errors are drawn alike
HEIGHT = 470


def residual_map(fitted: Fitted) -> style.Png:
    """One row for each axis, one column for the law and for each of the study's forms."""
    beside = {
        title.replace("the study's form, ", "study's form, "): m for title, m in fitted.study_misses.items()
    }
    columns = {"this law": fitted.misses, **beside}
    names = fitted.explored
    norm = _norm(columns)
    cells = [(name, title) for name in names for title in columns]
    # Panels of one law stand side by side, those of several laws in a row for each axis.
    across = len(columns) if len(columns) > 1 else len(names)
    down = len(cells) // across
    with style.canvas(1560 if across > 1 else 940, HEIGHT * down + 130) as figure:
        grid = figure.subplots(
            down, across, squeeze=False, sharex="row" if len(columns) > 1 else False, sharey=True
        )
        for place, (name, title) in zip(grid.ravel(), cells, strict=True):
            _panel(
                place,
                fitted,
                columns[title],
                name,
                title if len(columns) > 1 or len(names) == 1 else "",
                norm,
            )
        for place in grid[:, 1:].ravel():
            place.set_ylabel("")
        bar = figure.colorbar(
            ScalarMappable(norm, style.error_map()),
            ax=grid.ravel().tolist(),
            pad=0.015,
            fraction=0.03,
            aspect=45,
        )
        bar.set_label("|law − state|, % of the effort's range")
        bar.ax.yaxis.set_major_formatter(lambda value, _: number(float(value), 1))
        bar.outline.set_visible(False)
        _legend(figure, fitted)
        figure.set_layout_engine("constrained", w_pad=0.09, h_pad=0.09, wspace=0.03)
        return style.png(figure)


def _panel(axes: Any, fitted: Fitted, missed: Misses, name: str, title: str, norm: LogNorm) -> None:
    data, k = fitted.data, missed.axes.index(name)
    part = missed.rows(missed.axis == k)
    p_unit, u_unit = actuation_unit(data.actuation_name), deformation_unit(data)
    x = data.deformation[part.state, data.axes.index(name)] * u_unit.factor
    y = data.actuation[part.state] * p_unit.factor
    shares = 100 * np.maximum(part.share, LOWEST)
    looks = (
        (~part.check & ~part.together, "o", 40),
        (~part.check & part.together, "s", 40),
        (part.check & ~part.together, "D", 62),
        (part.check & part.together, "P", 90),
    )
    for chosen, marker, size in looks:
        axes.scatter(
            x[chosen], y[chosen], size, c=shares[chosen], cmap=style.error_map(), norm=norm, marker=marker,
            edgecolor=style.INK, linewidths=[1.1 if marker in "DP" else 0.4], zorder=4 if marker in "DP" else 3,
        )  # fmt: skip
    axes.margins(0.07)
    axes.set_xlabel(coordinate_words(data, name))
    axes.set_ylabel(f"{actuation_word(data)} ({p_unit.symbol})")
    worst = part.rows(part.check).worst
    says = f"worst {percent(worst)} left out" if np.isfinite(worst) else f"worst {percent(part.worst)}"
    words = [f"axis {name}" if len(data.axes) > 1 else "", title]
    text = f"{', '.join(word for word in words if word)}:{' ' if len(fitted.study_misses) < 2 else chr(10)}{says}"
    axes.set_title(text[0].upper() + text[1:], fontsize=9)


def _norm(columns: Mapping[str, Misses]) -> LogNorm:
    """Whole decades around all errors that are drawn."""
    shares = np.concatenate([m.share for m in columns.values()])
    shares = 100 * np.maximum(shares[np.isfinite(shares)], LOWEST)
    low = 10.0 ** np.floor(np.log10(np.quantile(shares, 0.15) if len(shares) else 1e-3))
    high = 10.0 ** np.ceil(np.log10(shares.max(initial=10 * low)))
    return LogNorm(low, max(high, 10 * low), clip=True)


def _legend(figure: Any, fitted: Fitted) -> None:
    missed = fitted.misses
    groups = (
        ("fitted", "o", ~missed.check & ~missed.together),
        ("left out", "D", missed.check & ~missed.together),
        ("fitted, all axes held", "s", ~missed.check & missed.together),
        ("left out, all axes held", "P", missed.check & missed.together),
    )
    handles = [
        Line2D([], [], ls="", marker=marker, mfc=style.FAINT, mec=style.INK, ms=6, label=f"{label} ({count})")
        for label, marker, chosen in groups
        if (count := len(np.unique(missed.state[chosen])))
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), handletextpad=0.3)
