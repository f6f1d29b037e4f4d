"""Where the tip ends with laws drawn from their error bars, beside where it ends with the laws themselves."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pliant.formatting import Unit, display_unit, number
from pliant.records.design import Array
from pliant.report.figures import style

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
    unit = _unit(float(spread["tip_radius_m"]))
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


def _unit(length_m: float) -> Unit:
    """Millimetres, or micrometres where the cloud is smaller."""
    return display_unit("m") if length_m >= 1e-4 else Unit("µm", 1e6)
