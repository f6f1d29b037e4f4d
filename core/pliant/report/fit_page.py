"""The page of fitted laws: each law with its band, its errors, their places, learning, slopes and cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from pliant.formatting import effort_unit, number
from pliant.records.law import FitReport
from pliant.report.document import Drawn, Picture, Section, Table, numbered, page_table
from pliant.report.figures.error_bars import coverage_picture
from pliant.report.figures.law import law_picture
from pliant.report.figures.law_errors import residual_map, slope_map, surrogate_bars
from pliant.report.figures.learning import learning_picture, state_curves
from pliant.report.fit_tables import (
    SURROGATES,
    axes_table,
    choice_table,
    cost_table,
    coverage_table,
    errors_table,
    learning_table,
    settings_table,
)
from pliant.report.fit_view import Fitted
from pliant.report.folder import DesignResult, FinishedRun
from pliant.report.provenance import Manifests, closing_sections

MARK = 1e-4  # of the range: what the learning curve marks


def fit_drawn(
    fitted: Sequence[Fitted],
    compared: Sequence[Fitted],
    study: Mapping[str, Any],
    manifests: Manifests,
    several: bool,
) -> Drawn:
    """The first law on top; then all of `fitted`, named where they are `several`, those `compared` side by side."""
    hero, *others = law_pictures(fitted[0])
    sections = [Section("The law about the other axes", tuple(others))] if others else []
    if (beside := comparison_section(compared)) is not None:
        sections.append(beside)
    for count, one in enumerate(fitted):
        prefix = f"{one.name}: " if several else ""
        if count:
            sections.append(Section(f"{prefix}the law", tuple(law_pictures(one, count))))
        sections += of_one(one, count, prefix)
    return Drawn(hero, (*sections, *closing_sections(study, manifests)))


def law_pictures(fitted: Fitted, count: int = 0) -> list[Picture]:
    """The law with its band and states, one picture for each axis."""
    pictures = []
    run = FinishedRun({}, {}, (), (), ())
    for k, axis in enumerate(fitted.explored):
        data = fitted.data.axis(axis)
        form = {key: value for key, value in fitted.axis_details(axis).items() if key == "study_form"}
        scale = float(fitted.misses.ranges[fitted.law.axes.index(axis)])
        report = FitReport(fitted.report.n_fitted, fitted.report.n_heldout, 0.0, 0.0, 0.0, 0.0, scale, form)
        design = DesignResult(fitted.name, data, fitted.law, report, fitted.data)
        name = numbered("fit_law" if k == 0 else f"fit_law_{axis}", count)
        pictures.append(Picture(name, _law_caption(fitted, axis), law_picture(run, design)))
    return pictures


def _law_caption(fitted: Fitted, axis: str) -> str:
    about = f"Axis {axis}, the others at zero on the curves. " if len(fitted.law.axes) > 1 else ""
    band = (
        "Shaded: the band that holds a state with a probability of 90 %, often thinner than the line; the same band "
        "stands as bars at the states left out. "
        if fitted.law.error is not None
        else "This law states no error bar. "
    )
    beside = (
        " Below: the study's form on the same states." if fitted.axis_details(axis).get("study_form") else ""
    )
    what = "force" if fitted.law.joint == "prismatic" else "moment"
    return (
        f"{about}τ is the external {what} that opposes actuation. {band}Right: law minus state; filled = fitted, open "
        f"= left out.{beside}"
    )


def error_section(fitted: Fitted) -> Section:
    """Errors beside the study's forms, and what the fit chose."""
    tables: list[Table | None] = [
        errors_table(fitted),
        axes_table(fitted.data, fitted.law, fitted.ranges),
    ]
    each = fitted.explored if isinstance(fitted.report.details.get("axes"), dict) else fitted.explored[:1]
    tables += [choice_table(fitted, axis) for axis in each]
    tables.append(settings_table(fitted))
    return Section("Errors, and what the fit chose", tables=tuple(t for t in tables if t is not None))


def map_section(fitted: Fitted, count: int = 0) -> Section:
    """Where the errors are."""
    caption = (
        "Each state by its error, a share of the range of its axis' effort, all panels on one logarithmic scale of "
        "colours."
    )
    if fitted.study_misses:
        caption += " Beside the law: the form of the published study, fitted to the same states."
    return Section(
        "Where the law misses", (Picture(numbered("fit_map", count), caption, residual_map(fitted)),)
    )


def bar_section(fitted: Fitted, count: int = 0) -> Section | None:
    """Whether the error bars hold; None for a law without them."""
    curves = fitted.coverage
    if not curves:
        return None
    caption = (
        "Left: share of the states left out inside bands of each stated level; honest bars follow the diagonal within "
        "what chance does with so few states (grey). Right: each state's miss against the half-width of its own band."
    )
    picture = Picture(numbered("fit_bars", count), caption, coverage_picture(curves))
    table = coverage_table(curves)
    return Section("Are the error bars honest?", (picture,), (table,) if table else ())


def learning_section(fitted: Fitted, count: int = 0) -> Section | None:
    """Error against the number of states; None where it was not asked for or nothing could be fitted."""
    learning = fitted.learning
    if learning is None or not learning["points"]:
        return None
    caption = (
        "The surrogate fitted again to nested subsets of the states, with exact slopes and with values alone, and "
        f"scored on the same {learning['n_check']} check states."
    )
    picture = learning_picture(
        {"Error by number of states": state_curves(learning)},
        "states fitted", "error on check states (% of the effort's range)", MARK,
    )  # fmt: skip
    shown = Picture(numbered("fit_learning", count), caption, picture)
    return Section("How many states it takes", (shown,), (learning_table(learning),))


def slope_section(fitted: Fitted, count: int = 0) -> Section:
    """∂τ/∂u over the box."""
    effort = effort_unit(fitted.law)
    per = "m" if fitted.law.joint == "prismatic" else "rad"
    largest = fitted.least_stable
    shown = f"{number(effort.factor * largest, 3)} {effort.symbol}/{per}"
    verdict = (
        f"Stable over the whole box: the largest ∂τ/∂u is {shown}, below zero."
        if largest < 0
        else f"UNSTABLE somewhere in the box: ∂τ/∂u reaches {shown}, and a joint may snap there."
    )
    if len(fitted.law.axes) > 1:
        verdict += " It is the largest eigenvalue of the symmetric part, over random places of the box."
    caption = "∂τ/∂u over the law's box; the ring marks where the joint is softest."
    if len(fitted.law.axes) > 1:
        caption += " Each axis with the others at zero."
    pictures = (Picture(numbered("fit_slopes", count), caption, slope_map(fitted)),)
    return Section("Slopes: where the joint is soft", pictures, text=(verdict,))


def cost_section(fitted: Fitted) -> Section:
    """FEM, fit, evaluation."""
    return Section("Cost", tables=(cost_table(fitted),))


def comparison_section(fitted: Sequence[Fitted]) -> Section | None:
    """Several surrogates on the same states; None for one."""
    if len(fitted) < 2:
        return None
    caption = (
        "The same states for all; shorter bars are better for errors and times, longer ones for evaluations."
    )
    picture = Picture("fit_surrogates", caption, surrogate_bars(fitted))
    return Section(
        "Surrogates side by side", (picture,), (page_table("Surrogates side by side", SURROGATES, fitted),)
    )


def of_one(fitted: Fitted, count: int = 0, prefix: str = "") -> list[Section]:
    """All sections of one law, their titles led by `prefix` where there are several."""
    sections = [
        error_section(fitted),
        map_section(fitted, count),
        bar_section(fitted, count),
        learning_section(fitted, count),
        slope_section(fitted, count),
        cost_section(fitted),
    ]
    return [replace(s, title=f"{prefix}{s.title}") for s in sections if s is not None]
