"""Predicted against solved on designs left out: torques inside the range and on its border, and free angles."""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.formatting import deformation_unit, effort_unit, percent
from pliant.report.figures import style
from pliant.report.meta_reading import PLACES, MetaFitted

MANY = 500
COLOURS = {"interior": style.SERIES[0], "border": style.SERIES[1]}


def parity_picture(fitted: MetaFitted) -> style.Png:
    """One row for each axis: solved against predicted, interior and border apart, then misses of both."""
    data = fitted.designs.data[0]
    effort = effort_unit(data)
    names = fitted.axes
    with style.canvas(1560, 500 * len(names) + 40) as figure:
        figure.set_layout_engine("constrained", w_pad=0.09, h_pad=0.09, wspace=0.04)
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
                axes.set_xlabel(f"solved {symbol} ({effort.symbol})")
                axes.set_ylabel(f"predicted {symbol} ({effort.symbol})")
            for place, rows in reversed(groups.items()):
                tau = effort.factor * fitted.misses.tau[rows, a]
                _dots(row[2], tau, 100 * fitted.shares[rows, a], COLOURS[place], place)
            row[2].axhline(0, color=style.SOFT, lw=0.9, zorder=1)
            row[2].set_title("Predicted − solved", fontsize=9.5)
            row[2].set_xlabel(f"solved {symbol} ({effort.symbol})")
            row[2].set_ylabel("% of the design's range")
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
    with style.canvas(1560, 560) as figure:
        figure.set_layout_engine("constrained", w_pad=0.09, h_pad=0.09, wspace=0.04)
        left, right = figure.subplots(1, 2)
        for place in PLACES[::-1]:
            rows = fitted.border[misses.free_design] == (place == "border")
            rows &= np.isfinite(miss)
            if rows.any():
                _parity(left, u[rows], u[rows] + miss[rows], COLOURS[place])
                _dots(right, u[rows], 100 * miss[rows] / largest[rows], COLOURS[place], place)
        right.axhline(0, color=style.SOFT, lw=0.9, zorder=1)
        every = fitted.scores["all"]
        left.set_title(
            f"Free {word}: median miss {percent(every.free_median)}, worst {_worst(every.free_worst)}"
        )
        left.set_xlabel(f"solved free {word} ({unit.symbol})")
        left.set_ylabel(f"predicted free {word} ({unit.symbol})")
        right.set_title("Predicted − solved")
        right.set_xlabel(f"solved free {word} ({unit.symbol})")
        right.set_ylabel(f"% of the design's largest free {word}")
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
