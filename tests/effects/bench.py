"""Helpers of the tests of effects: an effect by its kind, on a model or a chain, and the motion in engines."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pliant.interfaces.effect import Effect, Model
from pliant.interfaces.physics import PhysicsBackend
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.rollout import Equilibrium, Inputs
from pliant.registry.discovery import discover

REGISTRY = discover()
NO_GRAVITY = (0, 0, 0)


def effect(kind: str, **values: Any) -> Effect:
    """Return an effect with these parameters and the others at their defaults."""
    component = REGISTRY.get("effect", kind)
    made: Effect = component.build(component.config_model().model_validate({"kind": kind, **values}))
    return made


def model_with(plain: Model | ChainModel, kind: str, **values: Any) -> Model:
    return effect(kind, **values).apply(plain if isinstance(plain, Model) else Model(plain))


def chain_with(plain: ChainModel, kind: str, **values: Any) -> ChainModel:
    return model_with(plain, kind, **values).chain


def engine(kind: str = "quasistatic", **options: Any) -> PhysicsBackend:
    """Return an engine by its kind; skip the test where its package is not installed."""
    component = REGISTRY.get("physics", kind)
    if component.missing():
        pytest.skip(f"{kind} is not installed")
    made: PhysicsBackend = component.build(component.config_model()(kind=kind, **options))
    return made


ENGINE = engine()


def followed(chain: ChainModel, *histories: History, by: PhysicsBackend = ENGINE) -> list[Array]:
    """Return (t, n) main angles of the joints along each history, all converged."""
    runs, _ = by.follow(chain, histories)
    assert all(run.converged.all() for run in runs)
    return [run.joint_angles[:, :, 0] for run in runs]


def settled(chain: ChainModel, kind: str = "quasistatic", pressure: float = 9e3, **loads: Any) -> Equilibrium:
    with engine(kind).build(chain) as simulation:
        simulation.apply(Inputs({"pressure_pa": pressure}, **loads))
        return simulation.settle()


def stepped(chain: ChainModel, history: History, step_s: float) -> Array:
    """Return (t, n, a) joint coordinates by `settle` and `step`: Newton in all joints, another implementation."""
    positions = []
    with ENGINE.build(chain) as simulation:
        for k in range(len(history)):
            simulation.apply(history.at(k))
            if k:
                simulation.step(step_s)
            else:
                simulation.settle()
            positions.append(simulation.snapshot().position)
    return np.array(positions)
