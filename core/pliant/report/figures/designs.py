"""A meta-model on designs left out: predicted against solved, and errors over the space of designs."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.lines import Line2D

from pliant.formatting import deformation_unit, effort_unit, percent
from pliant.report.figures import style
from pliant.report.meta_view import PLACES, MetaFitted, parameter_unit

MANY = 500
COLOURS = {"interior": style.SERIES[0], "border": style.SERIES[1]}


def parity_picture(fitted: MetaFitted) -> style.Png:
    """One row for each axis: solved against predicted, interior and border apart, then misses of both."""
    data = fitted.designs.data[0]
    effort = effort_unit(data)
    names = fitted.axes
    with style.canvas(1560, 500 * len(names) + 40, wspace=0.04) as figure:
        grid = figure.subplots(len(names), 3, squeeze=False)
        for row, (a, name) in zip(grid, enumerate(names), strict=True):
            symbol = rf"$\tau_{name}$" if len(names) > 1 else r"$\tau$"
            groups = {place: _rows(fitted, a, place) for place in PLACES}
            for axes, (place, rows) in zip(row, groups.items(), strict=False):
                tau, miss = fitted.misses.tau[rows, a], fitted.misses.miss[rows, a]
                _parity(axes, effort.factor * tau, effort.factor * (tau + miss), COLOURS[place])
                count = len(np.unique(fitted.misses.design[rows]))
                axes.set_title(
                    f"{symbol}, {place}: {count} designs, R² {_r2(fitted, place, name)}", fontsize=9.5
                )
                axes.set(
                    xlabel=f"solved {symbol} ({effort.symbol})",
                    ylabel=f"predicted {symbol} ({effort.symbol})",
                )
            for place, rows in reversed(groups.items()):
                tau = effort.factor * fitted.misses.tau[rows, a]
                _dots(row[2], tau, 100 * fitted.shares[rows, a], COLOURS[place], place)
            row[2].axhline(0, color=style.SOFT, lw=0.9, zorder=1)
            row[2].set_title("Predicted − solved", fontsize=9.5)
            row[2].set(xlabel=f"solved {symbol} ({effort.symbol})", ylabel="% of the design's range")
            row[2].legend(loc="best", markerscale=1.6)
        return style.png(figure)


def free_picture(fitted: MetaFitted) -> style.Png | None:
    """Free angles of designs left out: predicted against solved, and misses; None without free states."""
    misses, data = fitted.misses, fitted.designs.data[0]
    if not len(misses.free_design):
        return None
    unit = deformation_unit(data)
    word = "extension" if data.joint == "prismatic" else "angle"
    u, miss = unit.factor * misses.free_angle, unit.factor * misses.free_miss
    largest = np.array([np.abs(u[misses.free_design == d]).max() for d in misses.free_design])
    with style.canvas(1560, 560, wspace=0.04) as figure:
        left, right = figure.subplots(1, 2)
        for place in PLACES[::-1]:
            rows = fitted.border[misses.free_design] == (place == "border")
            rows &= np.isfinite(miss)
            if rows.any():
                _parity(left, u[rows], u[rows] + miss[rows], COLOURS[place])
                _dots(right, u[rows], 100 * miss[rows] / largest[rows], COLOURS[place], place)
        right.axhline(0, color=style.SOFT, lw=0.9, zorder=1)
        every = fitted.scores["all"]
        left.set(
            title=f"Free {word}: median miss {percent(every.free_median)}, worst {_worst(every.free_worst)}",
            xlabel=f"solved free {word} ({unit.symbol})",
            ylabel=f"predicted free {word} ({unit.symbol})",
        )
        right.set(
            title="Predicted − solved",
            xlabel=f"solved free {word} ({unit.symbol})",
            ylabel=f"% of the design's largest free {word}",
        )
        right.legend(loc="best", markerscale=1.6)
        return style.png(figure)


def _rows(fitted: MetaFitted, a: int, place: str) -> Any:
    return fitted.misses.counts[:, a] & (fitted.border[fitted.misses.design] == (place == "border"))


def _parity(axes: Any, solved: Any, predicted: Any, colour: str) -> None:
    if not len(solved):
        return
    limits = np.array([min(solved.min(), predicted.min()), max(solved.max(), predicted.max())])
    axes.plot(limits, limits, color=style.SOFT, lw=1.0, zorder=1)
    _dots(axes, solved, predicted, colour)


def _dots(axes: Any, x: Any, y: Any, colour: str, label: str | None = None) -> None:
    many = len(x) > MANY
    axes.scatter(
        x,
        y,
        5 if many else 14,
        color=colour,
        alpha=0.55 if many else 0.8,
        linewidths=0,
        zorder=3,
        label=label,
    )


def _r2(fitted: MetaFitted, place: str, axis: str) -> str:
    scores = fitted.scores.get(place)
    if scores is None or axis not in scores.axes:
        return "–"
    return f"{scores.axes[axis].r2:.6f}"


def _worst(share: float) -> str:
    return "no equilibrium" if np.isinf(share) else percent(share)


MOST = 6  # panels
SPREAD = 0.042  # of a parameter's range: designs of a grid that share a place in a panel stand side by side


def design_errors(fitted: MetaFitted) -> style.Png:
    """One panel for each pair of parameters, at most six; one parameter alone stands against its error."""
    names = fitted.designs.names
    pairs = list(combinations(range(len(names)), 2))[:MOST]
    shares = 100 * np.maximum(
        np.where(np.isfinite(fitted.worst), fitted.worst, np.nanmax(fitted.worst)), 1e-8
    )
    low, high = 10.0 ** np.floor(np.log10(np.nanmin(shares))), 10.0 ** np.ceil(np.log10(np.nanmax(shares)))
    norm = LogNorm(low, max(high, 10 * low))
    columns = min(max(len(pairs), 1), 3)
    rows = -(-max(len(pairs), 1) // columns)
    with style.canvas(1560 if columns > 1 else 1000, 540 * rows + 60, wspace=0.04) as figure:
        grid = figure.subplots(rows, columns, squeeze=False).ravel()
        if not pairs:
            _against(grid[0], fitted, shares, norm)
        for axes, (i, j) in zip(grid, pairs, strict=False):
            _pair(axes, fitted, i, j, shares, norm)
        for axes in grid[max(len(pairs), 1) :]:
            axes.set_axis_off()
        bar = figure.colorbar(
            ScalarMappable(norm, style.error_map()), ax=grid.tolist(), pad=0.015, fraction=0.03, aspect=40
        )
        bar.set_label("worst miss when left out (% of range)")
        style.log_labels(bar.ax.yaxis)
        bar.outline.set_visible(False)
        _legend(figure, fitted)
        return style.png(figure)


def _pair(axes: Any, fitted: MetaFitted, i: int, j: int, shares: Any, norm: LogNorm) -> None:
    designs = fitted.designs
    x_unit, y_unit = (parameter_unit(designs.names[k]) for k in (i, j))
    x, y = designs.values[:, i] * x_unit.factor, designs.values[:, j] * y_unit.factor
    dx, dy = _apart(x, y)
    _scatter(axes, x + dx * np.ptp(x), y + dy * np.ptp(y), fitted, shares, norm)
    for number, proposal in enumerate(fitted.proposals, start=1):
        place = proposal.values[i] * x_unit.factor, proposal.values[j] * y_unit.factor
        axes.plot(*place, "*", ms=14, mfc=style.SERIES[0], mec="white", mew=0.9, zorder=6)
        axes.annotate(
            str(number), place, (8, 5), textcoords="offset points", fontsize=9.5, weight="bold", color=style.SERIES[0],
            zorder=7,
        )  # fmt: skip
    axes.margins(0.1)
    axes.set(xlabel=x_unit.axis, ylabel=y_unit.axis)


def _against(axes: Any, fitted: MetaFitted, shares: Any, norm: LogNorm) -> None:
    unit = parameter_unit(fitted.designs.names[0])
    _scatter(axes, fitted.designs.values[:, 0] * unit.factor, shares, fitted, shares, norm)
    axes.set_yscale("log")
    style.log_labels(axes.yaxis)
    axes.set(xlabel=unit.axis, ylabel="worst miss (% of the design's range)")


def _scatter(axes: Any, x: Any, y: Any, fitted: MetaFitted, shares: Any, norm: LogNorm) -> None:
    for marker, chosen, size in (("o", ~fitted.border, 62), ("s", fitted.border, 46)):
        axes.scatter(
            x[chosen], y[chosen], size, c=shares[chosen], cmap=style.error_map(), norm=norm, marker=marker,
            edgecolor=style.INK, linewidths=0.5, zorder=3,
        )  # fmt: skip


def _apart(x: Any, y: Any) -> tuple[Any, Any]:
    """Small shifts, shares of the ranges, so that designs with the same pair of values do not hide each other."""
    _, place = np.unique(np.round(np.stack([x, y], axis=1), 9), axis=0, return_inverse=True)
    place = place.ravel()
    dx, dy = np.zeros(len(x)), np.zeros(len(x))
    for value in range(int(place.max()) + 1):
        rows = np.flatnonzero(place == value)
        side = int(np.ceil(np.sqrt(len(rows))))
        k = np.arange(len(rows))
        if len(rows) > 1:
            dx[rows] = SPREAD * (k % side - (side - 1) / 2)
            dy[rows] = SPREAD * 1.6 * (k // side - (side - 1) / 2)
    return dx, dy


def _legend(figure: Any, fitted: MetaFitted) -> None:
    def entry(label: str, marker: str, **look: Any) -> Line2D:
        return Line2D([], [], ls="", marker=marker, label=label, **look)

    handles = [
        entry(f"inside the range ({int((~fitted.border).sum())})", "o", mfc=style.FAINT, mec=style.INK, ms=7),
        entry(f"on its border ({int(fitted.border.sum())})", "s", mfc=style.FAINT, mec=style.INK, ms=6.5),
    ]
    if fitted.proposals:
        handles.append(entry("solve next, in order", "*", color=style.SERIES[0], mec="white", ms=14))
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), handletextpad=0.3)
