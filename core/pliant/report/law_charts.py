"""Charts of a joint law τ(p, u) with the states to which it is fitted, and of the states alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pliant.formatting import actuation_unit, deformation_unit, effort_unit, number, percent, slides
from pliant.pipeline.reported_law import ReportedLaw, study_form_effort
from pliant.pipeline.run_folder import DesignResult, FinishedRun
from pliant.records.design import Array
from pliant.records.fem import TRUSTED, FemDataset, ModuleData
from pliant.records.law import FitReport, JointLaw
from pliant.report.chart import (
    Band,
    Chart,
    ChartAxis,
    ChartLine,
    ChartNote,
    ChartRule,
    Mark,
    Panel,
    finite_heights,
    padded,
    spread_labels,
    strokes,
)
from pliant.report.chart_colours import LEVEL_COLOURS, SERIES, SOFT, WARN, ColourScale
from pliant.report.document import Picture, numbered
from pliant.report.run_view import (
    actuation,
    main_axis,
    plotted_band,
    plotted_effort,
    study_form,
)

CURVES = 7  # levels that are drawn if the data have more
MANY = 400  # number of states above which dots are small
SAME = 1e-6  # share of the actuation range within which levels are equal
FALLBACK_ANGLE = 0.5  # rad, for a stated law without other bounds
POINTS = 121
LABEL_GAP = 0.045  # of the height, between the labels of levels
ZERO = ChartRule(0.0, SOFT, 0.9)


@dataclass(frozen=True, eq=False)
class Groups:
    """Masks of a data set's states: fitted, checked, not trusted."""

    fit: NDArray[np.bool_]
    check: NDArray[np.bool_]
    untrusted: NDArray[np.bool_]

    @staticmethod
    def from_data(data: FemDataset) -> Groups:
        """Return the masks; not trusted are self-overlaps that were not allowed, and every unknown status."""
        trusted = np.isin(data.status, TRUSTED)
        check = data.role == "check"
        return Groups(trusted & ~check, trusted & check, ~trusted)


def law_chart(run: FinishedRun, design: DesignResult) -> Chart:
    """Return the law's curves and its states; with states what the law, and the published form, miss of them."""
    panels = [law_panel(run, design)]
    if design.fem is not None and len(design.fem):
        panels.append(_missed_panel(design))
        panels += [_missed_panel(design, of_form=True)] if study_form(design) else []
    widths = (1.25, *[1.0] * (len(panels) - 1))
    return Chart(tuple(panels), cell=(1000 if len(panels) == 1 else 1760 // len(panels), 660), widths=widths)


def law_pictures(fitted: ReportedLaw, count: int = 0) -> list[Picture]:
    """Return the law with its band and states, one picture for each axis."""
    pictures = []
    for k, axis in enumerate(fitted.explored):
        form = {key: value for key, value in fitted.axis_details(axis).items() if key == "study_form"}
        scale = float(fitted.misses.ranges[fitted.law.axes.index(axis)])
        report = FitReport(fitted.report.n_fitted, fitted.report.n_heldout, 0.0, 0.0, 0.0, 0.0, scale, form)
        design = DesignResult(fitted.name, fitted.data.axis(axis), fitted.law, report, fitted.data)
        name = numbered("fit_law" if k == 0 else f"fit_law_{axis}", count)
        plain = FinishedRun({}, {}, (), (), ())
        pictures.append(Picture(name, _law_caption(fitted, axis), law_chart(plain, design)))
    return pictures


def _law_caption(fitted: ReportedLaw, axis: str) -> str:
    about = f"Axis {axis}, the others at zero on the curves. " if len(fitted.law.axes) > 1 else ""
    band = (
        "Shaded: the band that holds a state with a probability of 90 %, often thinner than the line; the same band "
        "stands as bars at the states left out. "
        if fitted.law.states_error
        else "This law states no error bar. "
    )
    form = fitted.axis_details(axis).get("study_form")
    below = " Below: the published form on the same states." if form else ""
    what = "force" if fitted.law.joint == "prismatic" else "moment"
    return (
        f"{about}τ is the external {what} that opposes actuation. {band}Right: law minus state; filled = fitted, open "
        f"= left out.{below}"
    )


def law_panel(run: FinishedRun, design: DesignResult) -> Panel:
    """Return τ over u, one curve per level of actuation, with the states as dots of the level's colour."""
    law, data = design.law, design.fem
    p_unit, u_unit, effort = actuation_unit(law.actuation_name), deformation_unit(law), effort_unit(law)
    levels, ends = curve_levels(run, design), angle_range(run, design)
    u, scale = np.linspace(*ends, POINTS), actuation_scale(law, levels)
    curves: list[Mark] = []
    last = []
    for level, colour in zip(levels.tolist(), scale.to_hex(levels * p_unit.factor), strict=True):
        at, name = np.full(len(u), level), p_unit.text(level, 3)
        tau = effort.factor * plotted_effort(design, at, u)
        curves.append(ChartLine("law", u * u_unit.factor, tau, name, colour, 1.5))
        if (half := plotted_band(design, at, u)) is not None:
            half = effort.factor * half
            curves.insert(
                0, Band("90 % band", u * u_unit.factor, tau - half, tau + half, name, f"{colour}38")
            )
        end = name if level == levels[-1] else number(level * p_unit.factor, 3)
        last.append((float(tau[-1]), end, colour, name))
    states = [] if data is None else state_lines(data, p_unit.text, scale, (u_unit.factor, effort.factor))
    low, high = padded(*_span(finite_heights([*curves, *states])))
    right, width = ends[1] * u_unit.factor, (ends[1] - ends[0]) * u_unit.factor
    heights = spread_labels([end for end, *_ in last], LABEL_GAP * (high - low), low)
    beside = right + 0.01 * width
    notes = [
        ChartNote(text, beside, float(height), colour=colour, run=name)
        for (_, text, colour, name), height in zip(last, heights, strict=True)
    ]
    axis = law.axes[main_axis(law, data.axis if data else "y")]
    x = plain_coordinate(law, u_unit.symbol, axis if len(law.axes) > 1 else "")
    x = replace(x, ends=(ends[0] * u_unit.factor - 0.03 * width, right + 0.14 * width))
    y = ChartAxis("effort τ", effort.symbol, ends=(low, high))
    source = "law and FEM states" if data is not None and data.design.family != "table" else "law and data"
    if data is None:
        source = "stated by its coefficients" if not law.states_error else "of an unseen design"
    return Panel(x, y, (ZERO, *curves, *states, *notes), f"Joint law τ(p, u): {source}")


def state_lines(
    data: FemDataset,
    text: Callable[[float, int], str],
    scale: ColourScale,
    factors: tuple[float, float],
    width: float = 0.0,
) -> list[ChartLine]:
    """Return the states of each actuation, fitted and held-out ones separately, joined by a line of this width.

    `factors`: from rad or m, and from N m or N, to the units of the panel.
    """
    groups, lines, dot = Groups.from_data(data), [], 2.0 if len(data) > MANY else 5.0
    kinds = (
        (f"fitted ({groups.fit.sum()})", groups.fit, width, "o"),
        (f"left out ({groups.check.sum()})", groups.check, 0.0, "D"),
        (f"in self-contact ({groups.untrusted.sum()})", groups.untrusted, 0.0, "x"),
    )
    levels = np.unique(data.actuation)
    unit = actuation_unit(data.actuation_name).factor
    for level, colour in zip(levels.tolist(), scale.to_hex(levels * unit), strict=True):
        for name, rows, thick, marker in kinds:
            mine = np.flatnonzero(rows & (data.actuation == level))
            mine = mine[np.argsort(data.angle_rad[mine], kind="stable")]
            if len(mine):
                x, y = data.angle_rad[mine] * factors[0], data.moment_n_m[mine] * factors[1]
                shade = WARN if marker == "x" else colour
                look = {"dot": dot, "marker": marker, "hollow": marker == "D"}
                lines.append(ChartLine(name, x, y, text(level, 3), shade, thick, **look))  # type: ignore[arg-type]
    return lines


def _missed_panel(design: DesignResult, of_form: bool = False) -> Panel:
    """Return law − state, or published form − state, in percent of the effort's range, over u."""
    data, fit, form = design.fem, design.fit, study_form(design) if of_form else None
    assert data is not None
    scale = fit.effort_range if fit else float(np.ptp(data.moment_n_m)) or 1.0
    half = None
    if form is not None:
        predicted = study_form_effort(form, data.actuation, data.angle_rad)
    else:
        predicted, half = _at_states(design, data)
    missed = 100 * (predicted - data.moment_n_m) / scale
    groups, u_unit = Groups.from_data(data), deformation_unit(design.law)
    x, dot = data.angle_rad * u_unit.factor, 2.0 if len(data) > MANY else 5.0
    marks: list[Mark] = [ZERO]
    if half is not None and groups.check.any():
        bars = 100 * half[groups.check] / scale
        ends = missed[groups.check] - bars, missed[groups.check] + bars
        marks.append(ChartLine("90 % band", *strokes(x[groups.check], *ends), "", f"{SERIES[1]}8c"))
    for name, rows, colour, marker in (
        (f"fitted ({groups.fit.sum()})", groups.fit, SERIES[0], "o"),
        (f"left out ({groups.check.sum()})", groups.check, SERIES[1], "D"),
    ):
        if rows.any():
            marks.append(ChartLine(name, x[rows], missed[rows], "", colour, 0.0, dot, marker, marker == "D"))
    rows, group = (groups.check, " left out") if groups.check.any() else (groups.fit, "")
    worst = float(np.abs(missed[rows]).max(initial=0.0)) or 1.0
    largest = float(np.abs(finite_heights(marks)).max(initial=worst))
    y = ChartAxis("difference", "% of effort range", ends=(-1.22 * largest, 1.22 * largest))
    name = "Study's form" if of_form else "Law"
    title = f"{name} − state, worst {percent(worst / 100)}{group}"
    return Panel(plain_coordinate(design.law, u_unit.symbol), y, tuple(marks), title)


def _at_states(design: DesignResult, data: FemDataset) -> tuple[Array, Array | None]:
    """Return τ and, if the law states an error, its 90 % band (n,) at the states, including their other axes."""
    module, law = design.module, design.law
    if module is None or len(law.axes) == 1:
        return plotted_effort(design, data.actuation, data.angle_rad), plotted_band(
            design, data.actuation, data.angle_rad
        )
    rows = module.explored == data.axis
    u = module.deformation[rows][:, [module.axes.index(axis) for axis in law.axes]]
    k = law.axes.index(data.axis)
    band = law.band(module.actuation[rows], u)
    return law.evaluate(module.actuation[rows], u).tau[:, k], None if band is None else band[:, k]


def _levels(actuation: Array) -> Array:
    """Return the distinct levels of actuation; nearly equal ones are merged."""
    found = np.unique(actuation)
    distance = np.diff(found, prepend=-np.inf)
    return np.asarray(found[distance > SAME * max(float(np.ptp(found)), np.finfo(float).tiny)])


def curve_levels(run: FinishedRun, design: DesignResult) -> Array:
    """Return the levels of actuation to draw: those of the data if they are few."""
    if design.fem is not None:
        groups = Groups.from_data(design.fem)
        chosen = ~groups.check if not groups.check.all() else groups.check
        grid = _levels(design.fem.actuation[chosen])
        if len(grid) <= CURVES:
            return np.asarray(grid)
        return np.linspace(float(grid[0]), float(grid[-1]), CURVES - 1)
    low, high = design.law.domain.actuation
    given = actuation(run)
    high = high if np.isfinite(high) else (given[1] if given else 1.0)
    low = low if np.isfinite(low) else min(0.0, high)
    return np.linspace(float(low), float(high), CURVES - 1)


def angle_range(run: FinishedRun, design: DesignResult) -> tuple[float, float]:
    """Return the range of u to draw: the data's, the stated domain, or that of the engines."""
    if design.fem is not None:
        trusted = ~Groups.from_data(design.fem).untrusted
        u = design.fem.angle_rad[trusted] if trusted.any() else design.fem.angle_rad
        return float(u.min()), float(u.max())
    axis = main_axis(design.law)
    low, high = (float(v) for v in design.law.domain.deformation[axis])
    used = [r.result.final.joint_angles[:, axis] for r in run.engines]
    largest = max((float(np.abs(u).max()) for u in used), default=FALLBACK_ANGLE) or FALLBACK_ANGLE
    return (low if np.isfinite(low) else -0.5 * largest), (high if np.isfinite(high) else 1.2 * largest)


def actuation_axis(data: ModuleData | FemDataset) -> ChartAxis:
    """Return the axis of the module's actuation."""
    word = "tendon force" if data.actuation_name == "tendon_force_n" else "pressure"
    return ChartAxis(word, actuation_unit(data.actuation_name).symbol)


def coordinate_axis(data: ModuleData | FemDataset, axis: str) -> ChartAxis:
    """Return the axis of a joint coordinate."""
    several = len(getattr(data, "axes", ())) > 1
    word = "extension u" if slides(data, axis) else "joint angle u"
    about = f" {'along' if slides(data, axis) else 'about'} {axis}" if several else ""
    return ChartAxis(word + about, deformation_unit(data, axis).symbol)


def plain_coordinate(module: JointLaw | ModuleData, symbol: str, axis: str = "") -> ChartAxis:
    word = "extension u" if module.joint == "prismatic" else "joint angle u"
    return ChartAxis(f"{word} about {axis}" if axis else word, symbol)


def actuation_scale(module: JointLaw | ModuleData, levels: Array) -> ColourScale:
    """Return the colours of levels of actuation, in its display unit."""
    unit = actuation_unit(module.actuation_name)
    word = "tendon force" if module.actuation_name == "tendon_force_n" else "pressure"
    ends = min(0.0, float(np.min(levels))) * unit.factor, (float(np.max(levels)) or 1.0) * unit.factor
    return ColourScale.even(word, unit.symbol, ends, LEVEL_COLOURS)


def _span(values: Array) -> tuple[float, float]:
    return float(values.min()), float(values.max())
