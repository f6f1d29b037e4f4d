"""The joint law τ(p, u) with the states it comes from, and what it misses of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.colors import Normalize

from pliant.formatting import actuation_unit, deformation_unit, effort_unit, number, percent
from pliant.records.design import Array
from pliant.records.fem import FemDataset
from pliant.records.law import JointLaw
from pliant.report.figures import style
from pliant.report.figures.fem import Groups, state_points
from pliant.report.folder import DesignResult, FinishedRun
from pliant.report.run_view import actuation, band_of, law_of, main_axis, study_form, study_form_effort

CURVES = 7  # levels that are drawn where the data have more
MANY = 400  # states beyond which points are drawn small
SAME = 1e-6  # of the range of actuation: one level
FALLBACK_ANGLE = 0.5  # rad, where nothing else bounds a stated law


def law_picture(run: FinishedRun, design: DesignResult) -> style.Png:
    """Curves and states on the left; residuals of the law and of the study's form on the right."""
    wide = design.fem is not None
    with style.canvas(1560 if wide else 1000, 720, wspace=0.04) as figure:
        if not wide:
            draw_law(figure.subplots(), run, design)
        else:
            axes: dict[str, Any] = figure.subplot_mosaic(
                [["law", "fitted"], ["law", "study"]] if study_form(design) else [["law", "fitted"]],
                width_ratios=[1.25, 1],
            )
            draw_law(axes["law"], run, design)
            draw_residuals(axes["fitted"], design)
            if study_form(design):
                draw_residuals(axes["study"], design, of_study=True)
        return style.png(figure)


def draw_law(axes: Any, run: FinishedRun, design: DesignResult, compact: bool = False) -> None:
    """τ over u, one curve per level of actuation, with the states as points of the level's colour."""
    law, data = design.law, design.fem
    p_unit, u_unit = actuation_unit(law.actuation_name), deformation_unit(law)
    effort = effort_unit(law)
    levels, (low, high) = curve_levels(run, design), angle_range(run, design)
    u = np.linspace(low, high, 201)
    colours, norm = style.pressure_map(), Normalize(float(levels.min()), float(levels.max()) or 1.0)
    axes.axhline(0, color=style.SOFT, lw=0.9, zorder=1)
    ends = []
    for level in levels:
        tau = effort.factor * law_of(design, np.full(len(u), level), u)
        axes.plot(u * u_unit.factor, tau, color=colours(norm(level)), lw=1.5, zorder=2)
        if (half := band_of(design, np.full(len(u), level), u)) is not None:
            half, look = effort.factor * half, {"color": colours(norm(level)), "alpha": 0.22, "lw": 0}
            axes.fill_between(u * u_unit.factor, tau - half, tau + half, zorder=1.5, **look)
        ends.append(float(tau[-1]))
    if data is not None:
        x, y = data.angle_rad * u_unit.factor, data.moment_n_m * effort.factor
        state_points(axes, data, x, y, norm, len(data) > MANY)
    axes.margins(x=0.03)
    left, right = axes.get_xlim()
    axes.set_xlim(left, right + (0.15 if compact else 0.1) * (right - left))
    labels = [number(level * p_unit.factor, 3) for level in levels]
    labels[-1] += f" {p_unit.symbol}"
    for label, level, end, place in zip(labels, levels, ends, _apart(ends, axes.get_ylim()), strict=True):
        at, beside = (high * u_unit.factor, end), (high * u_unit.factor + 0.02 * (right - left), place)
        look = {"ha": "left", "va": "center", "fontsize": 8, "color": colours(norm(level))}
        axes.annotate(label, at, beside, textcoords="data", **look)
    axis = law.axes[main_axis(law, data.axis if data else "y")]
    about = f" about {axis}" if len(law.axes) > 1 else ""
    axes.set(
        xlabel=f"{_symbol(law)} $u${about} ({u_unit.symbol})", ylabel=rf"effort $\tau$ ({effort.symbol})"
    )
    style.with_math(axes)
    source = "law and FEM states" if data is not None and data.design.family != "table" else "law and data"
    if data is None:
        source = "stated by its coefficients" if law.error is None else "of an unseen design"
    axes.set_title("Joint law τ(p, u)" if compact else f"Joint law τ(p, u): {source}")
    _legend(axes, data)


def _symbol(law: JointLaw) -> str:
    return "extension" if law.joint == "prismatic" else "joint angle"


def draw_residuals(axes: Any, design: DesignResult, of_study: bool = False) -> None:
    """Law − state in percent of the effort's range, over u."""
    data, fit = design.fem, design.fit
    assert data is not None
    scale = fit.effort_range if fit else float(np.ptp(data.moment_n_m)) or 1.0
    form, half = study_form(design) if of_study else None, None
    if form is not None:
        predicted = study_form_effort(form, data.actuation, data.angle_rad)
    else:
        predicted, half = _at_states(design, data)
    missed = 100 * (predicted - data.moment_n_m) / scale
    groups, u_unit = Groups.of(data), deformation_unit(design.law)
    many, fitted, check = len(data) > MANY, groups.fit, groups.check
    size, dot, kite = 4 if many else 26, style.SERIES[0], style.SERIES[1]
    axes.axhline(0, color=style.SOFT, lw=0.9, zorder=1)
    x = data.angle_rad * u_unit.factor
    axes.scatter(x[fitted], missed[fitted], size, color=dot, linewidths=0, zorder=3)
    look = {"facecolor": "white", "edgecolor": kite, "linewidths": 0.6 if many else 1.2, "zorder": 4}
    axes.scatter(x[check], missed[check], 1.3 * size, marker="D", **look)
    worst = largest = float(np.abs(missed[fitted | check]).max(initial=0.0)) or 1.0
    if half is not None and check.any():
        bars = 100 * half[check] / scale
        look = {"ecolor": kite, "elinewidth": 1.0, "alpha": 0.55, "zorder": 2}
        axes.errorbar(x[check], missed[check], bars, fmt="none", **look)
        largest = max(largest, float(np.max(np.abs(missed[check]) + bars)))
    axes.set_ylim(-1.22 * largest, 1.22 * largest)
    axes.yaxis.set_major_formatter(lambda value, _: number(float(value), 2))
    axes.set(xlabel=f"{_symbol(design.law)} $u$ ({u_unit.symbol})", ylabel="% of effort range")
    style.with_math(axes)
    name, of = "Study's form − state" if of_study else "Law − state", ""
    if check.any():
        worst, of = float(np.abs(missed[check]).max()), " left out"
    axes.set_title(f"{name}, worst {percent(worst / 100)}{of}")


def _at_states(design: DesignResult, data: FemDataset) -> tuple[Array, Array | None]:
    """τ and, where the law states an error, its 90 % band (n,) at the states, the other axes where they were."""
    module, law = design.module, design.law
    if module is None or len(law.axes) == 1:
        return law_of(design, data.actuation, data.angle_rad), band_of(design, data.actuation, data.angle_rad)
    rows = module.explored == data.axis
    u = module.deformation[rows][:, [module.axes.index(axis) for axis in law.axes]]
    k = law.axes.index(data.axis)
    band = law.band(module.actuation[rows], u)
    return law.evaluate(module.actuation[rows], u).tau[:, k], None if band is None else band[:, k]


def _apart(heights: Sequence[float], limits: tuple[float, float]) -> Array:
    """Heights of labels, moved as little as needed to stand a line of text apart."""
    gap = 0.042 * (limits[1] - limits[0])
    order = np.argsort(heights, kind="stable")
    places = np.array(heights, float)[order]
    for _ in range(200):
        for k in range(len(places) - 1):
            short = gap - (places[k + 1] - places[k])
            if short > 1e-9:
                places[k] -= short / 2
                places[k + 1] += short / 2
    if len(places):
        places += max(limits[0] + gap / 2 - places[0], 0.0)
    result = np.empty_like(places)
    result[order] = places
    return result


def _levels(actuation: Array) -> Array:
    """Levels of actuation, each once: nearly equal ones are one."""
    found = np.unique(actuation)
    apart = np.diff(found, prepend=-np.inf) > SAME * max(float(np.ptp(found)), np.finfo(float).tiny)
    return np.asarray(found[apart])


def curve_levels(run: FinishedRun, design: DesignResult) -> Array:
    """Levels of actuation to draw: those of the data if they are few."""
    if design.fem is not None:
        groups = Groups.of(design.fem)
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
    """Range of u to draw: the data's, the stated domain, or what the engines used."""
    if design.fem is not None:
        trusted = ~Groups.of(design.fem).untrusted
        u = design.fem.angle_rad[trusted] if trusted.any() else design.fem.angle_rad
        return float(u.min()), float(u.max())
    axis = main_axis(design.law)
    low, high = (float(v) for v in design.law.domain.deformation[axis])
    used = [r.result.final.joint_angles[:, axis] for r in run.engines]
    largest = max((float(np.abs(u).max()) for u in used), default=FALLBACK_ANGLE) or FALLBACK_ANGLE
    return (low if np.isfinite(low) else -0.5 * largest), (high if np.isfinite(high) else 1.2 * largest)


def _legend(axes: Any, data: FemDataset | None) -> None:
    if data is None:
        return
    groups = Groups.of(data)
    handles = [style.entry(f"fitted ({groups.fit.sum()})", "o", color=style.SOFT, ms=5)]
    if groups.check.any():
        label = f"left out ({groups.check.sum()})"
        handles.append(style.entry(label, "D", mfc="white", mec=style.SOFT, ms=5))
    if groups.untrusted.any():
        label = f"in self-contact ({groups.untrusted.sum()})"
        handles.append(style.entry(label, "x", color=style.WARN, ms=5.5))
    axes.legend(handles=handles, loc="upper right", handletextpad=0.3)
