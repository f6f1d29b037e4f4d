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
    n, stated = curves[0].n, np.linspace(0.4, 0.9999, 3000)
    low, high = (100 * count / n for count in binom.interval(CHANCE, n, stated))
    label = f"where chance puts 90 % of honest bars ({n})"
    axes.fill_between(100 * stated, low, high, color=style.FAINT, alpha=0.45, lw=0, zorder=1, label=label)
    axes.plot([40, 100], [40, 100], color=style.SOFT, lw=1.1, zorder=2, label="as stated")
    shown = [(k, curve) for k, curve in enumerate(curves) if k == 0 or curve.n >= FEWEST]
    for k, curve in shown:
        look = {"ms": 6, "zorder": 4, "label": f"{curve.label} ({curve.n})", **_look(k)}
        axes.plot(100 * curve.levels, 100 * curve.covered, **look)
    lowest = min(float(curve.covered.min()) for _, curve in shown)
    axes.set(xlim=(45, 101), ylim=(min(40.0, 100 * lowest - 5), 103))
    axes.set(xlabel="stated level of the band (%)", ylabel=f"{what} inside it (%)")
    axes.set_title("What the bars state and what they hold")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=3, fontsize=8, columnspacing=1.2)


def _widths(axes: Any, curves: Sequence[BandCoverage]) -> None:
    curves = curves[1:] or curves
    first = 1 if len(curves) > 1 else 0
    pairs = [[100 * np.maximum(v, SMALLEST) for v in (c.half_width, c.missed)] for c in curves]
    half, missed = (np.concatenate(values) for values in zip(*pairs, strict=True))
    across = half.min() / 1.8, half.max() * 1.8
    low, high = min(missed.min(), half.min()) / 1.8, max(missed.max(), half.max()) * 1.8
    look = {"color": style.SERIES[2], "alpha": 0.09, "lw": 0, "zorder": 1, "label": "inside its band"}
    axes.fill_between(across, across, [low, low], **look)
    axes.plot(across, across, color=style.SOFT, lw=1.1, zorder=2)
    for k, (curve, pair) in enumerate(zip(curves, pairs, strict=True), start=first):
        size, alpha = (6, 0.5) if curve.n > MANY else (30, 0.9)
        look = {"linewidths": 0, "alpha": alpha, "zorder": 4, "label": curve.label if first else None}
        axes.scatter(*pair, size, **look, **_look(k))
    axes.set(xscale="log", yscale="log")
    axes.set(xlim=across, ylim=(low, high))
    for axis in (axes.xaxis, axes.yaxis):
        style.log_labels(axis)
    outside, count = sum(int(np.sum(c.missed > c.half_width)) for c in curves), sum(c.n for c in curves)
    axes.set(xlabel="half-width of the 90 % band (% of the effort's range)")
    axes.set(ylabel="miss (% of the effort's range)")
    axes.set_title(f"Each band and its miss: {outside} of {count} outside")
    axes.legend(loc="upper left")


def _look(number: int) -> dict[str, str]:
    """Colour and marker: the curve of everything is ink."""
    if number == 0:
        return {"color": style.INK, "marker": "o"}
    return {"color": style.SERIES[(number - 1) % 6], "marker": MARKERS[number % 6]}


LOOKS = {"all": (style.INK, "o"), "interior": (style.SERIES[0], "D"), "border": (style.SERIES[1], "s")}
LOW, HIGH = 0.85, 0.95  # of the 90 % band: what this project asks of itself


def design_bars(fitted: MetaFitted) -> style.Png:
    """Stated against covered, one line for each place."""
    with style.canvas(1000, 640) as figure:
        axes = figure.subplots()
        axes.plot([45, 100], [45, 100], color=style.SOFT, lw=1.1, zorder=1, label="as stated")
        lowest = 45.0
        for place, found in fitted.stage.coverage.items():
            levels = np.array([float(level) for level in found])
            covered = 100 * np.array(list(found.values()))
            colour, marker = LOOKS.get(place, (style.SERIES[2], "v"))
            axes.plot(100 * levels, covered, marker=marker, color=colour, ms=7, label=place, zorder=3)
            lowest = min(lowest, float(covered.min()) - 5)
        look = {"color": style.SERIES[2], "capsize": 5, "lw": 1.6, "zorder": 2}
        wanted = "wanted of the 90 % band: 85 to 95 %"
        axes.errorbar([90], [90], [[90 - 100 * LOW], [100 * HIGH - 90]], label=wanted, **look)
        axes.set(ylim=(lowest, 103), xlim=(45, 101), xlabel="stated level of the band (%)")
        axes.set_ylabel("states of designs left out inside it (%)")
        axes.set_title("What the bars of unseen designs hold")
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
    unit = display_unit("m") if float(spread["tip_radius_m"]) >= 1e-4 else Unit("µm", 1e6)
    with style.canvas(1560, 640, wspace=0.04) as figure:
        cloud, distance = figure.subplots(1, 2)
        _cloud(cloud, spread, tips, mean, np.asarray(tip_m, float), unit)
        _distance(distance, spread, tips, mean, unit)
        return style.png(figure)


def _cloud(axes: Any, spread: Mapping[str, Any], tips: Array, mean: Array, tip_m: Array, unit: Unit) -> None:
    """Tips from the tip of the laws themselves, with the interval in each coordinate and the ball."""
    i, j = (int(k) for k in sorted(np.argsort(-np.ptp(tips, axis=0), kind="stable")[:2]))
    level, blue = f"{100 * float(spread['level']):g} %", {"color": style.SERIES[0]}
    shown = unit.factor * (tips - tip_m)
    low, high = (unit.factor * (np.asarray(spread[name]) - tip_m) for name in ("tip_low_m", "tip_high_m"))
    centre, radius = unit.factor * (mean - tip_m), unit.factor * float(spread["tip_radius_m"])
    box = {"alpha": 0.1, "lw": 0, "zorder": 1, "label": f"{level} in each coordinate"}
    axes.fill_between([low[i], high[i]], [low[j]] * 2, [high[j]] * 2, **box, **blue)
    ball = centre[i] + radius * np.cos(CIRCLE), centre[j] + radius * np.sin(CIRCLE)
    axes.plot(*ball, lw=1.2, ls="--", zorder=2, label=f"{level} in a ball", **blue)
    dots = {"linewidths": 0, "alpha": 0.8, "zorder": 3, "label": f"drawn laws ({len(tips)})"}
    axes.scatter(shown[:, i], shown[:, j], 26, **dots, **blue)
    cross = {"color": style.WARN, "mec": "white", "mew": 0.8, "zorder": 5, "label": "the laws themselves"}
    axes.plot([0], [0], "P", ms=10, **cross)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.12)
    labels = [f"tip {COORDINATES[k]} from that of the laws ({unit.symbol})" for k in (i, j)]
    axes.set(xlabel=labels[0], ylabel=labels[1], title="Where the tip may be")
    axes.legend(loc="best", fontsize=8)


def _distance(axes: Any, spread: Mapping[str, Any], tips: Array, mean: Array, unit: Unit) -> None:
    """Share of the runs within a distance of the mean tip."""
    reach = np.sort(np.linalg.norm(tips - mean, axis=1)) * unit.factor
    share = 100 * np.arange(1, len(reach) + 1) / len(reach)
    axes.step([0, *reach], [0, *share], where="post", color=style.SERIES[0], lw=1.6)
    level, radius = 100 * float(spread["level"]), unit.factor * float(spread["tip_radius_m"])
    axes.plot([radius, radius, 0], [0, level, level], color=style.WARN, lw=1.1, ls="--")
    within = f"{level:g} % within {number(radius, 2)} {unit.symbol}"
    style.note(axes, within, (0, level), (6, 4), fontsize=9, color=style.WARN)
    axes.set(xlim=(0, 1.06 * float(max(reach.max(), radius))), ylim=(0, 104))
    axes.set(xlabel=f"distance from the mean tip ({unit.symbol})", ylabel="runs (%)")
    axes.set_title("How far from the mean")
