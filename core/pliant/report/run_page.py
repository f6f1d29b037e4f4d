"""The page of a run: the finger, its FEM, its laws, its poses in the engines, and the uncertainty of the tip."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from pliant.formatting import Unit, effort_unit, fixed, number, output_unit, seconds, small_length
from pliant.pipeline.run_folder import DesignResult, FinishedRun
from pliant.report.contact_charts import stills_chart
from pliant.report.document import (
    Cells,
    Drawn,
    Picture,
    Section,
    Table,
    capital,
    drawn,
    numbered,
    picture,
    section,
)
from pliant.report.fem_page import DesignStates, data_sections, shape_section
from pliant.report.figures.finger import finger_bodies, finger_picture
from pliant.report.fit_page import axes_table, score_cells, score_heads
from pliant.report.law_charts import law_chart
from pliant.report.pose_charts import backbone_caption, backbone_chart, pose_chart
from pliant.report.provenance import closing_sections, nested, plain, stage_name
from pliant.report.run_view import distances_m, gravity_words, study_form
from pliant.report.scenes.robot import robot_scene
from pliant.report.self_check import defaults_section
from pliant.report.tip_spread import uncertainty_section

RESIDUALS = "The errors of the law at these states are in the next section but one, with the law."


def run_drawn(run: FinishedRun) -> Drawn:
    """Return a page: body, law, poses; then meshes, states, law, engines, uncertainty, cost. It is deterministic."""
    block = run.study.get("fem") or {}
    backend = str(block.get("kind", "")) if isinstance(block, Mapping) else ""
    solved = [DesignStates(d.name, d.module, backend) for d in run.designs if d.module is not None]
    *states, cost = [None, *data_sections(solved, RESIDUALS)]
    parts = [
        "FEM shape of one module at this pressure, bent to each joint's angle and stacked; ghosts show the rest state "
        "and levels on the way, colour the stretch of the skin"
        if finger_bodies(run) is not None
        else "",
        "the joint law with the states behind it",
    ]
    if run.engines:
        scene = run.engines[0].result.stills
        parts.append("the scene at the end" if scene else f"the chain's pose {gravity_words(run)}")
    caption = capital("; ".join(filter(None, parts))) + "."
    return drawn(
        Picture("finger", caption, finger_picture(run), scene=robot_scene(run)),
        shape_section([(d.name, d.fem, d.law) for d in run.designs if d.fem is not None]),
        *states,
        _laws(run),
        _poses(run),
        uncertainty_section(run),
        defaults_section(run.summary),
        cost,
        section("Times", *time_tables(run)),
        *closing_sections(run.study, run.provenance),
    )


def _laws(run: FinishedRun) -> Section | None:
    parts: list[Picture | Table | None] = []
    for n, design in enumerate(run.designs):
        text = "τ is the external moment that opposes actuation; where it is zero the module is free."
        caption = run.named(design) + text
        if len(design.law.axes) > 1:
            caption += " The other axes are held at zero."
        if design.fem is not None:
            caption += (
                " Right: law minus state in percent of the effort's range, filled = fitted, open = left out."
            )
        if design.law.states_error:
            band = "the band that holds a state with a probability of 90 %"
            caption += f" Shaded, and as bars at the states left out: {band}."
        parts.append(Picture(numbered("law", n), caption, law_chart(run, design)))
    parts.append(law_table(run))
    for design in run.designs:
        if design.module is not None and set(design.law.axes) == set(design.module.axes):
            table = axes_table(design.module, design.law)
            parts.append(replace(table, title=run.named(design) + table.title) if table is not None else None)
    stated = [d for d in run.designs if d.fit is None]
    note = f"Stated law: {coefficients(stated[0])}" if stated else ""
    return section("The joint law τ(p, u)", *parts, note=note)


def _poses(run: FinishedRun) -> Section | None:
    """Return the chain in the engines; for a task with contact outlines of its scene."""
    engines = run.engines
    if not engines:
        return None
    if engines[0].result.stills:
        caption = "outlines of what collides, from the side and from above; the first trial."
        pictures = [
            Picture(numbered("stills", n), f"{engine.kind}: {caption}", stills_chart(engine.result.stills))
            for n, engine in enumerate(engines)
        ]
        notes = dict.fromkeys(str(e.result.metrics["note"]) for e in engines if "note" in e.result.metrics)
        tables = [metrics_table(run), *row_tables(run)]
        return section("The scene in the engines", *pictures, *tables, note=" ".join(notes))
    caption = "Markers are base, joints and tip, at equal scales; faint lines are levels of the actuation."
    first = engines[0].result
    return section(
        "The finger in the engines",
        Picture("chain_pose", caption, pose_chart(run)),
        picture("backbones", backbone_caption(first), backbone_chart(first)),
        engine_table(run),
        metrics_table(run),
        *row_tables(run),
    )


def engine_table(run: FinishedRun) -> Table | None:
    """Return settled tips, distances to the first engine, residuals."""
    engines = run.engines
    if not engines:
        return None
    rows = [
        [
            engine.kind,
            *(fixed(1e3 * x, 4) for x in engine.result.final.tip_m),
            "–" if count == 0 else small_length(float(distance[-1])),
            "–" if count == 0 else small_length(float(distance.max())),
            effort_unit(run.designs[0].law).text(engine.result.final.residual, 2)
            if engine.result.final.at_rest
            else "–",
            number(engine.result.final.converged),
            {True: "yes", False: "no", None: "not asked"}[engine.result.final.stable],
            str(engine.result.final.iterations),
        ]
        for count, (engine, distance) in enumerate(zip(engines, distances_m(engines), strict=True))
    ]
    first = engines[0].kind
    head = ["engine", *(f"tip {x} (mm)" for x in "xyz"), f"tip to {first}", f"farthest marker to {first}"]
    head += ["residual", "converged", "stable", "iterations"]
    note = "Residual: largest unbalanced joint effort, measured by one common statics for all engines."
    return Table("Settled chain, engine by engine", head, rows, note)


def metrics_table(run: FinishedRun) -> Table | None:
    """Return the task's metrics, one column per engine."""
    engines = run.engines
    names = list(dict.fromkeys(name for e in engines for name in e.result.metrics if name != "note"))
    if not names:
        return None
    rows = []
    for name in names:
        unit = output_unit(name)
        rows.append([unit.axis, *(_metric(e.result.metrics.get(name), unit) for e in engines)])
    return Table("What the task measures", ["metric", *(e.kind for e in engines)], rows)


def row_tables(run: FinishedRun) -> list[Table]:
    """Return metrics that are lists of records, such as the forces at contacts: a table each, engine by engine."""
    tables = []
    for engine in run.engines:
        for name, records in engine.result.metrics.items():
            if not (isinstance(records, list) and records and isinstance(records[0], Mapping)):
                continue
            units = {key: output_unit(key) for key in records[0]}
            rows: list[Cells] = [[_metric(one[key], unit) for key, unit in units.items()] for one in records]
            title = f"{capital(name)} at the end, {engine.kind}"
            tables.append(Table(title, [unit.axis for unit in units.values()], rows))
    return tables


def law_table(run: FinishedRun) -> Table | None:
    """Return the errors of each law on held-out states, compared with the published form."""
    rows: list[Cells] = []
    for design in run.designs:
        if design.fit is None:
            continue
        fit, form, effort = design.fit, study_form(design), effort_unit(design.law)
        parts = [fit.details.get("form", "law")]
        parts += [f"degree {fit.details['degree']}"] if fit.details.get("degree") is not None else []
        parts += [f"{fit.details['terms']} terms"] if fit.details.get("terms") is not None else []
        scored: dict[str, Mapping[str, Any]] = {
            ", ".join([*parts, f"{fit.n_fitted} states fitted"]): vars(fit)
        }
        if form is not None and fit.details.get("form") != "study":
            scored["the published form"] = form
        for name, scores in scored.items():
            rows.append([run.named(design) + name, str(fit.n_heldout), *score_cells(scores, effort)])
    if not rows:
        return None
    head = ["law", "states left out", *score_heads(effort_unit(run.designs[0].law))]
    fits = [d.fit for d in run.designs if d.fit is not None]
    note = f"States left out: {fits[0].details['held_out']}." if "held_out" in fits[0].details else ""
    return Table("Errors of the joint law on states it has not seen", head, rows, note)


def time_tables(run: FinishedRun) -> list[Table]:
    """Return the wall time of each stage when it was computed, and of settling in each engine."""
    tables = []
    if run.provenance:
        rows = [[stage_name(m), seconds(float(m["wall_s"]))] for m in run.provenance]
        note = "Times of the computation itself; a stage found in the store costs milliseconds."
        tables.append(Table("Stages", ["stage", "wall time"], rows, note))
    engines = run.engines
    if engines:
        times = [e.result.final.wall_s for e in engines]
        ratios = [f"{number(time / times[0], 3)} ×" if times[0] > 0 else "–" for time in times]
        rows = [[e.kind, seconds(time), ratio] for e, time, ratio in zip(engines, times, ratios, strict=True)]
        head = ["engine", "wall time", f"ratio to {engines[0].kind}"]
        tables.append(Table("Settling the chain, all levels of the history", head, rows))
    return tables


def coefficients(design: DesignResult) -> str:
    """Return the parameters of a stated law, as one line; empty for a fitted one."""
    record = design.law.record()
    shown = {**record.values, **{k: v.tolist() for k, v in record.arrays.items()}}
    return "; ".join(f"{key} = {plain(value)}" for key, value in shown.items())


def _metric(value: Any, unit: Unit) -> str:
    """Return a metric in a cell; points and tables are in pictures and in run.json."""
    items = value.values() if isinstance(value, Mapping) else value if isinstance(value, list | tuple) else ()
    if any(isinstance(item, list | tuple | Mapping) for item in items):
        return "in run.json" if isinstance(value, Mapping) else f"{len(value)} entries, in run.json"

    def cell(one: Any) -> str:
        if one is None or isinstance(one, bool):
            return number(one)
        if not isinstance(one, int | float):
            return str(one)
        return number(one * unit.factor if unit.symbol else one, 6)

    return nested(value, cell)
