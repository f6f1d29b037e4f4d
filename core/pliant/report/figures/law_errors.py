"""Where a law misses its states and where it is soft, over actuation and u; and surrogates side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from pliant.formatting import actuation_unit, deformation_unit, effort_unit, number, percent
from pliant.pipeline.residuals import Residuals
from pliant.records.design import Array
from pliant.report.figures import style
from pliant.report.figures.fem import actuation_word, coordinate_words
from pliant.report.fit_view import Fitted, slope_grid

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
    with style.canvas(1560 if across > 1 else 940, HEIGHT * down + 130, wspace=0.03) as figure:
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
        return style.png(figure)


def _panel(axes: Any, fitted: Fitted, missed: Residuals, name: str, title: str, norm: LogNorm) -> None:
    data, k = fitted.data, missed.axes.index(name)
    part = missed.rows(missed.axis == k)
    p_unit, u_unit = actuation_unit(data.actuation_name), deformation_unit(data)
    x = data.deformation[part.state, data.axes.index(name)] * u_unit.factor
    y = data.actuation[part.state] * p_unit.factor
    share = 100 * np.maximum(part.share, LOWEST)
    looks = (
        (~part.check & ~part.together, "o", 40),
        (~part.check & part.together, "s", 40),
        (part.check & ~part.together, "D", 62),
        (part.check & part.together, "P", 90),
    )
    for chosen, marker, size in looks:
        axes.scatter(
            x[chosen], y[chosen], size, c=share[chosen], cmap=style.error_map(), norm=norm, marker=marker,
            edgecolor=style.INK, linewidths=[1.1 if marker in "DP" else 0.4], zorder=4 if marker in "DP" else 3,
        )  # fmt: skip
    axes.margins(0.07)
    axes.set(xlabel=coordinate_words(data, name), ylabel=f"{actuation_word(data)} ({p_unit.symbol})")
    worst = part.rows(part.check).worst
    says = f"worst {percent(worst)} left out" if np.isfinite(worst) else f"worst {percent(part.worst)}"
    words = [f"axis {name}" if len(data.axes) > 1 else "", title]
    text = f"{', '.join(word for word in words if word)}:{' ' if len(fitted.study_misses) < 2 else chr(10)}{says}"
    axes.set_title(text[0].upper() + text[1:], fontsize=9)


def _norm(columns: Mapping[str, Residuals]) -> LogNorm:
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


LEVELS = 14
FLAT = 0.02  # of the largest slope: less than that across the box is shown as one colour


def slope_map(fitted: Fitted) -> style.Png:
    """One panel for each axis that was explored."""
    law, data, names = fitted.law, fitted.data, fitted.explored
    p_unit, u_unit, effort = (
        actuation_unit(law.actuation_name),
        deformation_unit(law),
        effort_unit(law),
    )
    per = "m" if law.joint == "prismatic" else "rad"
    with style.canvas(1000 if len(names) == 1 else 1560, 600, wspace=0.03) as figure:
        grid = figure.subplots(1, len(names), squeeze=False)[0]
        for axes, name in zip(grid, names, strict=True):
            p, u, slopes = slope_grid(law, name)
            shown = effort.factor * slopes
            mesh = axes.contourf(
                u * u_unit.factor,
                p * p_unit.factor,
                shown,
                _levels(shown),
                cmap=style.pressure_map().reversed(),
            )
            if shown.max() >= 0 > shown.min():
                axes.contour(
                    u * u_unit.factor, p * p_unit.factor, shown, [0.0], colors=style.WARN, linewidths=2
                )
            i, j = np.unravel_index(int(np.argmax(shown)), shown.shape)
            _mark(axes, u[j] * u_unit.factor, p[i] * p_unit.factor)
            bar = figure.colorbar(mesh, ax=axes, pad=0.02)
            bar.outline.set_visible(False)
            bar.ax.yaxis.set_major_formatter(lambda value, _: number(float(value), 4))
            bar.set_label(rf"$\partial\tau/\partial u$ ({effort.symbol}/{per})")
            axes.grid(False)
            axes.set(xlabel=coordinate_words(data, name), ylabel=f"{actuation_word(data)} ({p_unit.symbol})")
            word = "softest" if shown.max() < 0 else "UNSTABLE"
            text = f"axis {name}: {word}" if len(names) > 1 else word
            largest = number(float(shown.max()), 3)
            axes.set_title(f"{text[0].upper()}{text[1:]} {largest} {effort.symbol}/{per}")
        return style.png(figure)


def _levels(shown: Array) -> Array:
    """Round contours over the slopes; around a slope that hardly varies, a range of its own size."""
    low, high = float(shown.min()), float(shown.max())
    room = max(FLAT * max(abs(low), abs(high)) - (high - low), 0.0) / 2 + np.finfo(float).tiny
    return np.asarray(MaxNLocator(LEVELS).tick_values(low - room, high + room))


def _mark(axes: Any, x: float, y: float) -> None:
    axes.plot([x], [y], "o", ms=9, mfc="none", mec="white", mew=2.6, clip_on=False, zorder=5)
    axes.plot([x], [y], "o", ms=9, mfc="none", mec=style.INK, mew=1.3, clip_on=False, zorder=6)


SMALLEST = 1e-8


def surrogate_bars(fitted: Sequence[Fitted]) -> style.Png:
    """Three panels of horizontal bars on log scales, the first surrogate at the top."""
    names = [one.name for one in fitted]
    panels = (
        (
            "Worst error on states left out",
            "% of the effort's range",
            [100 * f.report.worst_of_range for f in fitted],
        ),
        ("Time of the fit", "s", [f.wall_s for f in fitted]),
        ("Evaluations with slopes", "million a second", [f.per_second / 1e6 for f in fitted]),
    )
    with style.canvas(1560, 170 + 70 * len(fitted), wspace=0.04) as figure:
        grid = figure.subplots(1, 3, sharey=True)
        for axes, (title, unit, values) in zip(grid, panels, strict=True):
            _bars(axes, names, np.maximum(values, SMALLEST))
            axes.set(title=title, xlabel=unit)
        grid[0].invert_yaxis()
        return style.png(figure)


def _bars(axes: Any, names: Sequence[str], values: Any) -> None:
    low = 10.0 ** np.floor(np.log10(values.min() / 2))
    places = np.arange(len(names))
    colours = [style.SERIES[k % len(style.SERIES)] for k in places]
    axes.barh(places, values - low, left=low, height=0.6, color=colours, zorder=3)
    axes.set(xscale="log", xlim=(low, values.max() * (values.max() / low) ** 0.25))
    axes.set_yticks(places, names)
    axes.grid(axis="y", visible=False)
    style.log_labels(axes.xaxis)
    for place, value in zip(places, values, strict=True):
        axes.annotate(
            number(float(value), 3), (value, place), (4, 0), textcoords="offset points", va="center", fontsize=8.5
        )  # fmt: skip
