"""A simulation in a user's hands: what `pliant view` offers as sliders."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pliant.config.study import Study
from pliant.errors import UserError
from pliant.interfaces.effect import Model
from pliant.interfaces.physics import PhysicsBackend, Simulation
from pliant.interfaces.viewer import Handle
from pliant.pipeline.motion import chain_frames
from pliant.pipeline.simulate import check_capabilities, check_terms
from pliant.pipeline.study import chain_of_study, physics_of_study
from pliant.pipeline.workbench import Workbench
from pliant.records.chain import ChainModel
from pliant.records.rollout import Inputs
from pliant.records.scene import SceneFrames

DRIVES = ("pressure_pa", "tendon_force_n")


class ChainHandle(Handle):
    """A chain's inputs from 0 to their highest values; loads stay the task's."""

    def __init__(self, simulation: Simulation, highest: float) -> None:
        self.simulation = simulation
        names = dict.fromkeys(actuator.input for actuator in simulation.chain.actuators)
        self._limits = dict.fromkeys(names, (0.0, highest))
        self._time_s = 0.0

    @property
    def inputs(self) -> Mapping[str, tuple[float, float]]:
        return self._limits

    def advance(self, values: Mapping[str, float], duration_s: float) -> SceneFrames:
        held = {name: float(np.clip(values[name], *limits)) for name, limits in self._limits.items()}
        self.simulation.apply(Inputs(held))
        self.simulation.step(duration_s)
        self._time_s += duration_s
        return chain_frames(np.array([self._time_s]), self.simulation.snapshot().position[None])


def prepared_chain(bench: Workbench, study: Study) -> tuple[ChainModel, PhysicsBackend, Any]:
    """The study's chain with its task's loads and its effects, its engine, and its task (None without one).

    Raises:
        UserError: the engine cannot simulate it, or effects act on the input.
    """
    chain = chain_of_study(bench, study).chain
    physics = physics_of_study(bench, study)
    backend: PhysicsBackend = bench.build("physics", physics)
    check_capabilities(backend, chain, physics.kind)
    task = bench.build("task", study.task) if study.task is not None else None
    model = Model(chain if task is None else task.prepare(chain))
    for effect in study.effects:
        model = bench.build("effect", effect).apply(model)
    check_terms(backend, model.chain)
    if model.inputs:
        raise UserError("effects on the input are not followed here: leave them out of 'effects'.")
    return model.chain, backend, task


def highest_actuation(study: Study, chain: ChainModel) -> float:
    """The task's pressure or tendon force, else the highest value for which all laws hold.

    Raises:
        UserError: nothing says how far the actuation goes.
    """
    stated = [getattr(study.task, name, None) for name in DRIVES]
    for value in (*stated, min(law.domain.actuation[1] for law in chain.laws)):
        if value is not None and np.isfinite(value) and value > 0:
            return float(value)
    raise UserError(
        "nothing says how far the actuation goes: give the study a task with a pressure, or its law a 'domain'."
    )
