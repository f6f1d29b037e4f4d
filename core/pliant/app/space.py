"""The robot of the page in space: a measured run as the model has it, coloured by its error where that may be seen."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np

from pliant.app.open_model import OpenModel
from pliant.app.page_state import Effects
from pliant.errors import UserError
from pliant.formatting import unit_of
from pliant.mechanics.held import is_held
from pliant.mechanics.kinematics import ChainGeometry, base_rotations, trajectory
from pliant.records.fem import IntArray
from pliant.records.rollout import Equilibrium, Rollout, TaskResult
from pliant.report.folder import EngineResult, FinishedRun
from pliant.report.scenes.robot import StateError, robot_scene


def space(model: OpenModel, effects: Effects, run: str) -> dict[str, Any]:
    """The scene of a run, as JSON values; its error is shown on runs that a fit may see alone.

    Raises:
        UserError: there is no such run, or it holds nothing that moves.
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
    if np.any(model.measurement.runs[number].history.base_angles_rad):  # shapes stand on the study's own base
        designs = tuple(replace(design, fem=None, module=None) for design in designs)
    shown: FinishedRun = replace(model.as_a_run, designs=designs, engines=tuple(engines))
    scene = robot_scene(shown, _errors(model, effects, number, settled), "the model as it was at first")
    if scene is None:
        raise UserError(f"Run '{run}' has too few samples to move through.")
    found: dict[str, Any] = json.loads(scene.script_data)
    return found


def _history(model: OpenModel, effects: Effects, number: int) -> tuple[Rollout, IntArray]:
    """How the chain goes through a run, and (t,) at which of its samples it has an equilibrium."""
    predictor = model.ground.predictor
    histories, paths = predictor.paths(model.effects(effects))
    history, path, lead = histories[number], paths[number], histories[number].lead
    at = np.flatnonzero(path.converged[lead:]) + lead
    geometry = ChainGeometry.of(predictor.chain)
    bases = base_rotations(geometry.base_rotation, history.base_angles_rad[at])
    clock = np.arange(len(history), dtype=float) if history.time_s is None else history.time_s
    q = path.joint_angles[at]
    driven = np.stack([history.actuation[name] for name in history.actuation], axis=1)[at]
    return Rollout(clock[at] - clock[lead], driven, q, trajectory(geometry, q, bases)), at - lead


def _engine(name: str, history: Rollout) -> EngineResult:
    """A run in time as what an engine leaves."""
    last = Equilibrium(history.joint_angles[-1], history.markers_m[-1], np.nan, True, None, 0, 0.0)
    return EngineResult(name, TaskResult(last, {}, history))


def _errors(model: OpenModel, effects: Effects, number: int, at: IntArray) -> list[StateError]:
    """Of each output that was read in the run, unless the run is put aside."""
    measured, predicted = model.split.training.runs[number].outputs, model.predicted(effects)[number]
    found = []
    for name in model.outputs:
        unit, apart = unit_of(name), np.abs(measured[name] - predicted[name])[at]
        if np.isfinite(apart).any():
            found.append(StateError(f"error of the {unit.label} ({unit.symbol})", unit.factor * apart))
    return found
