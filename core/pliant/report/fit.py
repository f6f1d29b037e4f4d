"""Fitted laws as a document: errors on held-out states, error bars, limits; for terminal, page and JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pliant.errors import UserError
from pliant.fem_tables.reading import holds_whole_states, read_module_table, read_table
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
from pliant.interfaces.surrogate import Surrogate, SurrogateConfig
from pliant.pipeline.learning import learning_stage
from pliant.pipeline.residuals import as_module_data, as_scored, module_from_axes
from pliant.pipeline.segments import DesignStages
from pliant.pipeline.study import DEFAULT_SURROGATE
from pliant.pipeline.surrogate import LawStage, study_law_beside
from pliant.pipeline.workbench import RunContext
from pliant.records.design import Array
from pliant.records.fem import ModuleData
from pliant.report.document import Document, Drawn, Table, Warned, answers, as_json, brief_table, capital
from pliant.report.fem_view import data_warnings
from pliant.report.fit_tables import SURROGATES
from pliant.report.fit_view import ReportedLaw, slope_unit, unstable_places
from pliant.report.provenance import duration, made_by, stage_json
from pliant.report.stage import StoredPage
from pliant.report.unseen_law import meta_law_json, meta_law_lines
from pliant.units import split_unit

PAGE = "fit.html"
SHOWN = 4  # laws that are drawn in full
LEVEL = 0.9
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

    def draw() -> Drawn:
        from pliant.report.fit_page import fit_drawn  # matplotlib takes a second to import

        return fit_drawn(fitted[:SHOWN], compared, study, manifests, several)

    limits = tuple(w for one in fitted for w in fit_warnings(one, several))
    return Document(
        kind="Pliant fit",
        title=title,
        sentence=" ".join(fit_sentence(one, several) for one in fitted[:SHOWN]),
        data=data,
        brief=tuple(brief),
        answers=_answers(fitted[0], limits),
        warnings=limits,
        draw=draw,
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
    return StoredPage(context, _manifests(fitted, compared), components, "pliant.report.fit_page", config)


def _manifests(fitted: Sequence[ReportedLaw], compared: Sequence[ReportedLaw]) -> list[Mapping[str, Any]]:
    return [a.manifest for one in (*fitted, *compared) for a in one.artifacts]


def fitted_law(
    context: RunContext,
    name: str,
    config: SurrogateConfig,
    stage: LawStage,
    data: ModuleData | None = None,
    *,
    learning: bool = True,
    source: str = "FEM",
) -> ReportedLaw:
    """Return a law with the data of its document; with `learning` the surrogate is also fitted to parts of the states.

    Args:
        context: plugins and store.
        name: of the design, or of the surrogate where several are compared.
        config: of the surrogate.
        stage: the law.
        data: whole states of the module; by default those of the law's stage.
        learning: whether a learning curve is made.
        source: origin of the states, in words.

    Raises:
        UserError: the law is stated by coefficients, so there is no fit to report.
    """
    surrogate: Surrogate = context.build("surrogate", config)
    known = data is not None or stage.data is not None or bool(surrogate.tables())
    if stage.report is None or stage.artifact is None or not known:
        raise UserError(
            f"the law of '{name}' is stated by its coefficients: there is no fit, so leave out --out, or let "
            "'surrogate' fit FEM states or a table."
        )
    data = as_scored(_own_table_states(surrogate, stage) if data is None else data, stage.report)
    curve = None
    if learning and len(surrogate.tables()) <= 1 and len(data.actuations) == 1:
        curve = learning_stage(context, config, data, {"law": stage.artifact.key})
    details = stage.report.details
    own = "study_form" in details or any(
        "study_form" in axis for axis in dict(details.get("axes", {})).values()
    )
    return ReportedLaw(
        name,
        config.kind,
        stage.law,
        stage.report,
        data,
        float(stage.artifact.manifest["wall_s"]),
        curve.value if curve is not None else None,
        source,
        None if own else study_law_beside(context, data),
        config,
        (stage.artifact,) if curve is None else (stage.artifact, curve),
    )


def fitted_designs(
    context: RunContext, designs: Sequence[DesignStages], learning: bool = True
) -> list[ReportedLaw]:
    """Return the laws of a study's designs, named by number if there are several."""
    found = []
    for count, design in enumerate(designs, start=1):
        name = "the design" if len(designs) == 1 else f"design {count}"
        default = context.registry.get("surrogate", DEFAULT_SURROGATE)
        config: Any = design.design.surrogate or default.config_model()(kind=DEFAULT_SURROGATE)
        data = design.fem.value if design.fem is not None else None
        source = "FEM" if design.fem is not None else "the table"
        found.append(fitted_law(context, name, config, design.law, data, learning=learning, source=source))
    return found


def _own_table_states(surrogate: Surrogate, stage: LawStage) -> ModuleData:
    """Return the states of the config's own tables: one of one axis or of several, or one for each axis."""
    tables = surrogate.tables()
    path = tables.get("")
    if path is not None and holds_whole_states(path):
        return read_module_table(path)
    if tables and path is None:
        return module_from_axes({axis: read_table(one, axis) for axis, one in tables.items()}, stage.law.axes)
    assert stage.data is not None
    return as_module_data(stage.data)


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
