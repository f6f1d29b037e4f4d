"""Where the fingers stand, and the scene of one trial."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.errors import UserError
from pliant.mechanics.kinematics import ChainGeometry
from pliant.mechanics.rotations import exp_map
from pliant.meshing.surfaces import support
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.scene import Arm, Scene
from pliant_plugins.tasks.grasp.config import GraspConfig
from pliant_plugins.tasks.grasp.objects import GraspObject, default_inset_m

DOWN = np.array([0.0, 0.0, -1.0])


@dataclass(frozen=True, eq=False)
class Draw:
    """What noise does in one trial: factor of the friction, offsets of the pressure (Pa) and the object (3,) m."""

    friction: float
    pressure_pa: float
    offset_m: Array

    @staticmethod
    def none() -> Draw:
        """The nominal trial, without noise."""
        return Draw(1.0, 0.0, np.zeros(3))

    @staticmethod
    def of(config: GraspConfig, trial: int, radius_m: float) -> Draw:
        """Trial `trial` of the config's seed: uniform numbers, and a place uniform in a disc."""
        random = np.random.default_rng([config.seed, trial])
        friction, pressure = random.uniform(-1.0, 1.0, 2)
        reach = config.noise.placement * radius_m * np.sqrt(random.uniform())
        angle = random.uniform(0.0, 2 * np.pi)
        return Draw(
            1.0 + config.noise.friction * float(friction),
            config.noise.pressure_pa * float(pressure),
            reach * np.array([np.cos(angle), np.sin(angle), 0.0]),
        )


def grasp_scene(chain: ChainModel, config: GraspConfig, target: GraspObject, draw: Draw) -> Scene:
    """Copies of the chain around the object, above it by the height that they are lowered.

    A finger's chain axis leans outward by the inclination, its −z side, toward which it bends, looks at the
    vertical. Its base stands at the base radius, so high that the lowest point of the straight finger comes to
    the grasp height.

    Raises:
        UserError: the chain has nothing that collides.
    """
    if not any(chain.shapes):
        raise UserError(
            "task 'grasp': the chain has no collision shapes; give the study a 'family' block, or the chain a "
            "'module_radius'."
        )
    inset = default_inset_m(config.object) if config.base_inset_m is None else config.base_inset_m
    radius = target.radius_m - inset if config.base_radius_m is None else config.base_radius_m
    if radius < 0:
        raise UserError(
            f"task 'grasp': base_inset {1e3 * inset:g} mm is larger than the object's radius of "
            f"{1e3 * target.radius_m:g} mm."
        )
    tilted = _leaning(config.inclination_rad)
    height = config.grasp_height_m + _depth_m(chain, tilted) + config.lower_height_m
    arms = []
    for k in range(config.fingers):
        turn = exp_map(np.array([0.0, 0.0, 2 * np.pi * k / config.fingers]))
        place = turn @ np.array([radius, 0.0, height])
        finger = chain.with_(base_position_m=place, base_rotation=turn @ tilted)
        arms.append(Arm(finger, draw.friction * config.friction))
    return Scene(
        arms=tuple(arms),
        objects=(target.moved(draw.offset_m),),
        floor_m=0.0,
        gravity_m_s2=np.asarray(chain.gravity_m_s2, float),
    )


def _leaning(inclination_rad: float) -> Array:
    """Chain frame of the finger on the world's +x side: x down and outward, −z toward the vertical."""
    s, c = np.sin(inclination_rad), np.cos(inclination_rad)
    x, z = np.array([s, 0.0, -c]), np.array([c, 0.0, s])
    return np.stack([x, np.cross(z, x), z], axis=1)


def _depth_m(chain: ChainModel, rotation: Array) -> float:
    """How far the lowest point of the straight chain lies below its base."""
    geometry = ChainGeometry.of(chain.with_(base_position_m=np.zeros(3), base_rotation=rotation))
    pose = geometry.forward(np.zeros((chain.n_joints, len(chain.axes))))
    bodies = zip(chain.shapes, pose.rotations, pose.origins, strict=True)
    return max(support(s.placed(turn, origin), DOWN) for shapes, turn, origin in bodies for s in shapes)
