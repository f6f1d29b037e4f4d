"""Charts of a chain's pose, of a law with its states, and of the states alone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.colors import Normalize, to_hex

from pliant.formatting import actuation_unit, deformation_unit, display_unit, effort_unit
from pliant.records.design import Array
from pliant.records.fem import FemDataset, ModuleData
from pliant.report.chart import Band, Chart, ChartAxis, ChartLine, Panel
from pliant.report.figures import style
from pliant.report.figures.fem import Groups
from pliant.report.figures.finger import LEVELS, views
from pliant.report.figures.law import angle_range, curve_levels
from pliant.report.folder import DesignResult, FinishedRun
from pliant.report.run_view import band_of, history_levels, law_of, rest_markers


def pose_chart(run: FinishedRun) -> Chart:
    """A panel for each view of the chain."""
    unit = display_unit("m")
    levels = actuation_unit(run.designs[0].law.actuation_name)
    rest = rest_markers(run)
    panels = []
    for across, up in views(run):

        def line(points: Array, name: str, colour: str, width: float, dot: float, of: str = "") -> ChartLine:
            x, y = np.asarray(points)[:, [across, up]].T * unit.factor  # noqa: B023
            return ChartLine(name, x, y, of, colour, width, dot)

        lines = [] if rest is None else [line(rest, "at rest", "#9fa8b8", 2.4, 3.0)]
        for value, _, markers in history_levels(run.engines[0].result, LEVELS):
            lines.append(line(markers, "on the way", "#9cc3de", 1.1, 2.0, levels.text(value, 3)))
        for k, engine in enumerate(run.engines):
            lines.append(line(engine.markers_m, engine.kind, style.SERIES[k % 6], 2.6 if not k else 1.3, 6.0))
        axes = [ChartAxis("xyz"[k], unit.symbol) for k in (across, up)]
        title = f"{'xyz'[across]} and {'xyz'[up]} of the world"
        panels.append(Panel(axes[0], axes[1], tuple(lines), title=title, equal=True))
    return Chart(tuple(panels))


POINTS, DOT, OPEN = 121, 5.0, 4.0
CHECKED = style.SERIES[1]


def law_chart(run: FinishedRun, design: DesignResult) -> Chart:
    """A panel of the law's curves and its states, and one of law − state where there are states."""
    law, data = design.law, design.fem
    p_unit, u_unit, effort = actuation_unit(law.actuation_name), deformation_unit(law), effort_unit(law)
    x, y = _coordinate(law.joint, u_unit.symbol), ChartAxis("effort", effort.symbol)
    levels = curve_levels(run, design)
    u = np.linspace(*angle_range(run, design), POINTS)
    colours = _colours(levels)
    lines: list[ChartLine] = []
    bands: list[Band] = []
    for level, colour in zip(levels, colours, strict=True):
        at, name = np.full(len(u), level), p_unit.text(float(level), 3)
        tau = effort.factor * law_of(design, at, u)
        lines.append(ChartLine("law", u * u_unit.factor, tau, name, colour, 1.5))
        if (half := band_of(design, at, u)) is not None:
            half = effort.factor * half
            bands.append(Band("90 % band", u * u_unit.factor, tau - half, tau + half, name, f"{colour}38"))
    if data is not None:
        lines += _states(data, p_unit.text, colours_of(data, levels), u_unit.factor, effort.factor)
    panels = [Panel(x, y, tuple(lines), tuple(bands), "Joint law τ(p, u)", zero=style.SOFT)]
    if data is not None and len(data) and len(law.axes) == 1:
        panels.append(_missed(design, data, x, u_unit.factor))
    return Chart(tuple(panels))


def states_chart(data: ModuleData) -> Chart:
    """The free branch, then τ over u of every explored axis, one run per level of actuation."""
    main = data.axis(data.main_axis)
    p_unit, u_unit, effort = actuation_unit(data.actuation_name), deformation_unit(data), effort_unit(data)
    word = "tendon force" if data.actuation_name == "tendon_force_n" else "pressure"
    free = main.rows(main.branch == "free")
    order = np.argsort(free.actuation, kind="stable")
    p, u = free.actuation[order] * p_unit.factor, free.angle_rad[order] * u_unit.factor
    x = _coordinate(data.joint, u_unit.symbol)
    panels = [
        Panel(
            ChartAxis(word, p_unit.symbol),
            x,
            (ChartLine("free branch", p, u, colour=style.SERIES[0], dot=DOT),),
            title="Free branch",
            below="nothing holds the module",
        )
    ]
    for name in data.explored_axes():
        one = data.axis(name)
        lines = _states(one, p_unit.text, colours_of(one, one.actuation), u_unit.factor, effort.factor, 0.8)
        title = f"Held about {name}" if len(data.axes) > 1 else "Held"
        panels.append(
            Panel(x, ChartAxis("effort", effort.symbol), tuple(lines), title=title, zero=style.SOFT)
        )
    return Chart(tuple(panels))


def colours_of(data: FemDataset, levels: Array) -> dict[float, str]:
    """A colour for every actuation of the states, on the scale of these levels."""
    known = np.unique(data.actuation)
    return dict(zip(known.tolist(), _colours(known, levels), strict=True))


def _colours(values: Array, scale: Array | None = None) -> list[str]:
    of = values if scale is None else scale
    norm, shades = Normalize(float(np.min(of)), float(np.max(of)) or 1.0), style.pressure_map()
    return [to_hex(shades(float(norm(value)))) for value in values]


def _coordinate(joint: str, symbol: str) -> ChartAxis:
    return ChartAxis("extension" if joint == "prismatic" else "joint angle", symbol)


def _states(
    data: FemDataset,
    text: Callable[[float, int], str],
    colours: dict[float, str],
    u_factor: float,
    effort: float,
    width: float = 0.0,
) -> list[ChartLine]:
    """States of each actuation, those to fit and those left out apart; joined by a line where it has a width."""
    groups, lines = Groups.of(data), []
    kinds = (("states", groups.fit, width, DOT), ("states left out", groups.check, 0.0, OPEN))
    for level in np.unique(data.actuation):
        for name, rows, thick, dot in (*kinds, ("in self-contact", groups.untrusted, 0.0, OPEN)):
            mine = np.flatnonzero(rows & (data.actuation == level))
            mine = mine[np.argsort(data.angle_rad[mine], kind="stable")]
            if len(mine):
                at, tau = data.angle_rad[mine] * u_factor, data.moment_n_m[mine] * effort
                colour = style.WARN if name == "in self-contact" else colours[float(level)]
                lines.append(ChartLine(name, at, tau, text(float(level), 3), colour, thick, dot))
    return lines


def _missed(design: DesignResult, data: FemDataset, x: ChartAxis, u_factor: float) -> Panel:
    scale = design.fit.effort_range if design.fit else float(np.ptp(data.moment_n_m)) or 1.0
    missed = 100.0 * (law_of(design, data.actuation, data.angle_rad) - data.moment_n_m) / scale
    groups, at = Groups.of(data), data.angle_rad * u_factor
    lines = tuple(
        ChartLine(name, at[rows], missed[rows], colour=colour, width=0.0, dot=DOT)
        for name, rows, colour in (
            ("law − state", groups.fit, style.SERIES[0]),
            ("law − state left out", groups.check, CHECKED),
        )
        if rows.any()
    )
    return Panel(
        x, ChartAxis("law − state", "% of effort range"), lines, title="What it misses", zero=style.SOFT
    )
