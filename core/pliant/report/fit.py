"""Fitted laws as a document: errors on held-out states, error bars, limits; for terminal, page and JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pliant.formatting import (
    Unit,
    actuation_unit,
    deformation_unit,
    effort_unit,
    listed,
    number,
    percent,
    units_footer,
)
from pliant.mechanics.one_input import first_input_law
from pliant.pipeline.reported_law import ReportedLaw, unstable_places
from pliant.pipeline.run_folder import DesignResult, FinishedRun
from pliant.pipeline.segments import DesignStages
from pliant.pipeline.workbench import RunContext
from pliant.records.design import Array
from pliant.report.chart import ChartAxis
from pliant.report.document import (
    Document,
    Drawn,
    Picture,
    Section,
    Table,
    Warned,
    answers,
    as_json,
    brief_table,
    capital,
    drawn,
    numbered,
    page_table,
    section,
)
from pliant.report.fem import data_warnings
from pliant.report.fit_page import (
    SURROGATES,
    axes_table,
    choice_table,
    cost_table,
    coverage_chart,
    coverage_table,
    errors_table,
    residual_chart,
    settings_table,
    slope_chart,
    slope_unit,
    surrogates_chart,
)
from pliant.report.law_charts import law_chart, law_pictures
from pliant.report.learning_chart import learning_chart, learning_table, state_curves
from pliant.report.provenance import Manifests, closing_sections, duration, made_by, stage_json
from pliant.report.stage import StoredPage
from pliant.report.unseen_law import meta_law_json, meta_law_lines
from pliant.units import split_unit

PAGE = "fit.html"
SHOWN = 4  # laws that are drawn in full
LEVEL = 0.9
MARK = 1e-4  # of the range: the mark in the learning curve
UNSTABLE_LAW = (
    "the law is unstable (∂τ/∂u ≥ 0) somewhere in its domain, so a joint may snap. In a table from elsewhere, "
    "moment_n_m must be the external moment that opposes actuation (is the sign reversed?)."
)


def fit_document(
    title: str,
    fitted: Sequence[ReportedLaw],
    study: Mapping[str, Any],
    data: Mapping[str, Any],
    brief: Sequence[Table | str],
    compared: Sequence[ReportedLaw] = (),
) -> Document:
    """Return the document of laws.

    Args:
        title: of the page.
        fitted: the laws, one for each design; empty if all are stated by their coefficients.
        study: inputs to list.
        data: the JSON result.
        brief: tables and lines that a terminal prints before the sentence.
        compared: surrogates fitted to the states of the first design, side by side; one of them may be that law.
    """
    several = len(fitted) > 1
    manifests = _manifests(fitted, compared)

    limits = tuple(w for one in fitted for w in fit_warnings(one, several))
    return Document(
        kind="Pliant fit",
        title=title,
        sentence=" ".join(fit_sentence(one, several) for one in fitted[:SHOWN]),
        data=data,
        brief=tuple(brief),
        answers=_answers(fitted[0], limits),
        warnings=limits,
        draw=lambda: fit_drawn(fitted[:SHOWN], compared, study, manifests, several),
        footer=units_footer(pressures="Pa", forces="N", moments="N*m", angles="rad", extensions="m"),
        page=PAGE,
        version=made_by(manifests),
    )


def laws_document(
    title: str, designs: Sequence[DesignStages], fitted: Sequence[ReportedLaw], study: Mapping[str, Any]
) -> Document:
    """Return the document of a study's laws, one for each of its designs; see `fitted_designs`."""
    results = [law_json(design) for design in designs]
    data = results[0] if len(results) == 1 else {"designs": results}
    return fit_document(title, fitted, study, data, [line for d in designs for line in law_lines(d)])


def table_document(
    source: Path, stages: DesignStages, fitted: Sequence[ReportedLaw], problems: Mapping[str, str]
) -> Document:
    """Return the document of a law from a table of states.

    Args:
        source: the table.
        stages: of its law.
        fitted: that law, then other surrogates on the same states for a comparison.
        problems: reasons why surrogates could not be fitted, by kind.
    """
    first, compared = fitted[0], fitted if len(fitted) > 1 or problems else ()
    half = first.coverage[0].half_width * first.coverage[0].effort_range if first.coverage else None
    band = {
        "level": LEVEL,
        "covered": first.coverage[0].at(LEVEL) if first.coverage else None,
        "median_half_width": float(np.median(half)) if half is not None else None,
    }
    data: dict[str, Any] = {
        "data": str(source),
        **law_json(stages),
        "band": band,
        "unstable": unstable_places(first.law),
    }
    brief: list[Table | str] = [*_table_lines(source, first), *law_lines(stages), *_band_lines(first, band)]
    if compared:
        brief += ["", brief_table(SURROGATES, compared)]
        brief += [f"{kind}: {problem}" for kind, problem in problems.items()]
        data["compared"] = {one.name: as_json(SURROGATES, one) for one in compared}
        data["compared"] |= {kind: {"problem": problem} for kind, problem in problems.items()}
    assert first.config is not None
    inputs = {"name": source.stem, "surrogate": first.config.canonical()}
    return fit_document(source.stem, fitted[:1], inputs, data, brief, compared if len(compared) > 1 else ())


def stored_fit_page(
    context: RunContext,
    document: Document,
    fitted: Sequence[ReportedLaw],
    study: Mapping[str, Any],
    compared: Sequence[ReportedLaw] = (),
) -> StoredPage:
    """Return the page of laws with the data that it depends on."""
    every = [*fitted, *compared]
    config = {
        "title": document.title,
        "study": dict(study),
        "names": [[one.name, one.source] for one in every],
        "pieces": len(fitted),
    }
    components = [context.component("surrogate", one.config) for one in every if one.config is not None]
    return StoredPage(context, _manifests(fitted, compared), components, "pliant.report.fit", config)


def _manifests(fitted: Sequence[ReportedLaw], compared: Sequence[ReportedLaw]) -> list[Mapping[str, Any]]:
    return [a.manifest for one in (*fitted, *compared) for a in one.artifacts]


def fit_sentence(fitted: ReportedLaw, named: bool = False) -> str:
    """Return a sentence: worst error on held-out states, that of the published form, coverage."""
    report = fitted.report
    parts = [
        f"the law is within {percent(report.worst_of_range)} of {fitted.source} on {report.n_heldout} states "
        f"left out ({report.n_fitted} fitted)"
    ]
    beside = list(fitted.study_misses.values())
    if beside and report.details.get("form") != "study":
        worst = beside[0].rows(beside[0].check).worst
        parts.append(f"the published form misses the same states by up to {percent(worst)}")
    if fitted.coverage:
        every = fitted.coverage[0]
        parts.append(f"the law's 90 % band holds {round(every.n * every.at(LEVEL))} of {every.n}")
    text = "; ".join(parts) + "."
    return f"{fitted.name}: {text}" if named else capital(text)


def _answers(fitted: ReportedLaw, limits: Sequence[Warned]) -> tuple[tuple[str, str], ...]:
    """Return the answers: error, the gravest limit, coverage of the error bar."""
    report, sure = fitted.report, "The law states no error bar."
    if fitted.coverage:
        every = fitted.coverage[0]
        sure = f"The law's 90 % band holds {round(every.n * every.at(LEVEL))} of {every.n} states left out."
    return answers(
        f"Within {percent(report.worst_of_range)} of {fitted.source} on {report.n_heldout} states left out.",
        limits[0].sentence if limits else "",
        sure,
        "Put modules into a chain: pliant simulate.",
    )


def fit_warnings(fitted: ReportedLaw, named: bool = False) -> list[Warned]:
    """Return the limits of the law: instability, missing bars, limits of the states."""
    prefix = f"{fitted.name}: " if named else ""
    found = []
    if fitted.least_stable >= 0 or fitted.report.details.get("stable") is False:
        found.append(Warned(prefix + UNSTABLE_LAW if named else capital(UNSTABLE_LAW)))
    if not fitted.law.states_error:
        found.append(Warned(capital(f"{prefix}the law states no error bar.")))
    return found + data_warnings(fitted.data, prefix)


def law_json(design: DesignStages) -> dict[str, Any]:
    """Return the `fit` result of one design."""
    law, report = design.law.law, design.law.report
    record = law.record()
    result: dict[str, Any] = {
        "kind": record.kind,
        "parameters": {**record.values, **record.arrays},
        "domain": {"actuation": law.domain.actuation, "deformation": law.domain.deformation},
        "wall_s": design.law.artifact.manifest["wall_s"] if design.law.artifact else 0.0,
    }
    if report is not None:
        scores = {key: getattr(report, key) for key in ("rmse", "worst", "worst_of_range", "r2")}
        result["heldout"] = {**scores, "n": report.n_heldout}
        result["n_fitted"] = report.n_fitted
        result["study_form"] = report.details.get("study_form")
        result["stable"] = report.details.get("stable")
        if "meta_model" in report.details:
            result |= meta_law_json(report.details)
        result["stated_axes"] = report.details.get("stated_axes", [])
    if design.law.artifact is not None:
        result["stages"] = [stage_json(design.law.artifact)]
    return result


def law_lines(design: DesignStages) -> list[str]:
    """Return a law's errors, for the terminal."""
    report = design.law.report
    if report is None or design.law.artifact is None:
        return ["law      stated by its coefficients"]
    if "meta_model" in report.details:
        return meta_law_lines(report)
    r2 = f"R² {report.r2:.7g}, " if math.isfinite(report.r2) else ""
    lines = [
        f"law      worst error {percent(report.worst_of_range)} of the range on {report.n_heldout} states left out "
        f"({report.n_fitted} fitted), {r2}{duration(design.law.artifact)}"
    ]
    if stated := report.details.get("stated_axes"):
        lines.append(f"         stated, not fitted: axis {listed(stated)}")
    study_form = report.details.get("study_form")
    if study_form and "worst_of_range" in study_form:
        lines.append(f"         the published form: {percent(study_form['worst_of_range'])}")
    return lines


def _table_lines(source: Path, fitted: ReportedLaw) -> list[str]:
    """Return size and range of a table's states."""
    law, report = fitted.law, fitted.report
    count = report.n_fitted + report.n_heldout
    sides = law.domain.actuation.reshape(-1, 2)
    spans = [
        f"{split_unit(name)[0].replace('_', ' ')} {_span(side, actuation_unit(name))}"
        for name, side in zip(law.actuations, sides, strict=True)
    ]
    lines = [f"table    {source}: {count} states, {listed(spans)}"]
    for axis, sides in zip(law.axes, law.domain.deformation, strict=True):
        lines.append(f"         {axis}: u from {_span(sides, deformation_unit(law, axis))}")
    return lines


def _span(sides: Array, unit: Unit) -> str:
    """Return both ends of a range with three digits: −13 to 31.2°."""
    low, high = (number(float(side) * unit.factor, 3) for side in sides)
    return unit.attached(f"{low} to {high}")


def _band_lines(fitted: ReportedLaw, band: Mapping[str, Any]) -> list[str]:
    """Return the error bar of a table's law, its stability, and states that were left out."""
    law, effort = fitted.law, effort_unit(fitted.law)
    if band["covered"] is None:
        lines = ["band     this law states none"]
    else:
        half = band["median_half_width"]
        lines = [
            f"band     90 %: ± {effort.text(half, 2)} ({percent(half / fitted.report.effort_range)} of the range) at "
            f"the median of the states left out; {100 * band['covered']:.0f} % of them lie in it"
        ]
    given, u, slope = actuation_unit(law.actuation_name), deformation_unit(law), slope_unit(law)
    largest = fitted.report.details.get("largest_slope")
    if len(law.actuations) > 1 and isinstance(largest, float) and largest >= 0:
        lines.append(f"unstable ∂τ/∂u reaches {slope.factor * largest:+.2g} {slope.symbol} in the domain")
        return lines + _left_out(fitted)
    lines += [
        f"unstable axis {one['axis']}: ∂τ/∂u = {slope.factor * one['slope']:+.2g} {slope.symbol} at "
        f"{given.text(one['actuation'])}, {u.text(one['deformation'])}"
        for one in unstable_places(law)
    ] or ["stable   the effort falls with u everywhere in the domain"]
    return lines + _left_out(fitted)


def _left_out(fitted: ReportedLaw) -> list[str]:
    """Return the states that were left out, and the reason."""
    excluded = fitted.report.details.get("excluded") or {}
    return [f"left out {count} states: {reason}" for reason, count in excluded.items()]


def fit_drawn(
    fitted: Sequence[ReportedLaw],
    compared: Sequence[ReportedLaw],
    study: Mapping[str, Any],
    manifests: Manifests,
    several: bool,
) -> Drawn:
    """Return a page of the first law, then all of `fitted`, named if `several`, and those `compared` together."""
    if len(fitted[0].law.actuations) > 1:  # pictures are over one actuation: the first, the others at zero
        design = DesignResult(fitted[0].name, None, first_input_law(fitted[0].law), None, None)
        plain = FinishedRun({}, {}, (), (), ())
        caption = f"The law under {design.law.actuation_name} alone, the other inputs at zero."
        return drawn(
            Picture("fit_law", caption, law_chart(plain, design)), *closing_sections(study, manifests)
        )
    hero, *others = law_pictures(fitted[0])
    sections = [section("The law about the other axes", *others), comparison_section(compared)]
    for count, one in enumerate(fitted):
        prefix = f"{one.name}: " if several else ""
        own = section("the law", *law_pictures(one, count)) if count else None
        every = (own, *law_sections(one, count))
        sections += [replace(s, title=f"{prefix}{s.title}") for s in every if s is not None]
    return drawn(hero, *sections, *closing_sections(study, manifests))


def law_sections(fitted: ReportedLaw, count: int = 0) -> tuple[Section | None, ...]:
    """Return all sections of one law: errors, their places, error bars, learning, slopes, cost."""
    each = fitted.explored if isinstance(fitted.report.details.get("axes"), dict) else fitted.explored[:1]
    errors = section(
        "Errors, and what the fit chose",
        errors_table(fitted),
        axes_table(fitted.data, fitted.law, fitted.ranges),
        *(choice_table(fitted, axis) for axis in each),
        settings_table(fitted),
    )
    caption = (
        "Each state by its error, a share of the range of its axis' effort, all panels on one logarithmic scale of "
        "colours."
    )
    if fitted.study_misses:
        caption += " Beside the law: the form of the published study, fitted to the same states."
    places = Picture(numbered("fit_map", count), caption, residual_chart(fitted))
    return (
        errors,
        section("Where the law misses", places, open=True),
        bar_section(fitted, count),
        _learning(fitted, count),
        _slopes(fitted, count),
        section("Cost", cost_table(fitted)),
    )


def bar_section(fitted: ReportedLaw, count: int = 0) -> Section | None:
    """Return the section on the coverage of the error bars; None for a law without them."""
    curves = fitted.coverage
    if not curves:
        return None
    caption = (
        "Left: share of the states left out inside bands of each stated level; calibrated bars follow "
        "the diagonal within the scatter of so few states (grey). Right: each state's miss against the half-width of "
        "its own band."
    )
    shown = Picture(numbered("fit_bars", count), caption, coverage_chart(curves))
    return section("Are the error bars calibrated?", shown, coverage_table(curves))


def _learning(fitted: ReportedLaw, count: int = 0) -> Section | None:
    """Return error against the number of states; None if not requested or if nothing could be fitted."""
    learning = fitted.learning
    if learning is None or not learning["points"]:
        return None
    caption = (
        "The surrogate fitted again to nested subsets of the states, with exact slopes and with values alone, and "
        f"scored on the same {learning['n_check']} check states."
    )
    curves = state_curves(learning)
    error = ChartAxis("error on check states", "% of the effort's range", log=True)
    made = learning_chart("Error by number of states", curves, "states fitted", error, MARK)
    shown = Picture(numbered("fit_learning", count), caption, made)
    return section("How many states it takes", shown, learning_table(learning))


def _slopes(fitted: ReportedLaw, count: int = 0) -> Section | None:
    """Return ∂τ/∂u over the box."""
    several, largest = len(fitted.law.axes) > 1, fitted.least_stable
    shown = slope_unit(fitted.law).text(largest, 3)
    verdict = (
        f"Stable over the whole box: the largest ∂τ/∂u is {shown}, below zero."
        if largest < 0
        else f"UNSTABLE somewhere in the box: ∂τ/∂u reaches {shown}, and a joint may snap there."
    )
    if several:
        verdict += " It is the largest eigenvalue of the symmetric part, over random places of the box."
    caption = "∂τ/∂u over the law's box; the ring marks where the joint is softest."
    caption += " Each axis with the others at zero." if several else ""
    made = Picture(numbered("fit_slopes", count), caption, slope_chart(fitted))
    return section("Slopes: where the joint is soft", made, text=verdict)


def comparison_section(fitted: Sequence[ReportedLaw]) -> Section | None:
    """Return several surrogates on the same states; None for one."""
    if len(fitted) < 2:
        return None
    title = "Surrogates side by side"
    caption = (
        "The same states for all; shorter bars are better for errors and times, longer ones for evaluations."
    )
    made = Picture("fit_surrogates", caption, surrogates_chart(fitted))
    return section(title, made, page_table(title, SURROGATES, fitted))
