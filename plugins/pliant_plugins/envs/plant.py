"""What an environment controls: the chain of a study in its engine, and the range of its actuation."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pliant.api import DEFAULT_STORE, OpenStudy, open_study
from pliant.errors import UserError
from pliant.interfaces.effect import Model
from pliant.interfaces.physics import PhysicsBackend
from pliant.pipeline.simulate import check_capabilities, check_terms
from pliant.pipeline.study import StudyRun, chain_of_study, laws_of_study, physics_of_study
from pliant.records.chain import ChainModel
from pliant.records.design import Array

STUDIES = Path(__file__).parent / "studies"


@dataclass(frozen=True, eq=False)
class Plant:
    """A study's chain and engine.

    Attributes:
        opened: the study.
        chain: with the task's own loads and the effects applied.
        backend: its engine.
        task: the built task, or None.
        names: the chain's inputs.
        highest: (k,) what action +1 means for each of them; −1 is 0.
    """

    opened: OpenStudy
    chain: ChainModel
    backend: PhysicsBackend
    task: Any
    names: tuple[str, ...]
    highest: Array

    @staticmethod
    def of(study: str | Path | None, default: str, actuation_max: float | None) -> Plant:
        """The plant of a study file, or of the default of this name.

        Args:
            study: path of a study; None takes `studies/<default>.yaml`.
            default: name of the default study.
            actuation_max: highest pressure (Pa) or tendon force (N); None takes the task's, else the law's domain.

        Raises:
            UserError: the study is wrong, or nothing says how far the actuation goes.
        """
        opened = open_study(study or STUDIES / f"{default}.yaml", store=_store())
        bench, loaded = opened.bench, opened.study
        chain = chain_of_study(bench, loaded).chain
        physics = physics_of_study(bench, loaded)
        backend: PhysicsBackend = bench.build("physics", physics)
        if not backend.capabilities.dynamic:
            raise UserError(
                f"an environment steps through time and physics '{physics.kind}' has equilibria only; "
                "use 'mujoco' or 'pybullet' in the study."
            )
        check_capabilities(backend, chain, physics.kind)
        task = bench.build("task", loaded.task) if loaded.task is not None else None
        model = Model(chain if task is None else task.prepare(chain))
        for effect in loaded.effects:
            model = bench.build("effect", effect).apply(model)
        check_terms(backend, model.chain)
        if model.inputs:
            raise UserError(
                "effects on the input are not followed in environments: leave them out of 'effects'."
            )
        names = tuple(dict.fromkeys(actuator.input for actuator in chain.actuators))
        highest = np.full(len(names), _highest(actuation_max, loaded.task, chain))
        return Plant(opened, model.chain, backend, task, names, highest)

    def drawn(self) -> StudyRun:
        """What the drawing of the chain is made from."""
        return StudyRun(self.opened.study, laws_of_study(self.opened.bench, self.opened.study))

    def actuation(self, share: Array) -> dict[str, float]:
        """Inputs at shares (k,) of their highest values."""
        return dict(zip(self.names, (share * self.highest).tolist(), strict=True))


def _store() -> Path:
    return Path(os.environ.get("PLIANT_STORE") or DEFAULT_STORE)


def _highest(given: float | None, task: Any, chain: ChainModel) -> float:
    stated = [getattr(task, name, None) for name in ("pressure_pa", "tendon_force_n")]
    limits = [law.domain.actuation[1] for law in chain.laws]
    for value in (given, *stated, min(limits)):
        if value is not None and np.isfinite(value) and value > 0:
            return float(value)
    raise UserError(
        "nothing says how far the actuation goes: give the environment 'actuation_max' (Pa or N), "
        "or the study a task with a pressure."
    )
