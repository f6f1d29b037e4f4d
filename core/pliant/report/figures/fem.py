"""FEM data: the solved states of a module, where sampling put them, what each of them cost."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.colors import Normalize
from matplotlib.patches import Patch
from numpy.typing import NDArray

from pliant.formatting import actuation_unit, deformation_unit, effort_unit, number, percent, slides
from pliant.records.fem import TRUSTED, FemDataset, ModuleData
from pliant.report.fem_view import axis_record, explored_kinds, foretold_axes, solved_rows
from pliant.report.figures import style


@dataclass(frozen=True, eq=False)
class Groups:
    """Masks of a data set's states: fitted, checked, not trusted."""

    fit: NDArray[np.bool_]
    check: NDArray[np.bool_]
    untrusted: NDArray[np.bool_]

    @staticmethod
    def of(data: FemDataset) -> Groups:
        """Not trusted: what overlaps and was not let pass, and every unknown status."""
        trusted = np.isin(data.status, TRUSTED)
        check = data.role == "check"
        return Groups(trusted & ~check, trusted & check, ~trusted)


SIZE = 26
FEWEST_OF_A_LEVEL = 3  # states of one actuation that are joined by a line


def states_picture(data: ModuleData) -> style.Png:
    """The free branch, then τ over u of every explored axis, coloured by the actuation."""
    axes_names = data.explored_axes()
    panels = ["free", *axes_names]
    columns = len(panels) if len(panels) < 4 else 2
    rows = -(-len(panels) // columns)
    p_unit = actuation_unit(data.actuation_name)
    norm = Normalize(0.0, float(data.actuation.max()) or 1.0)
    with style.canvas(1560, 560 * rows if rows > 1 else 640, wspace=0.03) as figure:
        grid = np.atleast_1d(figure.subplots(rows, columns)).ravel()
        _free(grid[0], data, norm)
        for place, name in zip(grid[1:], axes_names, strict=False):
            _held(place, data, name, norm)
        for place in grid[len(panels) :]:
            place.set_axis_off()
        shown = (Normalize(0.0, p_unit.factor * (float(data.actuation.max()) or 1.0)), style.pressure_map())
        style.colour_bar(figure, shown, actuation_words(data), ax=grid.tolist(), fraction=0.03, pad=0.015)
        _legend(figure, data)
        return style.png(figure)


def actuation_words(data: ModuleData | FemDataset) -> str:
    """What drives the module with its unit, for an axis label."""
    word = "tendon force" if data.actuation_name == "tendon_force_n" else "pressure"
    return f"{word} ({actuation_unit(data.actuation_name).symbol})"


def coordinate_words(data: ModuleData | FemDataset, axis: str) -> str:
    """The joint coordinate with its unit, for an axis label."""
    unit = deformation_unit(data, axis)
    several = len(getattr(data, "axes", ())) > 1
    if slides(data, axis):
        return f"extension $u_{axis}$ ({unit.symbol})" if several else f"extension $u$ ({unit.symbol})"
    return (
        f"joint angle $u_{axis}$ about {axis} ({unit.symbol})"
        if several
        else f"joint angle $u$ ({unit.symbol})"
    )


def _free(axes: Any, data: ModuleData, norm: Normalize) -> None:
    """u over the actuation, no external effort."""
    main = data.axis(data.main_axis)
    p_unit, u_unit = actuation_unit(data.actuation_name), deformation_unit(data)
    free = main.rows(main.branch == "free")
    order = np.argsort(free.actuation, kind="stable")
    p, u = free.actuation[order] * p_unit.factor, free.angle_rad[order] * u_unit.factor
    axes.plot(p, u, color=style.SOFT, lw=1.1, zorder=2)
    state_points(axes, free, free.actuation * p_unit.factor, free.angle_rad * u_unit.factor, norm)
    axes.set(
        xlabel=actuation_words(data),
        ylabel=coordinate_words(data, data.main_axis),
        title="Free branch: nothing holds the module",
    )
    style.with_math(axes)


def _held(axes: Any, data: ModuleData, name: str, norm: Normalize) -> None:
    """τ over u of one axis, with lines between states of one actuation, and failed states at the foot."""
    one = data.axis(name)
    u_unit, effort = deformation_unit(data, name), effort_unit(data, name)
    x, y = one.angle_rad * u_unit.factor, one.moment_n_m * effort.factor
    axes.axhline(0, color=style.SOFT, lw=0.9, zorder=1)
    colours = style.pressure_map()
    for level in np.unique(one.actuation):
        chosen = np.flatnonzero((one.actuation == level) & (one.role == "fit"))
        if len(chosen) >= FEWEST_OF_A_LEVEL:
            chosen = chosen[np.argsort(x[chosen], kind="stable")]
            axes.plot(x[chosen], y[chosen], color=colours(norm(level)), lw=0.8, zorder=2)
    state_points(axes, one, x, y, norm)
    lost = [f["angle_rad"] for f in one.failed if isinstance(f.get("angle_rad"), int | float)]
    if lost:
        foot = axes.get_ylim()[0]
        axes.plot(
            np.array(lost, float) * u_unit.factor, np.full(len(lost), foot), "^", color=style.WARN, ms=6,
            clip_on=False, zorder=6,
        )  # fmt: skip
        axes.set_ylim(bottom=foot)
    several = len(data.axes) > 1
    axes.set(
        xlabel=coordinate_words(data, name),
        ylabel=rf"effort $\tau_{name}$ ({effort.symbol})" if several else rf"effort $\tau$ ({effort.symbol})",
    )
    style.with_math(axes)
    follows = f"{data.main_axis} follows freely" if name != data.main_axis else "the others at zero"
    held = f"Held {'along' if slides(data, name) else 'about'} {name}; {follows}"
    axes.set_title(held if several else "Held: the effort that opposes actuation")


def state_points(axes: Any, data: FemDataset, x: Any, y: Any, norm: Normalize, many: bool = False) -> None:
    """States as points in the colours of their actuation: filled = to fit, open = check, cross = self-contact."""
    groups, size = Groups.of(data), 3 if many else SIZE
    shade = style.pressure_map()(norm(data.actuation))
    g = groups.fit
    axes.scatter(x[g], y[g], size, color=shade[g], edgecolor="white", linewidths=0 if many else 0.4, zorder=4)
    g, edge = groups.check, 0.5 if many else 1.2
    open_ = {"marker": "D", "facecolor": "white", "linewidths": edge, "zorder": 5}
    axes.scatter(x[g], y[g], 1.4 * size, edgecolor=shade[g], **open_)
    g = groups.untrusted
    axes.scatter(x[g], y[g], 1.3 * size, marker="x", color=style.WARN, linewidths=1.3, zorder=5)


def _legend(figure: Any, data: ModuleData) -> None:
    shown = np.isin(data.explored, data.explored_axes())
    trusted, check = np.isin(data.status, TRUSTED), data.role == "check"
    to_fit, never = int(np.sum(shown & trusted & ~check)), int(np.sum(shown & trusted & check))
    handles = [
        style.entry(f"to fit ({to_fit})", "o", ms=5.5, color=style.SOFT),
        style.entry(f"check, never fitted ({never})", "D", ms=5.5, mfc="white", mec=style.SOFT),
    ]
    if contact := int(np.sum(shown & ~trusted)):
        handles.append(style.entry(f"self-contact ({contact})", "x", ms=5.5, color=style.WARN))
    if data.failed:
        failed = f"failed ({len(data.failed)}), at the foot"
        handles.append(style.entry(failed, "^", ms=5.5, color=style.WARN))
    style.key_below(figure, handles)


SMALLEST_MISS = 1e-8  # a share of the range below which a miss is rounding


def sampling_picture(data: ModuleData) -> style.Png:
    """One row for each axis: the plane of u and actuation, and misses over the number of states."""
    names = foretold_axes(data)
    with style.canvas(1560, 560 * len(names) + 40, wspace=0.04) as figure:
        grid = figure.subplots(len(names), 2, squeeze=False, width_ratios=[1, 1.25])
        for (plane, history), name in zip(grid, names, strict=True):
            _plane(plane, data, name)
            _history(history, data, name)
        return style.png(figure)


def _plane(axes: Any, data: ModuleData, name: str) -> None:
    """Where the states lie; those chosen one by one carry their number."""
    one = data.axis(name)
    p_unit, u_unit = actuation_unit(data.actuation_name), deformation_unit(data, name)
    x, y = one.angle_rad * u_unit.factor, one.actuation * p_unit.factor
    groups = Groups.of(one)
    fit, check, lost = groups.fit, groups.check, groups.untrusted
    axes.scatter(x[fit], y[fit], 20, color=style.FAINT, linewidths=0, zorder=3)
    axes.scatter(x[check], y[check], 30, marker="D", facecolor="white", edgecolor=style.SOFT, zorder=3)
    axes.scatter(x[lost], y[lost], 34, marker="x", color=style.WARN, linewidths=1.3, zorder=3)
    tests = axis_record(data, name)["tests"]
    for count, test in enumerate(tests, start=1):
        place = (test["deformation"] * u_unit.factor, test["actuation"] * p_unit.factor)
        axes.scatter(*place, 130, color=style.SERIES[0], linewidths=0, zorder=4)
        axes.annotate(str(count), place, ha="center", va="center", fontsize=6.5, color="white", zorder=5)
    axes.margins(0.06)
    axes.set(
        xlabel=coordinate_words(data, name),
        ylabel=actuation_words(data),
        title="Where the states lie, in the order of choice",
    )
    style.with_math(axes)


def _history(axes: Any, data: ModuleData, name: str) -> None:
    """Each new state against its prediction; the stated error at the end."""
    record = axis_record(data, name)
    tests, wanted = record["tests"], 100 * float(record["error"])
    numbers, last = np.arange(1, len(tests) + 1), len(tests) + 0.6
    spread, misses = (
        100 * np.maximum([t[key] for t in tests], SMALLEST_MISS) for key in ("deviation", "miss")
    )
    look = {"color": style.SOFT, "lw": 1.1, "ls": "--"}
    axes.semilogy(numbers, spread, label="deviation of the process where it was largest", **look)
    axes.semilogy(numbers, misses, "o-", color=style.SERIES[0], ms=5, lw=1.0, label="miss of the prediction")
    axes.axhline(wanted, color=style.SERIES[2], lw=1.4, label=f"wanted: {percent(wanted / 100)}")
    if (stated := record.get("stated_error")) is not None:
        label = f"stated at the end: {percent(float(stated))}"
        axes.semilogy([last], [100 * float(stated)], "s", color=style.SERIES[1], ms=7, label=label)
    if (check := record.get("check_error")) is not None:
        look = {"mfc": "white", "mec": style.SERIES[3], "ms": 7, "mew": 1.4}
        label = f"largest error at check states: {percent(float(check))}"
        axes.semilogy([last], [max(100 * float(check), 100 * SMALLEST_MISS)], "D", label=label, **look)
    axes.set_xlim(0.4, len(tests) + 0.95)
    low, high = axes.get_ylim()
    axes.set_ylim(low, high * (high / low) ** 0.45)  # room for the legend
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.yaxis.set_major_formatter(lambda value, _: number(float(value), 2))
    of_axis = f", axis {name}" if len(data.axes) > 1 else ""
    axes.set(xlabel="state chosen, in order", ylabel="% of the effort's range")
    axes.set_title(f"Misses of each new state{of_axis}")
    axes.legend(loc="upper right")


def cost_picture(data: ModuleData) -> style.Png:
    """Bars of seconds above bars of Newton steps, coloured by the axis that each state explores."""
    rows = solved_rows(data)
    kinds = explored_kinds(data)
    colour = dict(zip(kinds, style.SERIES, strict=False))
    shades = [colour.get(str(name), style.SOFT) for name in data.explored[rows]]
    place = np.arange(1, int(rows.sum()) + 1)
    with style.canvas(1560, 520, pad=(0.09, 0.06)) as figure:
        above, below = figure.subplots(2, 1, sharex=True)
        for axes, heights, label in (
            (above, data.wall_s, "seconds"),
            (below, data.iterations, "Newton steps"),
        ):
            axes.bar(place, heights[rows], width=0.8, color=shades)
            axes.set_ylabel(label)
            axes.grid(False, axis="x")
        below.set_xlabel("state, in the order of solution")
        above.set(xlim=(0.2, len(place) + 0.8), title="Time and Newton steps of each state")
        if len(kinds) > 1:
            words = {"coupling": "all axes held"}
            handles = [Patch(color=colour[k], label=words.get(k, f"axis {k}")) for k in kinds]
            figure.legend(handles=handles, loc="outside right upper")
        return style.png(figure)
