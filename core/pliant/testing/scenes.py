"""Scenes with known answers, for checks and for the tests of plugins."""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.config.chain import ChainConfig
from pliant.mechanics.rotations import exp_map
from pliant.pipeline.chain import Segment, build_chain, rod_module
from pliant.records.chain import ChainModel
from pliant.records.design import Array, MassProperties
from pliant.records.law import JointLaw
from pliant.records.rollout import Inputs
from pliant.records.scene import Arm, FreeBody, Scene
from pliant.records.shape import Shape
from pliant.testing.samples import MODULE_LENGTH_M, linear_law

FINGER_RADIUS_M, FINGER_MODULE_KG = 6e-3, 4e-3
PINCH_PRESSURE_PA = 10e3
OBJECT_KG = 0.02
NO_GRAVITY_M_S2 = np.zeros(3)
HALF_TURN = exp_map(np.array([0.0, 0.0, np.pi]))


def sample_box(half_m: tuple[float, float, float] = (0.015, 0.015, 0.015), **changes: Any) -> FreeBody:
    """A uniform box of 20 g with friction 1 at the origin; `changes` are fields of `FreeBody`."""
    a, b, c = half_m
    inertia = OBJECT_KG / 3 * np.diag([b * b + c * c, a * a + c * c, a * a + b * b])
    fields: dict[str, Any] = {
        "name": "box",
        "mass": MassProperties(OBJECT_KG, np.zeros(3), inertia),
        "shapes": (Shape("box", half_m, np.zeros(3), np.eye(3)),),
        "friction": 1.0,
        "position_m": np.zeros(3),
        "rotation": np.eye(3),
    }
    return FreeBody(**{**fields, **changes})


def lopsided_box(**changes: Any) -> FreeBody:
    """A box whose centre of mass is not its origin, with principal axes that are not its own."""
    turn = exp_map(np.array([0.4, -0.3, 0.2]))
    inertia = turn @ np.diag([2e-6, 3e-6, 4e-6]) @ turn.T
    mass = MassProperties(OBJECT_KG, np.array([0.004, -0.002, 0.003]), inertia)
    return sample_box(mass=mass, **changes)


def sample_finger(
    base_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
    law: JointLaw | None = None,
    modules: int = 3,
    facing: Array | None = None,
    **chain: object,
) -> ChainModel:
    """A round finger of 12 mm that hangs from `base_m` and bends toward world +x, or that turned by `facing`."""
    module = rod_module(
        law or linear_law(gain=8e-6, stiffness=0.2), MODULE_LENGTH_M, FINGER_MODULE_KG, FINGER_RADIUS_M
    )
    built = build_chain(ChainConfig.model_validate({"modules": modules, **chain}), [Segment(module, modules)])
    turn = np.eye(3) if facing is None else facing
    return built.with_(base_position_m=np.array(base_m), base_rotation=turn @ built.base_rotation)


def pinch_scene() -> Scene:
    """Two opposed fingers beside a box on a floor; 10 kPa press them to it."""
    left = sample_finger((-0.026, 0.0, 0.05))
    right = sample_finger((0.026, 0.0, 0.05), facing=HALF_TURN)
    box = sample_box(half_m=(0.015, 0.015, 0.02), position_m=np.array([0.0, 0.0, 0.02]))
    return Scene((Arm(left), Arm(right)), (box,), floor_m=0.0)


def pinching(pressure_pa: float = PINCH_PRESSURE_PA) -> tuple[Inputs, Inputs]:
    """Inputs of both fingers of `pinch_scene`."""
    inputs = Inputs({"pressure_pa": pressure_pa})
    return inputs, inputs


def scene_numbers(scene: Scene) -> Array:
    """All arrays of a scene in a row."""
    parts = [scene.gravity_m_s2]
    for arm in scene.arms:
        chain = arm.chain
        parts += [chain.tip_offset_m, chain.base_position_m, chain.base_rotation, chain.gravity_m_s2]
        parts += [a for body in chain.bodies for a in (body.com_m, body.inertia_kg_m2)]
        parts += [
            a for shapes in chain.shapes for shape in shapes for a in (shape.position_m, shape.rotation)
        ]
    for one in scene.objects:
        parts += [one.position_m, one.rotation, one.mass.com_m, one.mass.inertia_kg_m2]
        parts += [a for shape in one.shapes for a in (shape.position_m, shape.rotation)]
    return np.concatenate([np.ravel(part) for part in parts])
