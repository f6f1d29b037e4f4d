"""Where adaptive sampling put its states, and how well each was foretold before it was solved."""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.formatting import actuation_unit, deformation_unit, number, percent
from pliant.records.fem import ModuleData
from pliant.report.fem_reading import axis_record, foretold_axes
from pliant.report.figures import style
from pliant.report.figures.fem_states import actuation_word, coordinate_words
from pliant.report.figures.state_groups import Groups

SMALLEST_MISS = 1e-8  # a share of the range below which a miss is rounding


def sampling_picture(data: ModuleData) -> style.Png:
    """One row for each axis: the plane of u and actuation, and misses over the number of states."""
    names = foretold_axes(data)
    with style.canvas(1560, 560 * len(names) + 40) as figure:
        grid = figure.subplots(len(names), 2, squeeze=False, width_ratios=[1, 1.25])
        for (plane, history), name in zip(grid, names, strict=True):
            _plane(plane, data, name)
            _history(history, data, name)
        figure.set_layout_engine("constrained", w_pad=0.09, h_pad=0.09, wspace=0.04)
        return style.png(figure)


def _plane(axes: Any, data: ModuleData, name: str) -> None:
    """Where the states lie; those chosen one by one carry their number."""
    one = data.axis(name)
    p_unit, u_unit = actuation_unit(data.actuation_name), deformation_unit(data)
    x, y = one.angle_rad * u_unit.factor, one.actuation * p_unit.factor
    groups = Groups.of(one)
    fit, check, lost = groups.fit, groups.check, groups.untrusted
    axes.scatter(x[fit], y[fit], 20, color=style.FAINT, linewidths=0, zorder=3)
    axes.scatter(x[check], y[check], 30, marker="D", facecolor="white", edgecolor=style.SOFT, zorder=3)
    axes.scatter(x[lost], y[lost], 34, marker="x", color=style.WARN, linewidths=1.3, zorder=3)
    tests = axis_record(data, name)["tests"]
    for index, test in enumerate(tests, start=1):
        place = (test["deformation"] * u_unit.factor, test["actuation"] * p_unit.factor)
        axes.scatter(*place, 130, color=style.SERIES[0], linewidths=0, zorder=4)
        axes.annotate(str(index), place, ha="center", va="center", fontsize=6.5, color="white", zorder=5)
    axes.margins(0.06)
    axes.set_xlabel(coordinate_words(data, name))
    axes.set_ylabel(f"{actuation_word(data)} ({p_unit.symbol})")
    axes.set_title("Where the states lie, in the order of choice")


def _history(axes: Any, data: ModuleData, name: str) -> None:
    """Each new state against its prediction; the stated error at the end."""
    record = axis_record(data, name)
    tests, wanted = record["tests"], 100 * float(record["error"])
    numbers = np.arange(1, len(tests) + 1)
    misses = 100 * np.maximum([t["miss"] for t in tests], SMALLEST_MISS)
    spread = 100 * np.maximum([t["deviation"] for t in tests], SMALLEST_MISS)
    axes.semilogy(
        numbers,
        spread,
        color=style.SOFT,
        lw=1.1,
        ls="--",
        label="deviation of the process where it was largest",
    )
    axes.semilogy(numbers, misses, "o-", color=style.SERIES[0], ms=5, lw=1.0, label="miss of the prediction")
    axes.axhline(wanted, color=style.SERIES[2], lw=1.4, label=f"wanted: {percent(wanted / 100)}")
    stated = record.get("stated_error")
    if stated is not None:
        axes.semilogy(
            [len(tests) + 0.6], [100 * float(stated)], "s", color=style.SERIES[1], ms=7,
            label=f"stated at the end: {percent(float(stated))}",
        )  # fmt: skip
    check = record.get("check_error")
    if check is not None:
        axes.semilogy(
            [len(tests) + 0.6], [max(100 * float(check), 100 * SMALLEST_MISS)], "D", mfc="white", mec=style.SERIES[3],
            ms=7, mew=1.4, label=f"largest error at check states: {percent(float(check))}",
        )  # fmt: skip
    axes.set_xlim(0.4, len(tests) + 0.95)
    low, high = axes.get_ylim()
    axes.set_ylim(low, high * (high / low) ** 0.45)  # room for the legend
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.yaxis.set_major_formatter(lambda value, _: number(float(value), 2))
    axes.set_xlabel("state chosen, in order")
    axes.set_ylabel("% of the effort's range")
    axes.set_title(
        f"Misses of each new state, axis {name}" if len(data.axes) > 1 else "Misses of each new state"
    )
    axes.legend(loc="upper right")
