"""The page of `pliant fit`: laws with their errors, self-contained."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pliant import __version__
from pliant.formatting import number, percent, units_of_page
from pliant.report.document import Section, Warned
from pliant.report.facts import input_table, provenance_table
from pliant.report.figures.slope_map import least_stable
from pliant.report.fit_reading import Fitted, calibration
from pliant.report.fit_sections import comparison_section, law_pictures, of_one
from pliant.report.folder import FinishedRun
from pliant.report.template import page_template
from pliant.report.words import data_warnings

SHOWN = 4  # laws that are drawn in full


def render_fit(
    title: str,
    fitted: Sequence[Fitted],
    study: Mapping[str, Any],
    provenance: Sequence[Mapping[str, Any]],
    compared: Sequence[Fitted] = (),
) -> str:
    """The page as HTML with its pictures inside.

    Args:
        title: of the page.
        fitted: the laws, one for each design.
        study: inputs to list.
        provenance: manifests of what went in.
        compared: surrogates fitted to the states of the first design, side by side; one of them may be that law.
    """
    hero, *others = law_pictures(fitted[0])
    sections = [Section("The law about the other axes", tuple(others))] if others else []
    if (beside := comparison_section(compared)) is not None:
        sections.append(beside)
    several = len(fitted) > 1
    for index, one in enumerate(fitted[:SHOWN]):
        prefix = f"{one.name}: " if several else ""
        if index:
            sections.append(Section(f"{prefix}the law", tuple(law_pictures(one, index))))
        sections += of_one(one, index, prefix)
    sections.append(Section("Inputs", tables=(input_table(FinishedRun({}, study, (), (), ())),)))
    if provenance:
        page = FinishedRun({}, study, (), (), tuple(provenance))
        sections.append(Section("Provenance", tables=(provenance_table(page),)))
    text: str = page_template().render(
        title=title,
        kind="Pliant fit",
        sentence=" ".join(sentence(one, several) for one in fitted[:SHOWN]),
        hero=hero,
        warnings=[w for one in fitted for w in fit_warnings(one, several)],
        sections=sections,
        version=provenance[0].get("pliant", __version__) if provenance else __version__,
        footer=units_of_page(pressures="Pa", forces="N", moments="N*m", angles="rad", extensions="m"),
    )
    return text


def sentence(fitted: Fitted, named: bool = False) -> str:
    """Worst error on states left out, the study's form beside it, coverage, speed."""
    report = fitted.report
    parts = [
        f"the law is within {percent(report.worst_of_range)} of {fitted.source} on {report.n_heldout} states "
        f"left out ({report.n_fitted} fitted)"
    ]
    beside = list(fitted.study_misses.values())
    if beside and report.details.get("form") != "study":
        worst = beside[0].rows(beside[0].check).worst
        parts.append(f"the study's form misses the same states by up to {percent(worst)}")
    if curves := calibration(fitted):
        every = curves[0]
        parts.append(f"the law's 90 % band holds {round(every.n * every.at(0.9))} of {every.n}")
    parts.append(f"{number(fitted.per_second / 1e6, 2)} million evaluations a second")
    text = "; ".join(parts) + "."
    return f"{fitted.name}: {text}" if named else text[0].upper() + text[1:]


def fit_warnings(fitted: Fitted, named: bool = False) -> list[Warned]:
    """What limits the law: instability, missing bars, the states themselves."""
    prefix = f"{fitted.name}: " if named else ""
    found = []
    if least_stable(fitted.law) >= 0:
        found.append(Warned(f"{prefix}the law is unstable (∂τ/∂u ≥ 0) somewhere in its domain."))
    if fitted.law.error is None:
        found.append(Warned(f"{prefix}the law states no error bar."))
    return found + data_warnings(fitted.data, prefix)
