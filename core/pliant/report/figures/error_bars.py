"""Whether error bars hold what they say, and where the tip may be with laws drawn from them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import binom

from pliant.formatting import Unit, display_unit, number
from pliant.records.design import Array
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
    for k, curve in enumerate(curves):
        if k and curve.n < FEWEST:
            continue
        colour, marker = _look(k)
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
    for k, curve in enumerate(curves, start=first):
        colour, marker = _look(k)
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


COORDINATES = "xyz"
CIRCLE = np.linspace(0, 2 * np.pi, 121)


def tip_cloud(spread: Mapping[str, Any], tip_m: Array) -> style.Png | None:
    """The two coordinates that vary most, then how far the tips lie from their mean; None without settled runs.

    Args:
        spread: of `pliant.pipeline.uncertainty`.
        tip_m: (3,) with the laws themselves.
    """
    tips = np.asarray(spread["tips_m"], float)
    if "tip_mean_m" not in spread or len(tips) < 2:
        return None
    mean = np.asarray(spread["tip_mean_m"], float)
    i, j = sorted(np.argsort(-np.ptp(tips, axis=0), kind="stable")[:2])
    unit = display_unit("m") if float(spread["tip_radius_m"]) >= 1e-4 else Unit("µm", 1e6)
    with style.canvas(1560, 640, wspace=0.04) as figure:
        cloud, distance = figure.subplots(1, 2)
        _cloud(cloud, spread, tips, mean, np.asarray(tip_m, float), (int(i), int(j)), unit)
        _distance(distance, spread, tips, mean, unit)
        return style.png(figure)


def _cloud(
    axes: Any,
    spread: Mapping[str, Any],
    tips: Array,
    mean: Array,
    tip_m: Array,
    plane: tuple[int, int],
    unit: Unit,
) -> None:
    """Tips from the tip of the laws themselves, with the interval in each coordinate and the ball."""
    level = f"{100 * float(spread['level']):g} %"
    i, j = plane
    shown = unit.factor * (tips - tip_m)
    low, high = (unit.factor * (np.asarray(spread[name]) - tip_m) for name in ("tip_low_m", "tip_high_m"))
    centre, radius = unit.factor * (mean - tip_m), unit.factor * float(spread["tip_radius_m"])
    axes.fill_between(
        [low[i], high[i]], [low[j]] * 2, [high[j]] * 2, color=style.SERIES[0], alpha=0.1, lw=0, zorder=1,
        label=f"{level} in each coordinate",
    )  # fmt: skip
    axes.plot(
        centre[i] + radius * np.cos(CIRCLE), centre[j] + radius * np.sin(CIRCLE), color=style.SERIES[0], lw=1.2,
        ls="--", zorder=2, label=f"{level} in a ball",
    )  # fmt: skip
    axes.scatter(
        shown[:, i], shown[:, j], 26, color=style.SERIES[0], linewidths=0, alpha=0.8, zorder=3,
        label=f"drawn laws ({len(tips)})",
    )  # fmt: skip
    axes.plot(
        [0], [0], "P", ms=10, color=style.WARN, mec="white", mew=0.8, zorder=5, label="the laws themselves"
    )
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.12)
    axes.set(
        xlabel=f"tip {COORDINATES[i]} from that of the laws ({unit.symbol})",
        ylabel=f"tip {COORDINATES[j]} from that of the laws ({unit.symbol})",
        title="Where the tip may be",
    )
    axes.legend(loc="best", fontsize=8)


def _distance(axes: Any, spread: Mapping[str, Any], tips: Array, mean: Array, unit: Unit) -> None:
    """Share of the runs within a distance of the mean tip."""
    reach = np.sort(np.linalg.norm(tips - mean, axis=1)) * unit.factor
    share = 100 * np.arange(1, len(reach) + 1) / len(reach)
    axes.step([0, *reach], [0, *share], where="post", color=style.SERIES[0], lw=1.6)
    level, radius = 100 * float(spread["level"]), unit.factor * float(spread["tip_radius_m"])
    axes.plot([radius, radius, 0], [0, level, level], color=style.WARN, lw=1.1, ls="--")
    axes.annotate(
        f"{level:g} % within {number(radius, 2)} {unit.symbol}", (0, level), (6, 4),
        textcoords="offset points", fontsize=9, color=style.WARN,
    )  # fmt: skip
    axes.set(
        xlim=(0, 1.06 * float(max(reach.max(), radius))),
        ylim=(0, 104),
        xlabel=f"distance from the mean tip ({unit.symbol})",
        ylabel="runs (%)",
        title="How far from the mean",
    )
