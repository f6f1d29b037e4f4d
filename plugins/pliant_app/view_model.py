"""JSON values of a model and of recordings for the page, the points of its pictures, and the robot in motion.

Points are readings and circumstances, sample by sample, in display units. In three dimensions the robot follows the
model's prediction of a measured run, coloured by its error except on held-out runs.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant import api
from pliant.diagnosis.noise import NoiseView
from pliant.errors import PliantError, UserError
from pliant.evidence.comparison import Comparison
from pliant.evidence.comparison_sentences import interpret
from pliant.evidence.covariates import Covariate, covariates
from pliant.evidence.prediction import Predictor
from pliant.evidence.scores import run_words
from pliant.formatting import display_unit, output_unit
from pliant.mechanics.kinematics import ChainGeometry, base_rotations, trajectory
from pliant.mechanics.prescribed import is_held
from pliant.pipeline.run_folder import EngineResult, FinishedRun
from pliant.records.design import Array
from pliant.records.fem import IntArray
from pliant.records.rollout import Equilibrium, Rollout, TaskResult
from pliant.report.evidence_view import thin
from pliant.report.scenes.robot import StateError, robot_scene
from pliant_app import work
from pliant_app.folder import SessionFolder, result_key
from pliant_app.open_model import OpenModel
from pliant_app.page_state import Effects, PageState, PageStep
from pliant_app.unseen_runs import doubts_by_hand, doubts_undiagnosed


def shown(
    model: OpenModel, state: PageState, folder: SessionFolder, effects: list[dict[str, Any]]
) -> dict[str, Any]:
    """Return everything of a model except its curves, as JSON values.

    Args:
        model: the open model, without the readings that are switched off.
        state: of the session.
        folder: of the session, with its results.
        effects: those that can be ticked (`screening.catalogue`).
    """
    now = state.now
    predicted = model.predicted(now.effects)
    noise = model.noise(predicted)
    diagnosis = folder.result(result_key("diagnose", model.key, now.effects))
    earlier = None if diagnosis else _last_diagnosis(model, state, folder)
    of_study = folder.result(result_key("diagnose", model.key, model.own_effects))
    result = folder.result(now.result) if now.result else None
    own = {effect.kind for effect in model.study.effects}
    added = [str(one["kind"]) for one in now.effects if one["kind"] not in own]
    warnings = list(result["warnings"]) if result else []
    warnings += work.diagnosis_doubts(added, of_study) if of_study else []
    if result is None:
        warnings += doubts_by_hand(model, now.effects, added, noise)
    fitted = list(result["kinds"]) if result and result["what"] == "fit" else []
    if not of_study and (fitted or not warnings):
        warnings += doubts_undiagnosed(model, now.effects, added or fitted, noise)
    return {
        "name": model.study.name,
        "source": model.measurement.source,
        "doubts": [doubt.sentence for doubt in model.measurement.doubts],
        "study_doubts": list(model.doubts),
        "aside": model.split.why,
        "effects": now.effects,
        "first": model.own_effects,
        "own": sorted(own),
        "off": list(now.off),
        "catalogue": effects,
        "cursor": state.cursor,
        "steps": [
            {
                "words": step.words,
                "fitted": bool(step.result),
                "effects": step.effects,
                **_score(model, step, noise),
            }
            for step in state.steps
        ],
        "fit": result,
        "warnings": warnings,
        "diagnosis": diagnosis,
        "earlier": earlier,
        "judged": noise.judged,
    }


def _last_diagnosis(model: OpenModel, state: PageState, folder: SessionFolder) -> dict[str, Any] | None:
    """Return the diagnosis of the last earlier step that has one, with the index of that step, from 0."""
    for k in range(state.cursor - 1, -1, -1):
        step = state.steps[k]
        if step.data == state.data and (
            found := folder.result(result_key("diagnose", model.without(step.off).key, step.effects))
        ):
            return {"step": k, "words": step.words, "found": found}
    return None


def _score(model: OpenModel, step: PageStep, noise: NoiseView) -> dict[str, Any]:
    """Return the errors of a step over the present floor on the present runs, so that steps can be compared."""
    try:
        predicted = model.predicted(step.effects)
    except PliantError:
        return {"error": None, "aside": None}
    errors = model.errors(predicted, noise)
    return {"error": errors.fitted, "aside": errors.aside}


def recording(data: Sequence[str]) -> dict[str, Any] | None:
    """Return how dropped recordings are understood while no study reads them."""
    if not data:
        return None
    try:
        measurement, document = api.read([str(one) for one in data], {})
    except PliantError as error:
        return {"refused": str(error)}
    return {
        "sentence": document.sentence,
        "doubts": [doubt.sentence for doubt in measurement.doubts],
        "columns": [
            {"heading": one["heading"], "unit": one["unit"], "name": one["name"]}
            for one in document.data["columns"]
        ],
    }


def failing(comparison: Comparison) -> dict[str, Any]:
    """Return where a model fails, in words and as a table."""
    return {
        "sentence": interpret(comparison),
        "runs": {run.name: run.rmse_over_floor for run in comparison.runs},
        "places": [
            {
                "condition": place.condition,
                "share": place.share_of_error,
                "readings": place.share_of_samples,
                "significant": place.significant,
            }
            for place in comparison.worst
        ],
        "depends_on": [
            {
                "words": " × ".join(comparison.labels.get(p, p) for p in name.split(" × ")),
                "share": share,
            }
            for name, share in list(comparison.depends_on.items())[:6]
        ],
        "remarks": list(comparison.remarks),
    }


MOST_POINTS = 9000  # of all runs together
GAP = 0.04  # between two runs on the time axis, relative to the mean length of a run


def curves(model: OpenModel, predicted: Sequence[Mapping[str, Array]]) -> dict[str, Any]:
    """Return what the pictures show in addition to the prediction.

    Args:
        model: the open model.
        predicted: of any model, for circumstances that depend on the prediction.
    """
    runs, aside = model.measurement.runs, set(model.split.runs)
    places = _places(model)
    found = covariates(model.read, predicted)
    words = run_words(found, len(runs))
    clocks = [_clock(run.history.time_s, len(run)) for run in runs]
    gap = GAP * float(np.mean([clock[-1] for clock in clocks if len(clock)] or [1.0]))
    starts = np.cumsum([0.0, *(float(clock[-1]) + gap for clock in clocks)])
    timed = all(run.history.time_s is not None for run in runs)
    inputs = dict.fromkeys(name for run in runs for name in run.history.actuation)
    return {
        "runs": [
            {
                "name": run.name,
                "words": ", ".join(said),
                "aside": k in aside,
                "off": run.name in model.off,
                "points": len(at),
                "samples": len(run),
            }
            for k, (run, said, at) in enumerate(zip(runs, words, places, strict=True))
        ],
        "time": _joined([c + s for c, s in zip(clocks, starts, strict=False)], places),
        "time_label": f"time, runs one after another ({display_unit('s').symbol})" if timed else "sample",
        "outputs": [
            {
                "name": name,
                "label": output_unit(name).label,
                "axis": output_unit(name).axis,
                "unit": output_unit(name).symbol,
                "measured": _joined([output_unit(name).factor * run.outputs[name] for run in runs], places),
            }
            for name in model.outputs
        ],
        "circumstances": [
            *(_input(name, [run.input(name) for run in runs], places) for name in inputs),
            *(_circumstance(item, places) for item in found.items if item.name not in inputs),
        ],
    }


def predicted_points(model: OpenModel, predicted: Sequence[Mapping[str, Array]]) -> dict[str, str]:
    """Return each output at the shown points, in its display unit: float32, little-endian, in base 64."""
    places = _places(model)
    found = {}
    for name in model.outputs:
        factor = output_unit(name).factor
        values = [factor * run[name][at] for run, at in zip(predicted, places, strict=True)]
        found[name] = base64.b64encode(np.concatenate(values).astype("<f4").tobytes()).decode()
    return found


def _places(model: OpenModel) -> list[NDArray[np.int64]]:
    """Return the indices of the shown samples of each run."""
    runs = model.measurement.runs
    total = sum(map(len, runs))
    share = min(1.0, MOST_POINTS / max(total, 1))
    return [thin(len(run), max(int(share * len(run)), 2)) for run in runs]


def _clock(time_s: Array | None, count: int) -> Array:
    if time_s is None or not count:
        return np.arange(float(count)) if count else np.zeros(1)
    return np.asarray(display_unit("s").factor * (time_s - time_s[0]))


def _joined(series: Sequence[Array], places: Sequence[NDArray[np.int64]]) -> list[float | None]:
    """Return the values at the shown points, one run after another, with None for missing values."""
    values = np.concatenate([np.asarray(v, float)[at] for v, at in zip(series, places, strict=True)])
    short = np.array([float(f"{v:.6g}") for v in values])
    return [v if np.isfinite(v) else None for v in short.tolist()]


def _input(name: str, values: Sequence[Array], places: Sequence[NDArray[np.int64]]) -> dict[str, Any]:
    unit = output_unit(name)
    return {
        "name": name,
        "label": unit.label,
        "axis": unit.axis,
        "unit": unit.symbol,
        "categories": [],
        "drives": True,
        "values": _joined([unit.factor * v for v in values], places),
    }


def _circumstance(item: Covariate, places: Sequence[NDArray[np.int64]]) -> dict[str, Any]:
    factor = item.shown.factor if item.numeric else 1.0
    return {
        "name": item.name,
        "label": item.shown.label,
        "axis": item.shown.axis,
        "unit": item.shown.symbol if item.numeric else "",
        "categories": list(item.categories),
        "drives": False,
        "values": _joined([factor * v for v in item.values], places),
    }


def space(model: OpenModel, effects: Effects, run: str) -> dict[str, Any]:
    """Return the scene of a run as JSON values; its error is shown only on training runs.

    Raises:
        UserError: there is no such run, or nothing moves in it.
    """
    names = [one.name for one in model.measurement.runs]
    if run not in names:
        raise UserError(f"there is no run '{run}' here.")
    if any(is_held(one.history) for one in model.measurement.runs):
        raise UserError("The bench holds the joint in these runs: the robot stands still, and pushes.")
    number = names.index(run)
    now, settled = _history(model, effects, number)
    engines = [_engine("model", now)]
    if effects != model.own_effects:
        first, _ = _history(model, model.own_effects, number)
        if first.markers_m.shape == now.markers_m.shape:
            engines.append(_engine("as it was", first))
    designs = model.as_a_run.designs
    if np.any(model.measurement.runs[number].history.base_angles_rad):  # shapes are on the study's own base
        designs = tuple(replace(design, fem=None, module=None) for design in designs)
    shown: FinishedRun = replace(model.as_a_run, designs=designs, engines=tuple(engines))
    scene = robot_scene(
        shown, _errors_on_the_way(model, effects, number, settled), "the model as it was at first"
    )
    if scene is None:
        raise UserError(f"Run '{run}' has too few samples to move through.")
    found: dict[str, Any] = json.loads(scene.script_data)
    return found


def _history(model: OpenModel, effects: Effects, number: int) -> tuple[Rollout, IntArray]:
    """Return the chain's motion through a run, and (t,) the samples at which it has an equilibrium."""
    predictor = model.ground.predictor
    if not isinstance(predictor, Predictor):
        raise UserError("The model is not a chain of modules, whose motion this page draws.")
    histories, paths = predictor.paths(model.effects(effects))
    history, path, lead = histories[number], paths[number], histories[number].lead
    at = np.flatnonzero(path.converged[lead:]) + lead
    geometry = ChainGeometry.from_chain(predictor.chain)
    bases = base_rotations(geometry.base_rotation, history.base_angles_rad[at])
    clock = np.arange(len(history), dtype=float) if history.time_s is None else history.time_s
    q = path.joint_angles[at]
    driven = np.stack([history.actuation[name] for name in history.actuation], axis=1)[at]
    return Rollout(clock[at] - clock[lead], driven, q, trajectory(geometry, q, bases)), at - lead


def _engine(name: str, history: Rollout) -> EngineResult:
    """Return a run in time in the form of an engine's result."""
    last = Equilibrium(history.joint_angles[-1], history.markers_m[-1], np.nan, True, None, 0, 0.0)
    return EngineResult(name, TaskResult(last, {}, history))


def _errors_on_the_way(model: OpenModel, effects: Effects, number: int, at: IntArray) -> list[StateError]:
    """Return the error of each output that was read in the run; empty for a held-out run."""
    measured, predicted = model.split.training.runs[number].outputs, model.predicted(effects)[number]
    found = []
    for name in model.outputs:
        unit, apart = output_unit(name), np.abs(measured[name] - predicted[name])[at]
        if np.isfinite(apart).any():
            found.append(StateError(f"error of the {unit.label} ({unit.symbol})", unit.factor * apart))
    return found
