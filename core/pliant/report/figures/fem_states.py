"""The solved states of a module: its free branch, and the effort that holds it, for each axis that was explored."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.lines import Line2D

from pliant.formatting import Unit, actuation_unit, deformation_unit, effort_unit
from pliant.records.fem import TRUSTED, FemDataset, ModuleData
from pliant.report.figures import style
from pliant.report.figures.state_groups import Groups

SIZE = 26
FEWEST_OF_A_LEVEL = 3  # states of one actuation that are joined by a line


def states_picture(data: ModuleData) -> style.Png:
    """The free branch, then τ over u of every explored axis, coloured by the actuation."""
    axes_names = data.explored_axes()
    panels = ["free", *axes_names]
    columns = len(panels) if len(panels) < 4 else 2
    rows = -(-len(panels) // columns)
    p_unit = actuation_unit(data.actuation_name)
    norm = Normalize(0.0, (float(data.actuation.max()) or 1.0) * p_unit.factor)
    with style.canvas(1560, 560 * rows if rows > 1 else 640) as figure:
        grid = np.atleast_1d(figure.subplots(rows, columns)).ravel()
        _free(grid[0], data, norm)
        for place, name in zip(grid[1:], axes_names, strict=False):
            _held(place, data, name, norm)
        for place in grid[len(panels) :]:
            place.set_axis_off()
        mapped = ScalarMappable(norm, style.pressure_map())
        bar = figure.colorbar(mapped, ax=grid.tolist(), fraction=0.03, pad=0.015)
        bar.set_label(f"{actuation_word(data)} ({p_unit.symbol})")
        bar.outline.set_visible(False)
        _legend(figure, data)
        figure.set_layout_engine("constrained", w_pad=0.09, h_pad=0.09, wspace=0.03)
        return style.png(figure)


def actuation_word(data: ModuleData | FemDataset) -> str:
    """What drives the module, in a word."""
    return "tendon force" if data.actuation_name == "tendon_force_n" else "pressure"


def coordinate_words(data: ModuleData | FemDataset, axis: str) -> str:
    """The joint coordinate with its unit, for an axis label."""
    unit = deformation_unit(data)
    if data.joint == "prismatic":
        return f"extension $u$ ({unit.symbol})"
    several = len(getattr(data, "axes", ())) > 1
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
    _points(axes, free, free.actuation * p_unit.factor, free.angle_rad * u_unit.factor, norm, p_unit)
    axes.set_xlabel(f"{actuation_word(data)} ({p_unit.symbol})")
    axes.set_ylabel(coordinate_words(data, data.main_axis))
    axes.set_title("Free branch: nothing holds the module")


def _held(axes: Any, data: ModuleData, name: str, norm: Normalize) -> None:
    """τ over u of one axis, with lines between states of one actuation, and failed states at the foot."""
    one = data.axis(name)
    p_unit, u_unit = actuation_unit(data.actuation_name), deformation_unit(data)
    effort = effort_unit(data)
    x, y = one.angle_rad * u_unit.factor, one.moment_n_m * effort.factor
    axes.axhline(0, color=style.SOFT, lw=0.9, zorder=1)
    colours = style.pressure_map()
    for level in np.unique(one.actuation):
        chosen = np.flatnonzero((one.actuation == level) & (one.role == "fit"))
        if len(chosen) >= FEWEST_OF_A_LEVEL:
            chosen = chosen[np.argsort(x[chosen], kind="stable")]
            axes.plot(x[chosen], y[chosen], color=colours(norm(level * p_unit.factor)), lw=0.8, zorder=2)
    _points(axes, one, x, y, norm, p_unit)
    lost = [f["angle_rad"] for f in one.failed if isinstance(f.get("angle_rad"), int | float)]
    if lost:
        foot = axes.get_ylim()[0]
        axes.plot(
            np.array(lost, float) * u_unit.factor, np.full(len(lost), foot), "^", color=style.WARN, ms=6,
            clip_on=False, zorder=6,
        )  # fmt: skip
        axes.set_ylim(bottom=foot)
    several = len(data.axes) > 1
    axes.set_xlabel(coordinate_words(data, name))
    axes.set_ylabel(
        rf"effort $\tau_{name}$ ({effort.symbol})" if several else rf"effort $\tau$ ({effort.symbol})"
    )
    follows = f"{data.main_axis} follows freely" if name != data.main_axis else "the others at zero"
    axes.set_title(f"Held about {name}; {follows}" if several else "Held: the effort that opposes actuation")


def _points(axes: Any, data: FemDataset, x: Any, y: Any, norm: Normalize, p_unit: Unit) -> None:
    """States as points: filled = to fit, open = check, cross = self-contact."""
    groups = Groups.of(data)
    shade = style.pressure_map()(norm(data.actuation * p_unit.factor))
    g = groups.fit
    axes.scatter(x[g], y[g], SIZE, color=shade[g], edgecolor="white", linewidths=0.4, zorder=4)
    g = groups.check
    axes.scatter(
        x[g], y[g], 1.4 * SIZE, marker="D", facecolor="white", edgecolor=shade[g], linewidths=1.2, zorder=5
    )
    g = groups.untrusted
    axes.scatter(x[g], y[g], 1.3 * SIZE, marker="x", color=style.WARN, linewidths=1.3, zorder=5)


def _legend(figure: Any, data: ModuleData) -> None:
    shown = np.isin(data.explored, data.explored_axes())
    trusted, check = np.isin(data.status, TRUSTED), data.role == "check"

    def entry(label: str, marker: str, **look: Any) -> Line2D:
        return Line2D([], [], ls="", label=label, marker=marker, ms=5.5, **look)

    handles = [
        entry(f"to fit ({int(np.sum(shown & trusted & ~check))})", "o", color=style.SOFT),
        entry(
            f"check, never fitted ({int(np.sum(shown & trusted & check))})", "D", mfc="white", mec=style.SOFT
        ),
    ]
    if contact := int(np.sum(shown & ~trusted)):
        handles.append(entry(f"self-contact ({contact})", "x", color=style.WARN))
    if data.failed:
        handles.append(entry(f"failed ({len(data.failed)}), at the foot", "^", color=style.WARN))
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), handletextpad=0.3)
