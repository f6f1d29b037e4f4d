"""A run as a document: results of the engines, errors of the law; shared by `run`, `simulate` and `report`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pliant.formatting import (
    Unit,
    actuation_unit,
    deformation_unit,
    display_unit,
    effort_unit,
    fixed,
    number,
    output_unit,
    percent,
    small_length,
    stem_and_unit,
    unbroken,
)
from pliant.pipeline.run_folder import DesignResult, EngineResult, FinishedRun, finished, table_name
from pliant.pipeline.study import EngineRun, StudyRun, law_components
from pliant.pipeline.workbench import RunContext
from pliant.records.design import Array
from pliant.records.rollout import TaskResult
from pliant.report.document import Document, Drawn, Warned, answers, capital
from pliant.report.fem import LISTED, data_warnings, fem_json, fem_lines, truncation_note
from pliant.report.fit import UNSTABLE_LAW, law_json, law_lines
from pliant.report.provenance import duration, made_by, stage_json
from pliant.report.run_view import (
    actuation_text,
    distances_m,
    main_axis,
    payload_kg,
    spread_sentence,
)
from pliant.report.self_check import defaults_json, defaults_lines
from pliant.report.stage import StoredPage


def run_document(run: FinishedRun, lines: Sequence[str] = ()) -> Document:
    """Return the document of a run; `lines` are printed on a terminal before its sentence."""

    def draw() -> Drawn:
        from pliant.report.run_page import run_drawn  # matplotlib takes a second to import

        return run_drawn(run)

    return Document(
        kind="Pliant report",
        title=str(run.study.get("name", "Pliant run")),
        sentence=result_sentence(run),
        data=run.summary,
        answers=_answers(run),
        brief=tuple(lines),
        warnings=tuple(warnings(run)),
        draw=draw,
        version=made_by(run.provenance),
    )


def simulation_document(done: StudyRun) -> Document:
    """Return the document of `pliant simulate`: its first engine, with the task's metrics."""
    engine = done.engines[0]
    data = simulation_json(engine)
    data |= {**_uncertainty_json(done), **_checks_json(done), "remarks": list(done.remarks)}
    metrics: list[str] = []
    if engine.result is not None:
        nowhere = _no_state(engine.result)
        lost = nowhere and engine.result.last_held is None
        metrics = [NO_METRICS] if lost else metric_lines(engine.result.metrics)
        metrics = [OF_LAST_HELD, *metrics] if nowhere and not lost else metrics
    return run_document(finished(done, data), [*engine_lines(done), *metrics])


def stored_run_page(context: RunContext, done: StudyRun, run: FinishedRun) -> StoredPage:
    """Return the page of a run with the data that it depends on."""
    return StoredPage(
        context,
        run.provenance,
        law_components(context, done.designs),
        "pliant.report.run_page",
        {
            "study": done.study.canonical(),
            "skipped": [engine.skipped for engine in done.engines],
            "remarks": list(done.remarks),
            **_checks_json(done),
        },
    )


def run_json(done: StudyRun, folder: Path) -> dict[str, Any]:
    """Return the `run` result of docs/command_line.md."""
    result: dict[str, Any] = {"study": done.study.name, "out": str(folder)}
    artifacts = [d.fem for d in done.designs if d.fem is not None]
    if artifacts:
        tables = [str(folder / table_name(n)) for n, d in enumerate(done.designs) if d.fem is not None]
        result["fem"] = fem_json(artifacts, tables)
    fits = [law_json(design) for design in done.designs]
    result["fit"] = fits[0] if len(fits) == 1 else fits
    if done.engines:
        result["simulate"] = simulation_json(done.engines[0])
        result["cross_check"] = [simulation_json(engine) for engine in done.engines[1:]]
        markers = [e.result.final.markers_m for e in done.engines if e.result is not None]
        apart = [float(np.linalg.norm(m - markers[0], axis=1).max()) for m in markers[1:]]
        result["largest_marker_distance_m"] = max(apart, default=None)
    result |= {**_uncertainty_json(done), **_checks_json(done)}
    result |= {"unused": list(done.unused), "remarks": list(done.remarks)}
    return result


def _uncertainty_json(done: StudyRun) -> dict[str, Any]:
    """Return the results of runs with drawn laws, if the study requests them."""
    made = done.uncertainty
    return {} if made is None else {"uncertainty": {**made.value, "stages": [stage_json(made)]}}


def _checks_json(done: StudyRun) -> dict[str, Any]:
    """Return the defaults on which the answer depends, if they were examined."""
    return {} if done.checked is None else defaults_json(done.checked)


def simulation_json(engine: EngineRun) -> dict[str, Any]:
    """Return the `simulate` result of one engine."""
    if engine.artifact is None:
        return {"kind": engine.kind, "skipped": engine.skipped}
    result: TaskResult = engine.artifact.value
    final = result.final
    angles = final.joint_angles
    return {
        "kind": engine.kind,
        "tip_m": final.tip_m,
        "markers_m": final.markers_m,
        "joint_angles_rad": angles[:, 0] if angles.shape[1] == 1 else angles,
        "converged": final.converged,
        "stable": final.stable,
        "residual": final.residual,
        "wall_s": final.wall_s,
        "outside_domain": [vars(entry) for entry in final.outside_domain],
        "not_reached": result.not_reached,
        "last_held": _last_held_json(result),
        "metrics": result.metrics,
        "stages": [stage_json(engine.artifact)],
    }


def run_lines(done: StudyRun) -> list[str]:
    """Return data, laws and engines of a run, for the terminal."""
    lines = []
    for design in done.designs:
        lines += fem_lines([design.fem]) if design.fem else []
        lines += law_lines(design)
    return lines + engine_lines(done)


def engine_lines(done: StudyRun) -> list[str]:
    """Return the settled tip of each engine and its uncertainty, for the terminal."""
    unit = effort_unit(done.chain.laws[0]) if done.chain is not None else display_unit("N*m")
    lines = [_engine_line(engine, unit) for engine in done.engines]
    first = done.engines[0].kind if done.engines else ""
    if done.uncertainty is not None:
        text = spread_sentence(done.uncertainty.value, first).rstrip(".")
        lines.append(f"error bar    {text}; {duration(done.uncertainty)}")
    return lines + ([] if done.checked is None else defaults_lines(done.checked))


def _engine_line(engine: EngineRun, effort: Unit) -> str:
    if engine.artifact is None:
        return f"{engine.kind:<12} skipped: {engine.skipped}"
    result: TaskResult = engine.artifact.value
    if result.stills:  # the arms are held by contact: their tips and residuals are not informative
        numbers = [
            f"{stem_and_unit(name)[0]} {output_unit(name).text(v)}"
            for name, v in result.metrics.items()
            if isinstance(v, float)
        ]
        if "mode" in result.metrics:
            grasped = ("z_end", "success_share")
            numbers = [f"{result.metrics['mode']}", *(n for n in numbers if n.startswith(grasped))]
        return f"{engine.kind:<12} {', '.join((*numbers[:3], duration(engine.artifact)))}"
    how = duration(engine.artifact, result.final.wall_s)
    if result.final.at_rest:
        how = f"residual {effort.text(result.final.residual, 2)}, {how}"
    if not _no_state(result):
        return f"{engine.kind:<12} tip {_tip(result.final.tip_m)}, {_state(result)}, {how}"
    if result.last_held is None or result.rollout is None:
        return f"{engine.kind:<12} {_state(result)}, {how}; no state held before"
    tip = _tip(result.rollout.markers_m[result.last_held, -1])
    return f"{engine.kind:<12} {_state(result)}, {how}; tip of the last state that held {tip}"


OF_LAST_HELD = "  of the last state that held:"
NO_METRICS = "  no metrics: the last step left no state of the chain (its numbers are in the JSON result)"


def _no_state(result: TaskResult) -> bool:
    """Return whether the last state is no equilibrium of the chain, so that its numbers have no meaning."""
    left = not result.reached and result.last_held is not None
    return not result.stills and (left or not result.final.converged)


def _state(result: TaskResult) -> str:
    if not result.final.converged:
        return "NOT CONVERGED"
    if _no_state(result):
        return "NOT REACHED"
    return "settled" if result.final.at_rest else "in motion"


def _tip(tip_m: Array) -> str:
    length = display_unit("m")
    return f"({', '.join(f'{length.factor * x:.3f}' for x in tip_m)}) {length.symbol}"


def _last_held_json(result: TaskResult) -> dict[str, Any] | None:
    """Return the last equilibrium before the task failed; None if it did not fail."""
    if result.last_held is None or result.rollout is None:
        return None
    history, at = result.rollout, result.last_held
    return {
        "actuation": history.actuation[at],
        "tip_m": history.markers_m[at, -1],
        "joint_angles_rad": history.joint_angles[at],
    }


def metric_lines(metrics: Mapping[str, Any]) -> list[str]:
    """Return a task's metrics in display units for the terminal; curves and tables are in the JSON result."""
    lines = []
    for name, value in metrics.items():
        items = value.values() if isinstance(value, Mapping) else value if isinstance(value, list) else ()
        if not any(isinstance(item, list | Mapping) for item in items):
            lines.append(f"  {stem_and_unit(name)[0]:<24} {_metric_text(name, value)}")
    return lines


def _metric_text(name: str, value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{stem_and_unit(key)[0]} {_metric_text(key, item)}" for key, item in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(_metric_text(name, item) for item in value)
    if isinstance(value, float):
        return output_unit(name).text(value, 6)
    return number(value) if isinstance(value, bool) else f"{value}"


def result_sentence(run: FinishedRun) -> str:
    """Return the outcome: the bend, the agreement of the engines, the error of the law."""
    parts, engines = [_bend(run)], run.engines
    if len(engines) > 1 and not engines[0].result.stills:
        worst = max(float(d.max()) for d in distances_m(engines))
        count = {2: "two", 3: "three", 4: "four"}.get(len(engines), str(len(engines)))
        parts.append(f"{count} engines agree within {small_length(worst)}")
    return capital(unbroken("; ".join([*parts, _law_error(run)]))) + "."


def _answers(run: FinishedRun) -> tuple[tuple[str, str], ...]:
    """Return the answers: error of the law and agreement of engines, limits of the result, uncertainty of the tip."""
    limits = warnings(run)
    more = f" And {len(limits) - 1} more, below." if len(limits) > 1 else ""
    spread, first = run.uncertainty, run.engines[0].kind if run.engines else ""
    return answers(
        capital(_law_error(run)) + ".",
        limits[0].sentence + more if limits else "",
        spread_sentence(spread, first) if spread is not None else "",
        "Measure one and hold the model against it: pliant compare.",
    )


def warnings(run: FinishedRun) -> list[Warned]:
    """Return all limits of the result, the gravest first."""
    found: list[Warned] = []
    for engine in run.engines:
        found += _engine_warnings(engine, run)
    for design in run.designs:
        found += _law_warnings(design, len(run.designs) > 1)
    for kind, cause in run.skipped:
        found.append(Warned(f"Engine {kind} was skipped: {cause or 'no cause was given'}"))
    found += [Warned(text) for text in run.summary.get("remarks") or ()]
    unused = run.summary.get("unused") or []
    if unused:
        found.append(Warned(f"The study sets {', '.join(unused)}, which has no effect in this study."))
    if run.uncertainty is not None and run.uncertainty["failed"]:
        failed, samples = run.uncertainty["failed"], run.uncertainty["samples"]
        found.append(
            Warned(f"{failed} of {samples} runs with laws drawn from their error bars did not settle.")
        )
    return found


def _bend(run: FinishedRun) -> str:
    engines, law, at = run.engines, run.designs[0].law, actuation_text(run)
    if not engines:
        return f"a joint law of one module, no chain simulated ({run.study.get('name', 'study')})"
    result = engines[0].result
    if result.stills:
        return grasp_words(engines[0], at)
    joints = result.final.joint_angles
    load = payload_kg(run)
    under = f" with {display_unit('kg').text(load)} at its tip" if load else ""
    name = f"{len(joints)}-module finger" if len(joints) > 1 else "one-joint finger"
    slides, unit = law.joint == "prismatic", deformation_unit(law)
    verb = "extends by" if slides else "bends"

    def size(angles: Array) -> str:
        return unit.attached(fixed(unit.factor * float(angles[:, main_axis(law)].sum()), 2 if slides else 1))

    if _no_state(result):
        failed = "did not settle" if not result.final.converged else "is held by nothing"
        before = ""
        if result.last_held is not None and result.rollout is not None:
            held = size(result.rollout.joint_angles[result.last_held])
            before = f"; in the last state that held it {verb} {held}"
        return f"{name} {failed}{at}{under} in {engines[0].kind}{before}"
    target = ""
    if "target_points_m" in result.metrics:
        target = f", {display_unit('m').text(float(result.metrics['rmse_m']), 3)} (RMS) from its target"
    return f"{name} {verb} {size(joints)}{at}{under}{target}"


def grasp_words(engine: EngineResult, at: str) -> str:
    """Return the outcome of a task with contact in words; `at` is the actuation in words."""
    measured = engine.result.metrics
    mode, rise, share = (measured.get(name) for name in ("mode", "z_end_m", "success_share"))
    if not mode:
        return f"the scene was simulated{at}"
    parts = [f"the grasp{at} is '{mode}'"]
    if rise is not None:
        parts.append(f"the object ends {display_unit('m').text(float(rise), 3)} above its place")
    if share is not None and "trials" in measured:
        parts.append(f"{100 * float(share):.0f} % of {len(measured['trials']['mode'])} trials hold it")
    return ", ".join(parts)


def _law_error(run: FinishedRun) -> str:
    fits = [d.fit for d in run.designs if d.fit is not None]
    if not fits:
        return "the law is stated by its coefficients"
    worst = max(fit.worst_of_range for fit in fits)
    if any("meta_model" in fit.details for fit in fits):
        return f"law of a meta-model, within {percent(worst)} of FEM on designs left out"
    data = [d.fem for d in run.designs if d.fem is not None]
    source = "the table's states" if data and data[0].design.family == "table" else "FEM"
    return f"law within {percent(worst)} of {source} on states left out"


def _engine_warnings(engine: EngineResult, run: FinishedRun) -> list[Warned]:
    final, law = engine.result.final, run.designs[0].law
    found = []
    if not final.converged:
        left = f"; unbalanced effort {effort_unit(law).text(final.residual, 2)}" if final.at_rest else ""
        found.append(Warned(f"{engine.kind} did not converge{left}."))
    if final.converged and final.stable is False:
        text = f"{engine.kind} settled in an unstable equilibrium: the energy has no minimum there."
        found.append(Warned(text))
    if engine.result.not_reached:
        found.append(Warned(f"{engine.kind}: {engine.result.not_reached}"))
    if final.outside_domain:
        items = []
        entries = sorted(final.outside_domain, key=lambda e: -abs(e.excess))
        for e in entries[:LISTED]:  # actuations are named by their input, joint coordinates by their axis
            actuated = e.variable.endswith(("_pa", "_n")) or e.variable == "actuation"
            unit = actuation_unit(law.actuation_name) if actuated else deformation_unit(law)
            items.append(f"module {e.module}: {e.variable} by {unit.text(e.excess, 3)}")
        places = f"{len(entries)} places" if len(entries) > 1 else "one place"
        sentence = f"{engine.kind} used the law outside its domain at {places}"
        found.append(Warned(sentence + truncation_note(len(entries)) + ".", tuple(items)))
    return found


def _law_warnings(design: DesignResult, named: bool) -> list[Warned]:
    found = []
    prefix = f"{design.name}: " if named else ""
    if design.fit is not None and design.fit.details.get("stable") is False:
        found.append(Warned(f"{prefix}{UNSTABLE_LAW}"))
    data = design.fem if design.module is None else design.module
    return found if data is None else found + data_warnings(data, prefix)
