"""The scene of a crawler: chains, and what carries their bases, on a floor at height 0."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pliant.errors import UserError
from pliant.mechanics.contact_statics import with_capsules
from pliant.mechanics.kinematics import ChainGeometry
from pliant.meshing.surfaces import support
from pliant.pipeline.chain import base_rotation
from pliant.records.chain import ChainModel
from pliant.records.design import Array, MassProperties
from pliant.records.scene import Arm, FreeBody, Scene
from pliant.records.shape import Shape
from pliant_plugins.tasks.crawl.config import CrawlConfig, CrawlerBodyConfig, FeetConfig

DOWN = np.array([0.0, 0.0, -1.0])


def crawl_scene(chain: ChainModel, config: CrawlConfig) -> Scene:
    """Return the crawler with its straight chains, its lowest point on the floor.

    Raises:
        UserError: the chain has no collision shapes, or gravity does not press on the floor.
    """
    gravity = np.asarray(chain.gravity_m_s2, float)
    if gravity[2] >= 0.0:
        raise UserError(
            "task 'crawl': gravity must point down to the floor, along world −z; see 'chain.gravity'."
        )
    if config.radius_m is not None:
        chain = with_capsules(chain, config.radius_m)
    if config.feet is not None:
        chain = _on_feet(chain, config.feet)
    if not any(chain.shapes):
        raise UserError(
            "task 'crawl': the chain has no collision shapes; give the task a 'radius' or 'feet', the study a 'family' "
            "block, or the chain a 'module_radius'."
        )
    body = _body(config.body, config.friction)
    chains = [
        chain.with_(base_position_m=np.array(one.base.position_m), base_rotation=base_rotation(one.base))
        for one in config.placed_arms
    ]
    lowest = max(support(shape, DOWN) for shape in [*body.shapes, *(s for c in chains for s in _shapes(c))])
    up = np.array([0.0, 0.0, lowest])
    arms = tuple(Arm(c.with_(base_position_m=c.base_position_m + up), config.friction, 0) for c in chains)
    return Scene(arms, (replace(body, position_m=up),), floor_m=0.0, gravity_m_s2=gravity)


def weight_n(scene: Scene) -> float:
    """Return the weight of everything that the crawler moves."""
    pieces = [body.mass_kg for arm in scene.arms for body in arm.chain.bodies]
    payloads = [arm.chain.payload_kg for arm in scene.arms]
    mass = sum(pieces) + sum(payloads) + sum(one.mass.mass_kg for one in scene.objects)
    return float(mass * np.linalg.norm(scene.gravity_m_s2))


def _body(given: CrawlerBodyConfig | None, friction: float) -> FreeBody:
    """Return the body that the base pieces are fixed to, at the origin; without a box it has neither mass nor shape."""
    mass = MassProperties.none()
    shapes: tuple[Shape, ...] = ()
    if given is not None:
        x, y, z = np.square(given.box_m)
        inertia = given.mass_kg / 12.0 * np.diag([y + z, x + z, x + y])
        mass = MassProperties(given.mass_kg, np.zeros(3), inertia)
        shapes = (Shape("box", tuple(0.5 * edge for edge in given.box_m), np.zeros(3), np.eye(3)),)
    return FreeBody("body", mass, shapes, friction, np.zeros(3), np.eye(3))


def _on_feet(chain: ChainModel, feet: FeetConfig) -> ChainModel:
    """Return the chain with a pair of spheres at its base and its tip, along chain y."""
    shapes = list(chain.shapes or ((),) * (chain.n_joints + 1))
    tip = np.asarray(chain.tip_offset_m, float)
    for body, place in [(0, np.zeros(3)), (chain.n_joints, tip)][0 if feet.base else 1 :]:
        sides = [place + np.array([0.0, 0.5 * sign * feet.width_m, 0.0]) for sign in (1.0, -1.0)]
        shapes[body] += tuple(Shape("sphere", (feet.radius_m,), s, np.eye(3), rigid=True) for s in sides)
    return chain.with_(shapes=tuple(shapes))


def _shapes(chain: ChainModel) -> list[Shape]:
    """Return all shapes of the straight chain in the world."""
    geometry = ChainGeometry.from_chain(chain)
    pose = geometry.forward(np.zeros((chain.n_joints, len(chain.axes))))
    bodies: list[tuple[tuple[Shape, ...], Array, Array]] = list(
        zip(chain.shapes, pose.rotations, pose.origins, strict=True)
    )
    return [shape.placed(turn, origin) for shapes, turn, origin in bodies for shape in shapes]
