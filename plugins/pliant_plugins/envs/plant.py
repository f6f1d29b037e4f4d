"""What an environment controls: the chain of a study in its engine, and the range of its actuation."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pliant.api import DEFAULT_STORE, OpenStudy, open_study
from pliant.errors import UserError
from pliant.interfaces.physics import PhysicsBackend
from pliant.pipeline.motion import highest_actuation, prepared_chain
from pliant.pipeline.study import DEFAULT_PHYSICS, StudyRun, laws_of_study
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
        chain, backend, task = prepared_chain(bench, loaded)
        if not backend.capabilities.dynamic:
            raise UserError(
                f"an environment steps through time and physics '{backend.config.kind}' has equilibria only; "
                "use 'mujoco' or 'pybullet' in the study."
            )
        names = tuple(dict.fromkeys(actuator.input for actuator in chain.actuators))
        top = highest_actuation(loaded, chain) if actuation_max is None else actuation_max
        if not (np.isfinite(top) and top > 0):
            raise UserError(f"actuation_max is {top}; it needs a positive number of Pa or N.")
        return Plant(opened, chain, backend, task, names, np.full(len(names), float(top)))

    @property
    def equilibria(self) -> PhysicsBackend:
        """The engine that finds equilibria, with its defaults."""
        component = self.opened.bench.registry.get("physics", DEFAULT_PHYSICS)
        built: PhysicsBackend = component.build(component.config_model()(kind=DEFAULT_PHYSICS))
        return built

    def drawn(self) -> StudyRun:
        """What the drawing of the chain is made from."""
        return StudyRun(self.opened.study, laws_of_study(self.opened.bench, self.opened.study))

    def actuation(self, share: Array) -> dict[str, float]:
        """Inputs at shares (k,) of their highest values."""
        return dict(zip(self.names, (share * self.highest).tolist(), strict=True))


def _store() -> Path:
    return Path(os.environ.get("PLIANT_STORE") or DEFAULT_STORE)
