"""Tables and charts of fitted laws: errors and where they are, what a fit chose, error bars, slopes, cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import scipy  # scipy.stats takes half a second

from pliant.formatting import (
    Unit,
    actuation_unit,
    deformation_unit,
    effort_unit,
    number,
    percent,
    seconds,
    slides,
)
from pliant.pipeline.reported_law import STUDY_FORMS, BandCoverage, ReportedLaw, slope_grid, unstable_places
from pliant.pipeline.residuals import Residuals
from pliant.records.design import Array
from pliant.records.fem import ModuleData
from pliant.records.law import JointLaw
from pliant.report.chart import (
    Band,
    Chart,
    ChartAxis,
    ChartBars,
    ChartCells,
    ChartLine,
    ChartNote,
    Mark,
    Panel,
)
from pliant.report.chart_colours import (
    ERROR_COLOURS,
    INK,
    LEVEL_COLOURS,
    MARKERS,
    PAPER,
    SERIES,
    SOFT,
    ColourScale,
)
from pliant.report.document import Cells, Column, Table, named_values, optional_table
from pliant.report.law_charts import actuation_axis, coordinate_axis
from pliant.report.provenance import short_text, words

PUBLISHED = 0.0826
PUBLISHED_NOTE = (
    "Published: worst error of the study's polynomial over its pressures, of the moment range, on its own FEM of the "
    "bending bellow (Yao, Howard, Maiolino, Adv. Intell. Syst. 2026, doi 10.1002/aisy.70406); other data than here."
)
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
            details = fitted.axis_details(axis).get(key)
            if isinstance(details, Mapping) and "problem" in details:
                rows.append([f"{title}: {details['problem']}", *["–"] * 5])
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
    return named_values("Details of the fit", values) if any(values.values()) else None


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


LOWEST = 1e-8  # share of the range below which errors are rounding
CHANCE = 0.9
MANY = 400
FEWEST = 10  # fewer states do not give a separate curve


def residual_chart(fitted: ReportedLaw) -> Chart:
    """Return one row for each axis, one column for the law and for each published form."""
    beside = {
        title.replace("the published form, ", "published form, "): m
        for title, m in fitted.study_misses.items()
    }
    columns = {"this law": fitted.misses, **beside}
    scale = _error_scale(list(columns.values()))
    panels = [
        _residual_panel(fitted, missed, name, title if beside or len(fitted.explored) == 1 else "", scale)
        for name in fitted.explored
        for title, missed in columns.items()
    ]
    across = len(columns) if beside else len(fitted.explored)
    return Chart(tuple(panels), across=across, cell=(1560 // across if across > 1 else 940, 500))


def _residual_panel(
    fitted: ReportedLaw, missed: Residuals, name: str, title: str, scale: ColourScale
) -> Panel:
    data, k = fitted.data, missed.axes.index(name)
    part = missed.rows(missed.axis == k)
    x = data.deformation[part.state, data.axes.index(name)] * deformation_unit(data, name).factor
    y = data.actuation[part.state] * actuation_unit(data.actuation_name).factor
    share = 100 * np.maximum(part.share, LOWEST)
    groups = (
        ("fitted", ~part.check & ~part.together, "o", 6.3),
        ("left out", part.check & ~part.together, "D", 7.9),
        ("fitted, all axes held", ~part.check & part.together, "s", 6.3),
        ("left out, all axes held", part.check & part.together, "P", 9.5),
    )
    marks = tuple(
        ChartLine(f"{label} ({count})", x[rows], y[rows], "", SOFT, 0.0, size, marker, values=share[rows])
        for label, rows, marker, size in groups
        if (count := len(np.unique(part.state[rows])))
    )
    worst = part.rows(part.check).worst
    worst_of = f"worst {percent(worst)} left out" if np.isfinite(worst) else f"worst {percent(part.worst)}"
    words = [f"axis {name}" if len(data.axes) > 1 else "", title]
    text = f"{', '.join(word for word in words if word)}: {worst_of}"
    return Panel(
        coordinate_axis(data, name), actuation_axis(data), marks, text[0].upper() + text[1:], scale=scale
    )


def _error_scale(columns: Sequence[Residuals]) -> ColourScale:
    """Return whole decades around all errors that are drawn."""
    shares = np.concatenate([m.share for m in columns])
    shares = 100 * np.maximum(shares[np.isfinite(shares)], LOWEST)
    low = float(np.quantile(shares, 0.15)) if len(shares) else 1e-3
    ends = (low, float(shares.max(initial=low)))
    return ColourScale.decades("|law − state|", "% of the effort's range", ends, ERROR_COLOURS)


def coverage_chart(curves: Sequence[BandCoverage], what: str = "states left out") -> Chart:
    """Return coverage by level with the range of chance (left), and miss against band at 90 % (right)."""
    return Chart((_coverage_panel(curves, what), _widths_panel(curves)), cell=(780, 600))


def _coverage_panel(curves: Sequence[BandCoverage], what: str) -> Panel:
    n, stated = curves[0].n, np.linspace(0.4, 0.9999, 3000)
    low, high = (100 * count / n for count in scipy.stats.binom.interval(CHANCE, n, stated))
    diagonal = np.array([40.0, 100.0])
    chance = f"90 % region of calibrated bars ({n})"
    marks: list[Mark] = [
        Band(chance, 100 * stated, low, high, colour="#e7e9ed"),
        ChartLine("as stated", diagonal, diagonal, "", SOFT, 1.1),
    ]
    shown = [(k, curve) for k, curve in enumerate(curves) if k == 0 or curve.n >= FEWEST]
    for k, curve in shown:
        colour, marker = _look(k)
        name = f"{curve.label} ({curve.n})"
        marks.append(ChartLine(name, 100 * curve.levels, 100 * curve.covered, "", colour, 1.6, 6.0, marker))
    lowest = min(float(curve.covered.min()) for _, curve in shown)
    y = ChartAxis(f"{what} inside it", "%", ends=(min(40.0, 100 * lowest - 5), 103.0))
    x = ChartAxis("stated level of the band", "%", ends=(45.0, 101.0))
    return Panel(x, y, tuple(marks), "What the bars state and what they hold")


def _widths_panel(curves: Sequence[BandCoverage]) -> Panel:
    curves = curves[1:] or curves
    first = 1 if len(curves) > 1 else 0
    pairs = [[100 * np.maximum(v, LOWEST) for v in (c.half_width, c.missed)] for c in curves]
    half, missed = (np.concatenate(values) for values in zip(*pairs, strict=True))
    across = np.geomspace(half.min() / 1.8, half.max() * 1.8, 50)
    low, high = min(missed.min(), half.min()) / 1.8, max(missed.max(), half.max()) * 1.8
    marks: list[Mark] = [
        Band("inside its band", across, np.full(len(across), low), across, colour="#e8f5f1"),
        ChartLine("inside its band", across, across, "", SOFT, 1.1),
    ]
    for k, (curve, pair) in enumerate(zip(curves, pairs, strict=True), start=first):
        colour, marker = _look(k)
        name, dot = f"{curve.label} ({curve.n})", 2.5 if curve.n > MANY else 5.5
        marks.append(ChartLine(name, pair[0], pair[1], "", colour, 0.0, dot, marker))
    outside, count = sum(int(np.sum(c.missed > c.half_width)) for c in curves), sum(c.n for c in curves)
    unit, ends = "% of the effort's range", (float(across[0]), float(across[-1]))
    x = ChartAxis("half-width of the 90 % band", unit, ends=ends, log=True)
    y = ChartAxis("miss", unit, ends=(float(low), float(high)), log=True)
    return Panel(x, y, tuple(marks), f"Each band and its miss: {outside} of {count} outside")


def _look(number: int) -> tuple[str, str]:
    """Return colour and marker; the curve of all states is black."""
    return (INK, "o") if number == 0 else (SERIES[(number - 1) % 6], MARKERS[number % 6])


def slope_chart(fitted: ReportedLaw) -> Chart:
    """Return ∂τ/∂u over the law's box, one panel for each explored axis; the ring marks the softest place."""
    panels = tuple(_slope_panel(fitted, name) for name in fitted.explored)
    return Chart(panels, cell=(1000 if len(panels) == 1 else 1560 // len(panels), 600), legend=())


def _slope_panel(fitted: ReportedLaw, name: str) -> Panel:
    law, data = fitted.law, fitted.data
    unit = slope_unit(law, name)
    p, u, slopes = slope_grid(law, name)
    x, y = u * deformation_unit(law, name).factor, p * actuation_unit(law.actuation_name).factor
    shown = unit.factor * slopes
    i, j = np.unravel_index(int(np.argmax(shown)), shown.shape)
    at = x[j : j + 1], y[i : i + 1]
    ring = (
        ChartLine("softest", *at, "", PAPER, 0.0, 11.0),
        ChartLine("softest", *at, "", INK, 0.0, 9.0, hollow=True),
    )
    word = "softest" if shown.max() < 0 else "UNSTABLE"
    text = f"axis {name}: {word}" if len(fitted.explored) > 1 else word
    title = f"{text[0].upper()}{text[1:]} {number(float(shown.max()), 3)} {unit.symbol}"
    scale = ColourScale.even("∂τ/∂u", unit.symbol, _ends(shown), LEVEL_COLOURS[::-1])
    marks = (ChartCells("∂τ/∂u", _edges(x), _edges(y), shown), *ring)
    return Panel(coordinate_axis(data, name), actuation_axis(data), marks, title, scale=scale)


FLAT = 0.02  # of the largest slope: a smaller variation across the box is shown as one colour


def _ends(shown: Array) -> tuple[float, float]:
    """Return the ends of the colours; for an almost constant slope, a range around it."""
    low, high = float(shown.min()), float(shown.max())
    room = max(FLAT * max(abs(low), abs(high)) - (high - low), 0.0) / 2
    return low - room, high + room


def _edges(middles: Array) -> Array:
    """Return the edges of cells around these middles, the first and last at the ends of the range."""
    between = (middles[1:] + middles[:-1]) / 2
    return np.concatenate([middles[:1], between, middles[-1:]])


def surrogates_chart(fitted: Sequence[ReportedLaw]) -> Chart:
    """Return bars of error, time and speed of several surrogates on logarithmic scales."""
    names = ChartAxis("surrogate", names=tuple(one.name for one in fitted))
    worst = [100 * f.report.worst_of_range for f in fitted]
    kinds = (
        ("Worst error on states left out", "error", "% of the effort's range", worst),
        ("Time of the fit", "time", "s", [f.wall_s for f in fitted]),
        ("Evaluations with slopes", "evaluations", "million a second", [f.per_second / 1e6 for f in fitted]),
    )
    panels = []
    for title, label, unit, found in kinds:
        values = np.maximum(found, LOWEST)
        low = float(10.0 ** np.floor(np.log10(values.min() / 2)))
        marks: list[Mark] = []
        for k, (one, value) in enumerate(zip(fitted, values.tolist(), strict=True)):
            at = np.array([float(k)])
            marks.append(ChartBars(one.name, at, np.array([low]), np.array([value]), "", SERIES[k % 6]))
            marks.append(ChartNote(number(value, 3), value, k))
        ends = (low, float(values.max() * (values.max() / low) ** 0.25))
        panels.append(Panel(ChartAxis(label, unit, ends=ends, log=True), names, tuple(marks), title))
    return Chart(tuple(panels), cell=(520, 170 + 70 * len(fitted)), legend=())


def slope_unit(law: JointLaw, axis: str = "") -> Unit:
    """Return the display unit of ∂τ/∂u: that of the effort per SI unit of u."""
    effort = effort_unit(law, axis)
    return Unit(f"{effort.symbol}/{'m' if slides(law, axis) else 'rad'}", effort.factor)
