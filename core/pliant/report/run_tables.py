"""The tables of a run: engines against each other, what the task measures, the law's errors, times."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pliant.formatting import Unit, effort_unit, fixed, number, seconds, small_length, unit_of
from pliant.records.law import FitReport
from pliant.report.document import Cells, Table
from pliant.report.fit_tables import score_cells, score_heads
from pliant.report.folder import DesignResult, FinishedRun
from pliant.report.provenance import plain, stage_name
from pliant.report.run_view import Ran, distances_m, ran, study_form


def engine_table(run: FinishedRun) -> Table | None:
    """Settled tips, distances to the first engine, residuals."""
    engines = ran(run)
    if not engines:
        return None
    rows = [
        [
            engine.kind,
            *(fixed(1e3 * x, 4) for x in engine.result.final.tip_m),
            "–" if count == 0 else small_length(float(distance[-1])),
            "–" if count == 0 else small_length(float(distance.max())),
            _residual(engine, run),
            number(engine.result.final.converged),
            {True: "yes", False: "no", None: "not asked"}[engine.result.final.stable],
            str(engine.result.final.iterations),
        ]
        for count, (engine, distance) in enumerate(zip(engines, distances_m(engines), strict=True))
    ]
    first = engines[0].kind
    head = [
        "engine",
        "tip x (mm)",
        "tip y (mm)",
        "tip z (mm)",
        f"tip to {first}",
        f"farthest marker to {first}",
    ]
    head += ["residual", "converged", "stable", "iterations"]
    note = "Residual: largest unbalanced joint effort, measured by one common statics for all engines."
    return Table("Settled chain, engine by engine", head, rows, note)


def metrics_table(run: FinishedRun) -> Table | None:
    """The task's metrics, one column per engine."""
    engines = ran(run)
    names = list(dict.fromkeys(name for e in engines for name in e.result.metrics if name != "note"))
    if not names:
        return None
    rows = []
    for name in names:
        unit = unit_of(name)
        rows.append([unit.axis, *(_metric(e.result.metrics.get(name), unit) for e in engines)])
    return Table("What the task measures", ["metric", *(e.kind for e in engines)], rows)


def law_table(run: FinishedRun) -> Table | None:
    """Errors of each law on states left out, with the study's form beside it."""
    rows: list[Cells] = []
    for design in run.designs:
        if design.fit is None:
            continue
        prefix, effort = f"{design.name}: " if len(run.designs) > 1 else "", effort_unit(design.law)
        rows.append(
            [
                f"{prefix}{_form(design.fit)}",
                str(design.fit.n_heldout),
                *score_cells(vars(design.fit), effort),
            ]
        )
        form = study_form(design)
        if form is not None and design.fit.details.get("form") != "study":
            rows.append([f"{prefix}the study's form", str(design.fit.n_heldout), *score_cells(form, effort)])
    if not rows:
        return None
    head = ["law", "states left out", *score_heads(effort_unit(run.designs[0].law))]
    fits = [d.fit for d in run.designs if d.fit is not None]
    note = f"States left out: {fits[0].details['held_out']}." if "held_out" in fits[0].details else ""
    return Table("Errors of the joint law on states it has not seen", head, rows, note)


def time_tables(run: FinishedRun) -> list[Table]:
    """Wall time of each stage when it was computed, and of settling in each engine."""
    tables = []
    if run.provenance:
        rows = [[stage_name(m), seconds(float(m["wall_s"]))] for m in run.provenance]
        note = "Times of the computation itself; a stage found in the store costs milliseconds."
        tables.append(Table("Stages", ["stage", "wall time"], rows, note))
    engines = ran(run)
    if engines:
        base = engines[0].result.final.wall_s
        rows = [
            [e.kind, seconds(e.result.final.wall_s), _ratio(e.result.final.wall_s, base)] for e in engines
        ]
        head = ["engine", "wall time", f"ratio to {engines[0].kind}"]
        tables.append(Table("Settling the chain, all levels of the history", head, rows))
    return tables


def coefficients(design: DesignResult) -> str:
    """The parameters of a stated law, as one line; empty for a fitted one."""
    record = design.law.record()
    shown = {**record.values, **{k: v.tolist() for k, v in record.arrays.items()}}
    return "; ".join(f"{key} = {plain(value)}" for key, value in shown.items())


def _form(fit: FitReport) -> str:
    form = fit.details.get("form", "law")
    degree = fit.details.get("degree")
    terms = fit.details.get("terms")
    extra = f", degree {degree}" if degree is not None else ""
    return (
        f"{form}{extra}"
        + (f", {terms} terms" if terms is not None else "")
        + f", {fit.n_fitted} states fitted"
    )


def _residual(engine: Ran, run: FinishedRun) -> str:
    return effort_unit(run.designs[0].law).text(engine.result.final.residual, 2)


def _metric(value: Any, unit: Unit) -> str:
    if isinstance(value, list | tuple):
        return _listed(value, unit)
    if isinstance(value, Mapping):
        if any(isinstance(item, list | tuple) for item in value.values()):
            return "in run.json"
        return ", ".join(f"{key} {_metric(item, unit)}" for key, item in value.items())
    if isinstance(value, bool):
        return "yes" if value else "no"
    if not isinstance(value, int | float):
        return "–" if value is None else str(value)
    return number(value * unit.factor if unit.symbol else value, 6)


def _listed(values: Sequence[Any], unit: Unit) -> str:
    """A short list of numbers; points stand in pictures and in run.json."""
    if any(isinstance(value, list | tuple) for value in values):
        return f"{len(values)} entries, in run.json"
    return ", ".join(_metric(value, unit) for value in values)


def _ratio(wall_s: float, base: float) -> str:
    return f"{number(wall_s / base, 3)} ×" if base > 0 else "–"
