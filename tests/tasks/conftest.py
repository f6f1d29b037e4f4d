"""The published gripper's finger with a stated law, and grasp tasks by keys of a study."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from typing import Any

import pytest

from pliant.config.chain import ChainConfig
from pliant.interfaces.physics import PhysicsBackend
from pliant.pipeline.chain import Segment, build_chain, family_module, module_like, rigid_rod
from pliant.records.chain import ChainModel
from pliant.registry.discovery import discover
from pliant_plugins.tasks.grasp.config import GraspConfig
from pliant_plugins.tasks.grasp.task import Grasp

REGISTRY = discover()
HAS_PYBULLET = importlib.util.find_spec("pybullet") is not None


def built(interface: str, kind: str, **settings: Any) -> Any:
    component = REGISTRY.get(interface, kind)
    given = settings or component.smallest_block()
    return component.build(component.config_model().model_validate({"kind": kind, **given}))


@pytest.fixture(scope="session")
def finger() -> ChainModel:
    """Return a rigid base, six modules with the law of docs/conventions.md, and a closed end."""
    law = built("surrogate", "polynomial").stated()
    module = family_module(law, built("family", "bellow_bending"), 1150.0)
    segments = [
        Segment(rigid_rod(6.5e-3, 0.0)),
        Segment(module, 6),
        Segment(module_like(module, 14e-3)),
    ]
    return build_chain(ChainConfig(modules=6), segments)


@pytest.fixture
def grasp() -> Callable[..., Grasp]:
    return lambda **keys: Grasp(GraspConfig.model_validate({"pressure": "15 kPa", "object": "egg", **keys}))


@pytest.fixture
def mujoco() -> PhysicsBackend:
    return built("physics", "mujoco")


@pytest.fixture
def pybullet() -> PhysicsBackend:
    if not HAS_PYBULLET:
        pytest.skip("pybullet is not installed (it has wheels for Python up to 3.11 only)")
    return built("physics", "pybullet")
