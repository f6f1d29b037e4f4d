"""Tables of a fit: errors compared with published forms, chosen settings, error bars, learning, slopes, cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pliant.formatting import Unit, effort_unit, number, percent, seconds
from pliant.pipeline.learning import states_needed
from pliant.pipeline.residuals import Residuals
from pliant.records.design import Array
from pliant.records.fem import ModuleData
from pliant.records.law import JointLaw
from pliant.report.document import Cells, Column, Table, named_values, optional_table
from pliant.report.fit_view import STUDY_FORMS, BandCoverage, ReportedLaw, unstable_places
from pliant.report.provenance import short_text, words

PUBLISHED = 0.0826
PUBLISHED_NOTE = (
    "Published: worst error of the study's polynomial over its pressures, of the moment range, on its own FEM of the "
    "bending bellow (Yao, Howard, Maiolino, Adv. Intell. Syst. 2026, doi 10.1002/aisy.70406); other data than here."
)
MARKS = (1e-3, 1e-4, 1e-5)
# Details with separate tables or pictures, or too long for a cell.
TOLD = {
    "parameters", "residuals", "cross_validation", "held_out", "axes", "excluded", "slope_errors", "error_bar",
    *STUDY_FORMS,
}  # fmt: skip


def errors_table(fitted: ReportedLaw) -> Table:
    """Return the errors of the law, of the published forms on the same states, and the published value."""
    effort, report = effort_unit(fitted.law), fitted.report
    rows: list[Cells] = [
        [
            f"{fitted.kind} ({report.n_fitted} states fitted)",
            str(report.n_heldout),
            *score_cells(vars(report), effort),
        ]
    ]
    for key, title in STUDY_FORMS.items():
        forms = fitted.study_forms(key)
        for axis, form in forms.items():
            label = f"{title}, axis {axis}" if len(fitted.explored) > 1 else title
            held_out = fitted.axis_details(axis).get("n_heldout", report.n_heldout)
            rows.append([label, str(held_out), *score_cells(form, effort)])
    if not any(fitted.study_forms(key) for key in STUDY_FORMS):
        rows += [_beside(title, missed, effort) for title, missed in fitted.study_misses.items()]
    for axis in fitted.explored:
        for key, title in STUDY_FORMS.items():
            told = fitted.axis_details(axis).get(key)
            if isinstance(told, Mapping) and "problem" in told:
                rows.append([f"{title}: {told['problem']}", *["–"] * 5])
    note = f"States left out: {report.details['held_out']}." if "held_out" in report.details else ""
    if fitted.law.joint == "revolute" and fitted.law.actuation_name == "pressure_pa":
        rows.append(["published study, its own data", "–", "–", "–", percent(PUBLISHED, 3), "–"])
        note = f"{note} {PUBLISHED_NOTE}".strip()
    head = ["law", "states left out", *score_heads(effort)]
    return Table("Errors on states that the law has not seen", head, rows, note)


def axes_table(data: ModuleData, law: JointLaw, ranges: Array | None = None) -> Table | None:
    """Return errors of τ by axis at trusted states; None for one axis. `ranges` (k,) replace those of the data."""
    if len(law.axes) == 1:
        return None
    effort, missed = effort_unit(law), Residuals.from_law(data, law, ranges=ranges)
    rows: list[Cells] = []
    for together in (False, True):
        for k, axis in enumerate(law.axes):
            part = missed.rows((missed.axis == k) & (missed.together == together))
            if len(part.state):
                rows.append([f"all held: {axis}" if together else axis, *_by_role(part, effort)])
    whole = Residuals.from_law(data, law, every=True, ranges=ranges)
    rows.append(["every axis in every state", *_by_role(whole, effort)])
    head = ["axis", "fitted, worst of range", "left out, RMS of range", "left out, worst of range"]
    note = (
        "Of the range of each axis' effort in its own states. 'All held': states that hold all axes at once, which "
        "show how well the law describes their coupling. Last row: also efforts of axes that are free in a state."
    )
    return Table("Errors by axis", [*head, f"worst ({effort.symbol})"], rows, note)


def choice_table(fitted: ReportedLaw, axis: str) -> Table | None:
    """Return the candidates of a cross-validation of one axis; None if the surrogate has none."""
    details = fitted.axis_details(axis) or fitted.report.details
    found = details.get("cross_validation")
    if not isinstance(found, Sequence) or not found or not isinstance(found[0], Mapping):
        return None
    names = [name for name in found[0] if name != "chosen"]
    rows = [
        [_cell(name, one.get(name)) for name in names] + ["chosen" if one.get("chosen") else ""]
        for one in found
    ]
    title = "What the fit chose from" + (f", axis {axis}" if len(fitted.explored) > 1 else "")
    note = "Errors of states left out in turn, as shares of the effort's range."
    return Table(title, [*(words(name) for name in names), ""], rows, note, numeric=0)


def settings_table(fitted: ReportedLaw) -> Table | None:
    """Return every other detail of the fit that is one word or number."""
    values: dict[str, str] = {}
    for axis in fitted.explored if isinstance(fitted.report.details.get("axes"), Mapping) else ("",):
        details = fitted.axis_details(axis) if axis else fitted.report.details
        for name, value in details.items():
            if name not in TOLD and not name.startswith("n_") and name not in vars(fitted.report):
                values[f"{axis}: {words(name)}" if axis else words(name)] = short_text(value)
    return named_values("What the fit tells", values) if any(values.values()) else None


def coverage_table(curves: Sequence[BandCoverage]) -> Table | None:
    """Return covered shares by level; None without bars."""
    rows = [
        [
            curve.label,
            str(curve.n),
            *(percent(float(c), 3) for c in curve.covered),
            percent(float(np.median(curve.half_width))),
        ]
        for curve in curves
    ]
    levels = [f"in {100 * level:.0f} %" for one in curves[:1] for level in one.levels]
    head = ["", "states", *levels, "median half-width at 90 %"]
    note = "Share of the states left out that lie inside the band of each stated level; widths of the effort's range."
    return optional_table("What the error bars hold", head, rows, note)


def learning_table(learning: Mapping[str, Any]) -> Table:
    """Return errors by number of states, and the number of states that an error needs."""
    names = list(dict.fromkeys(p["slopes"] for p in learning["points"]))
    sizes = sorted({p["n"] for p in learning["points"]})
    rows: list[Cells] = []
    for n in sizes:
        cells = [str(n)]
        for name in names:
            found = [p for p in learning["points"] if p["slopes"] == name and p["n"] == n]
            for score in ("rms", "worst"):
                cells.append(percent(float(np.median([p[score] for p in found]))) if found else "–")
        rows.append(cells)
    for mark in MARKS:
        cells = [f"states for {percent(mark)}"]
        for name in names:
            for score in ("rms", "worst"):
                needed = states_needed(learning, mark, name, score)
                cells.append("not reached" if needed is None else str(needed))
        rows.append(cells)
    head = ["states", *(f"{name}, {score}" for name in names for score in ("RMS", "worst"))]
    note = (
        f"Shares of the effort's range at {learning['n_check']} check states. Subsets are nested: corners of the box "
        "first, then the state farthest from those before it; with several axes each gets one in turn."
    )
    if untrusted := learning.get("untrusted"):
        note += f" {untrusted} states that are not trusted (self-contact) are not used."
    impossible = sorted({p["n"] for p in learning["left_out"]})
    if impossible:
        note += f" Too few to fit: {', '.join(map(str, impossible))} ({learning['left_out'][0]['cause']})."
    return Table("Error by number of states", head, rows, note)


def cost_table(fitted: ReportedLaw) -> Table:
    """Return the cost of the law and of an evaluation."""
    each = fitted.fem_s / max(fitted.solved, 1)
    ratio = number(float(f"{each * fitted.per_second:.2g}"))
    values = {
        "states": f"{len(fitted.data)}, {fitted.solved} of them solved, from {fitted.source}",
        "solver, all states": f"{seconds(fitted.fem_s)} ({seconds(each)} a state)" if each else None,
        "fit": seconds(fitted.wall_s),
        "evaluations with slopes": f"{number(fitted.per_second / 1e6, 3)} million a second",
        "one FEM state costs as much as": f"{ratio} evaluations" if each else None,
    }
    note = (
        "Evaluations in batches of 20 000, measured in one process on this machine when this page was made."
    )
    return named_values("Cost", values, note)


SURROGATES: tuple[Column[ReportedLaw], ...] = (
    Column("name", "", head="surrogate", brief="kind"),
    Column("report.n_fitted", "", head="fitted"),
    Column("report.n_heldout", "", head="left out"),
    Column("report.worst_of_range", head="worst, of range", brief="worst", show=percent),
    Column(
        lambda f: f.report.rmse / f.report.effort_range,
        "rmse_of_range",
        "RMSE, of range",
        "rmse",
        show=percent,
    ),
    Column("report.worst", "", head="worst", text=lambda f: effort_unit(f.law).text(f.report.worst, 3)),
    Column("report.rmse", "", head="RMSE", text=lambda f: effort_unit(f.law).text(f.report.rmse, 3)),
    Column("report.r2", head="R²", brief="R²", show=lambda r2: r2_text(r2)),
    Column(
        lambda f: f.coverage[0].at(0.9) if f.coverage else None,
        "covered",
        "in its 90 % band",
        "in band",
        show=lambda covered: percent(covered, 3),
    ),
    Column(lambda f: not unstable_places(f.law), "stable", brief="stable", show=number),
    Column("wall_s", head="fit", brief="fit", show=seconds),
    Column("per_second", "", head="million evaluations a second", show=lambda rate: number(rate / 1e6, 3)),
)


def _by_role(part: Residuals, effort: Unit) -> list[str]:
    fit, left = part.rows(~part.check), part.rows(part.check)

    def said(group: Residuals, value: float) -> str:
        return f"{percent(value)} ({len(group.state)})" if len(group.state) else "–"

    return [
        said(fit, fit.worst),
        said(left, left.rms),
        said(left, left.worst),
        number(float(np.abs(part.miss).max()) * effort.factor, 3),
    ]


def _beside(title: str, missed: Residuals, effort: Unit) -> Cells:
    """Return a row of the published form if the law's own report has none: scored here, on the same states."""
    part = missed.rows(missed.check)
    rmse, worst = float(np.sqrt(np.mean(part.miss**2))), float(np.abs(part.miss).max(initial=0.0))
    values = {"rmse": rmse, "worst": worst, "worst_of_range": part.worst}
    return [title, str(len(np.unique(part.state))), *score_cells(values, effort)]


def score_heads(effort: Unit) -> list[str]:
    """Return the headings of `score_cells`."""
    return [f"RMSE ({effort.symbol})", f"worst ({effort.symbol})", "worst, of effort range", "R²"]


def score_cells(scores: Mapping[str, Any], effort: Unit) -> list[str]:
    """Return the errors of a law, from its report or from that of a published form."""
    return [
        number(scores["rmse"] * effort.factor, 3),
        number(scores["worst"] * effort.factor, 3),
        percent(scores["worst_of_range"], 3),
        r2_text(float(scores.get("r2", float("nan")))),
    ]


def r2_text(r2: float) -> str:
    """Return R² with seven decimals; one state, or states of one torque, have none."""
    return f"{r2:.7f}" if np.isfinite(r2) else "–"


def _cell(name: str, value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return percent(value) if name.endswith(("of_range", "standard_error")) else number(value, 3)
    return number(value) if isinstance(value, int) or value is None else str(value)
