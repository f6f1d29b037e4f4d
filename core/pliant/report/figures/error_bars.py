"""Whether error bars hold what they say: stated level against share covered, and each band against its miss."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.stats import binom

from pliant.report.figures import style
from pliant.report.fit_view import BandCoverage
from pliant.report.meta_view import MetaFitted

SMALLEST = 1e-8  # share of the range, below which a miss is rounding
CHANCE = 0.9
MANY = 400
MARKERS = "oDsv^P"
FEWEST = 10  # states below which a curve of its own says nothing


def coverage_picture(curves: Sequence[BandCoverage], what: str = "states left out") -> style.Png:
    """Left: coverage by level, with what chance allows. Right: miss against band at 90 %."""
    with style.canvas(1560, 640, wspace=0.04) as figure:
        left, right = figure.subplots(1, 2)
        _coverage(left, curves, what)
        _widths(right, curves)
        return style.png(figure)


def _coverage(axes: Any, curves: Sequence[BandCoverage], what: str) -> None:
    n = curves[0].n
    stated = np.linspace(0.4, 0.9999, 3000)
    low, high = binom.interval(CHANCE, n, stated)
    axes.fill_between(
        100 * stated, 100 * low / n, 100 * high / n, color=style.FAINT, alpha=0.45, lw=0, zorder=1,
        label=f"where chance puts 90 % of honest bars ({n})",
    )  # fmt: skip
    axes.plot([40, 100], [40, 100], color=style.SOFT, lw=1.1, zorder=2, label="as stated")
    for number, curve in enumerate(curves):
        if number and curve.n < FEWEST:
            continue
        colour, marker = _look(number)
        axes.plot(
            100 * curve.levels, 100 * curve.covered, marker=marker, color=colour, ms=6, zorder=4,
            label=f"{curve.label} ({curve.n})",
        )  # fmt: skip
    axes.set_xlim(45, 101)
    lowest = min(float(c.covered.min()) for c in curves if c is curves[0] or c.n >= FEWEST)
    axes.set(
        ylim=(min(40.0, 100 * lowest - 5), 103),
        xlabel="stated level of the band (%)",
        ylabel=f"{what} inside it (%)",
        title="What the bars state and what they hold",
    )
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=3, fontsize=8, columnspacing=1.2)


def _widths(axes: Any, curves: Sequence[BandCoverage]) -> None:
    curves = curves[1:] or curves
    half, missed = (
        100 * np.maximum(np.concatenate([getattr(c, name) for c in curves]), SMALLEST)
        for name in ("half_width", "missed")
    )
    across = half.min() / 1.8, half.max() * 1.8
    low, high = min(missed.min(), half.min()) / 1.8, max(missed.max(), half.max()) * 1.8
    axes.fill_between(
        across, across, [low, low], color=style.SERIES[2], alpha=0.09, lw=0, zorder=1, label="inside its band"
    )
    axes.plot(across, across, color=style.SOFT, lw=1.1, zorder=2)
    first = 1 if len(curves) > 1 else 0
    for number, curve in enumerate(curves, start=first):
        colour, marker = _look(number)
        many = curve.n > MANY
        axes.scatter(
            100 * np.maximum(curve.half_width, SMALLEST), 100 * np.maximum(curve.missed, SMALLEST),
            6 if many else 30, color=colour, marker=marker, linewidths=0, alpha=0.5 if many else 0.9, zorder=4,
            label=curve.label if first else None,
        )  # fmt: skip
    axes.set(xscale="log", yscale="log")
    axes.set_xlim(*across)
    axes.set_ylim(low, high)
    for axis in (axes.xaxis, axes.yaxis):
        style.log_labels(axis)
    outside = sum(int(np.sum(c.missed > c.half_width)) for c in curves)
    count = sum(c.n for c in curves)
    axes.set(
        xlabel="half-width of the 90 % band (% of the effort's range)",
        ylabel="miss (% of the effort's range)",
        title=f"Each band and its miss: {outside} of {count} outside",
    )
    axes.legend(loc="upper left")


def _look(number: int) -> tuple[str, str]:
    """Colour and marker: the curve of everything is ink."""
    return (style.INK, "o") if number == 0 else (style.SERIES[(number - 1) % 6], MARKERS[number % 6])


LOOKS = {"all": (style.INK, "o"), "interior": (style.SERIES[0], "D"), "border": (style.SERIES[1], "s")}
LOW, HIGH = 0.85, 0.95  # of the 90 % band: what this project asks of itself


def design_bars(fitted: MetaFitted) -> style.Png:
    """Stated against covered, one line for each place."""
    with style.canvas(1000, 640) as figure:
        axes = figure.subplots()
        axes.plot([45, 100], [45, 100], color=style.SOFT, lw=1.1, zorder=1, label="as stated")
        lowest = 45.0
        for place, found in fitted.coverage.items():
            levels = np.array([float(level) for level in found])
            covered = 100 * np.array(list(found.values()))
            colour, marker = LOOKS.get(place, (style.SERIES[2], "v"))
            axes.plot(100 * levels, covered, marker=marker, color=colour, ms=7, label=place, zorder=3)
            lowest = min(lowest, float(covered.min()) - 5)
        axes.errorbar(
            [90], [90], [[90 - 100 * LOW], [100 * HIGH - 90]], color=style.SERIES[2], capsize=5, lw=1.6, zorder=2,
            label="wanted of the 90 % band: 85 to 95 %",
        )  # fmt: skip
        axes.set(
            ylim=(lowest, 103),
            xlim=(45, 101),
            xlabel="stated level of the band (%)",
            ylabel="states of designs left out inside it (%)",
            title="What the bars of unseen designs hold",
        )
        axes.legend(loc="lower right")
        return style.png(figure)
