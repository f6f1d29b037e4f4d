"""Stage results as JSON (docs/command_line.md) and as lines for people."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pliant.cli import meta_models
from pliant.formatting import actuation_unit, deformation_unit, display_unit, fixed, quantity, seconds
from pliant.pipeline.study import DesignStages, EngineRun
from pliant.records.fem import PASSED, SELF_CONTACT, FemDataset, ModuleData
from pliant.records.rollout import TaskResult
from pliant.store.store import Artifact

UNSTABLE_LAW = (
    "UNSTABLE: ∂τ/∂u ≥ 0 somewhere in its domain, so a joint may snap. In a table from elsewhere, moment_n_m must "
    "be the external moment that opposes actuation (is the sign reversed?)."
)


def stage(artifact: Artifact) -> dict[str, Any]:
    """Where a result came from."""
    manifest = artifact.manifest
    return {
        "stage": manifest["stage"],
        "key": artifact.key,
        "cached": artifact.cached,
        "wall_s": manifest["wall_s"],
    }


def fem(artifacts: Sequence[Artifact], tables: Sequence[str]) -> dict[str, Any]:
    """The `fem` result."""
    data: list[ModuleData] = [a.value for a in artifacts]
    return {
        "n_states": sum(len(d) for d in data),
        "failed": [dict(f) for d in data for f in d.failed],
        "self_contact": sum(int(np.sum(d.status == SELF_CONTACT)) for d in data),
        "passed_through": sum(int(np.sum(d.status == PASSED)) for d in data),
        "wall_s": sum(a.manifest["wall_s"] for a in artifacts),
        "newton_steps": sum(int(d.iterations.sum()) for d in data),
        "axes": _of_axes(data[0]) if len(data) == 1 else [_of_axes(d) for d in data],
        "csv": tables[0] if len(tables) == 1 else list(tables),
        "stages": [stage(a) for a in artifacts],
    }


def _of_axes(data: ModuleData) -> dict[str, dict[str, Any]]:
    """By axis, how many states it has and what adaptive sampling states of its law's error."""
    found: dict[str, dict[str, Any]] = {}
    for axis in data.explored_axes():
        record = _record(data, axis)
        told = ("error", "stated_error", "reached", "check_error", "symmetric")
        count = {"n_states": int(np.sum(data.explored == axis))}
        found[axis] = {**count, **{key: record[key] for key in told if key in record}}
    return found


def _record(data: ModuleData, axis: str) -> Mapping[str, Any]:
    """What the sampler recorded of an axis."""
    records = data.sampling.get("axes")
    found = records.get(axis, {}) if isinstance(records, Mapping) else {}
    return found if isinstance(found, Mapping) else {}


def fem_lines(artifacts: Sequence[Artifact]) -> list[str]:
    """The `fem` result for people."""
    lines = []
    for artifact in artifacts:
        whole: ModuleData = artifact.value
        check, contact = int(np.sum(whole.role == "check")), int(np.sum(whole.status == SELF_CONTACT))
        passed = int(np.sum(whole.status == PASSED))
        through = f"{passed} passed through, " if passed else ""
        d = whole.axis(whole.main_axis)
        lines.append(
            f"FEM      {len(whole)} states ({check} never fitted, {contact} with self-contact, {through}"
            f"{len(whole.failed)} failed), {_largest_free(d)}, {_time(artifact)}"
        )
        lines += [f"         {line}" for line in (*_axis_lines(whole), _cost_line(whole)) if line]
    return lines


def _largest_free(data: FemDataset) -> str:
    """How far the free branch goes, and at which pressure or force."""
    free = data.branch == "free"
    most, level = float(data.angle_rad[free].max()), float(data.actuation[free].max())
    word, decimals = ("extension", 3) if data.joint == "prismatic" else ("angle", 2)
    unit = deformation_unit(data)
    reached = unit.attached(fixed(most * unit.factor, decimals))
    return f"free {word} {reached} at {actuation_unit(data.actuation_name).text(level, 6)}"


def _axis_lines(data: ModuleData) -> list[str]:
    """States of each axis, and the error that adaptive sampling states; nothing to say of one axis on a grid."""
    lines = []
    for axis in data.explored_axes():
        said = _stated(_record(data, axis))
        if len(data.axes) > 1:
            count = int(np.sum(data.explored == axis))
            lines.append(f"axis {axis}: {count} states{f', {said}' if said else ''}")
        elif said:
            lines.append(said)
    if together := int(np.sum(data.explored == "coupling")):
        lines.append(f"all axes held: {together} state{'s' * (together > 1)}")
    return lines


def _stated(record: Mapping[str, Any]) -> str:
    """The stated error and whether it is as small as wanted; empty where no error was stated."""
    if "stated_error" not in record:
        return ""
    stated, wanted = record["stated_error"], f"{100 * record['error']:.2g} %"
    if stated is None:
        return f"error not stated: too few states for it (wanted {wanted})"
    text = f"stated error {100 * stated:.2g} % of the effort's range"
    if record["reached"]:
        return f"{text} (wanted {wanted})"
    if stated <= record["error"]:
        return f"{text}, NOT TESTED by enough good predictions (wanted {wanted})"
    return f"{text}, NOT REACHED (wanted {wanted})"


def _cost_line(data: ModuleData) -> str:
    """Time and Newton steps of a state; copies by symmetry took none."""
    solved = (data.wall_s > 0) | (data.iterations > 0)
    if not solved.any():
        return ""
    wall, steps = data.wall_s[solved], data.iterations[solved]
    return (
        f"{wall.mean():.2g} s and {steps.mean():.2g} Newton steps for a state, {wall.max():.2g} s and "
        f"{int(steps.max())} at most"
    )


def fit(design: DesignStages) -> dict[str, Any]:
    """The `fit` result of one design."""
    law, report = design.law.law, design.law.report
    record = law.record()
    result: dict[str, Any] = {
        "kind": record.kind,
        "parameters": {**record.values, **record.arrays},
        "domain": {"actuation": law.domain.actuation, "deformation": law.domain.deformation},
        "wall_s": design.law.artifact.manifest["wall_s"] if design.law.artifact else 0.0,
    }
    if report is not None:
        result["heldout"] = {
            "rmse": report.rmse,
            "worst": report.worst,
            "worst_of_range": report.worst_of_range,
            "r2": report.r2,
            "n": report.n_heldout,
        }
        result["n_fitted"] = report.n_fitted
        result["study_form"] = report.details.get("study_form")
        result["stable"] = report.details.get("stable")
        if "meta_model" in report.details:
            result |= meta_models.of_law(design)
        result["stated_axes"] = report.details.get("stated_axes", [])
    if design.law.artifact is not None:
        result["stages"] = [stage(design.law.artifact)]
    return result


def fit_lines(design: DesignStages) -> list[str]:
    """The `fit` result for people."""
    report = design.law.report
    if report is None or design.law.artifact is None:
        return ["law      stated by its coefficients"]
    if "meta_model" in report.details:
        return meta_models.law_lines(design)
    lines = [
        f"law      worst error {100 * report.worst_of_range:.2g} % of the range on {report.n_heldout} states "
        f"left out ({report.n_fitted} fitted), {_r2(report.r2)}{_time(design.law.artifact)}"
    ]
    if stated := report.details.get("stated_axes"):
        lines.append(f"         stated, not fitted: axis {' and '.join(stated)}")
    study_form = report.details.get("study_form")
    if study_form and "worst_of_range" in study_form:
        lines.append(f"         the study's form: {100 * study_form['worst_of_range']:.2g} %")
    if report.details.get("stable") is False:
        lines.append(f"         {UNSTABLE_LAW}")
    return lines


def simulation(engine: EngineRun) -> dict[str, Any]:
    """The `simulate` result of one engine."""
    if engine.artifact is None:
        return {"kind": engine.kind, "skipped": engine.skipped}
    result: TaskResult = engine.artifact.value
    final = result.final
    return {
        "kind": engine.kind,
        "tip_m": final.tip_m,
        "markers_m": final.markers_m,
        "joint_angles_rad": final.joint_angles[:, 0]
        if final.joint_angles.shape[1] == 1
        else final.joint_angles,
        "converged": final.converged,
        "stable": final.stable,
        "residual": final.residual,
        "wall_s": final.wall_s,
        "outside_domain": [vars(entry) for entry in final.outside_domain],
        "not_reached": result.not_reached,
        "metrics": result.metrics,
        "stages": [stage(engine.artifact)],
    }


def uncertainty(artifact: Artifact) -> dict[str, Any]:
    """What the laws' error bars come to at the tip, for JSON."""
    return {**artifact.value, "stages": [stage(artifact)]}


def uncertainty_line(artifact: Artifact) -> str:
    """The same for people."""
    told = artifact.value
    if told["failed"] == told["samples"]:
        return f"error bar    none of {told['samples']} runs with drawn laws settled"
    failed = f", {told['failed']} did not settle" if told["failed"] else ""
    return (
        f"error bar    the tip lies within {quantity(told['tip_radius_m'], 'm', 3)} ({100 * told['level']:g} % of "
        f"{told['samples']} runs with laws drawn from their error bars{failed}), {_time(artifact)}"
    )


def largest_distance_m(engines: Sequence[EngineRun]) -> float | None:
    """Largest distance of a marker between the first engine and any other that ran."""
    markers = [e.result.final.markers_m for e in engines if e.result is not None]
    if len(markers) < 2:
        return None
    return float(max(np.linalg.norm(m - markers[0], axis=1).max() for m in markers[1:]))


def simulation_lines(engine: EngineRun) -> list[str]:
    """The `simulate` result for people."""
    if engine.artifact is None:
        return [f"{engine.kind:<12} skipped: {engine.skipped}"]
    result: TaskResult = engine.artifact.value
    length = display_unit("m")
    x, y, z = length.factor * result.final.tip_m
    state = "settled" if result.final.converged else "NOT CONVERGED"
    if result.final.stable is False:
        state += " (UNSTABLE: the energy has no minimum there)"
    if result.stills:  # contact holds the arms: their tips and residuals say little
        numbers = [f"{name} {v:.4g}" for name, v in result.metrics.items() if isinstance(v, float)]
        if "mode" in result.metrics:
            grasped = ("z_end_m", "success_share")
            numbers = [f"{result.metrics['mode']}", *(n for n in numbers if n.startswith(grasped))]
        lines = [f"{engine.kind:<12} {', '.join((*numbers[:3], _time(engine.artifact)))}"]
    else:
        lines = [
            f"{engine.kind:<12} tip ({x:.3f}, {y:.3f}, {z:.3f}) {length.symbol}, {state}, residual "
            f"{result.final.residual:.1e}, {_time(engine.artifact, result.final.wall_s)}"
        ]
    outside = result.final.outside_domain
    if outside:
        worst = max(outside, key=lambda entry: abs(entry.excess))
        places = f"{len(outside)} places, worst" if len(outside) > 1 else "one place"
        lines.append(f"             outside the law's domain at {places}: module {worst.module}, {worst}")
    if result.not_reached:
        lines.append(f"             NOT REACHED: {result.not_reached}")
    return lines


def metric_lines(metrics: Mapping[str, Any]) -> list[str]:
    """A task's metrics for people; curves and tables stand in the JSON result."""
    return [f"  {name:<24} {_metric(value)}" for name, value in metrics.items() if not _is_table(value)]


def _is_table(value: Any) -> bool:
    items = value.values() if isinstance(value, Mapping) else value if isinstance(value, list) else ()
    return any(isinstance(item, list) for item in items)


def _metric(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(_metric(item) for item in value)
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_metric(item)}" for name, item in value.items())
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.6g}" if isinstance(value, float) else f"{value}"


def _r2(r2: float) -> str:
    return f"R² {r2:.7g}, " if math.isfinite(r2) else ""  # one state, or states of one moment, have none


def _time(artifact: Artifact, wall_s: float | None = None) -> str:
    """Time of the stage, or of the part of it that is given: a chain's equilibria without what was compiled."""
    wall = artifact.manifest["wall_s"] if wall_s is None else wall_s
    return f"{seconds(wall)}, from the store" if artifact.cached else seconds(wall)
