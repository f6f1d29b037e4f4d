"""The scene of one trial: the object with its extra weights, its pose on the floor, and the fingers around it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pliant.errors import UserError
from pliant.mechanics.kinematics import ChainGeometry
from pliant.mechanics.rotations import exp_map
from pliant.meshing.surfaces import support
from pliant.records.chain import ChainModel
from pliant.records.design import Array, MassProperties
from pliant.records.scene import Arm, FreeBody, Scene
from pliant.records.shape import Shape
from pliant_plugins.solids import convex_parts, read_solid
from pliant_plugins.tasks.grasp.config import GraspConfig, HandConfig, ObjectConfig

DOWN = np.array([0.0, 0.0, -1.0])
DIMENSIONS = {"egg": (0.030, 0.065, 0.050), "cylinder": (0.016, 0.035, 0.010)}  # radius m, height m, mass kg
FOOT_RADIUS_M = 0.008
# Object's radius less base radius, as in the published study.
INSETS_M = {"egg": 0.016}
OTHER_INSET_M = 0.002
HEAVIEST_KG = 50.0
HULL_EXCESS = 0.05  # of a part's volume: beyond it, the hull that collides is no good picture of the part


@dataclass(frozen=True, eq=False)
class GraspObject:
    """An object ready to be grasped.

    Attributes:
        body: standing on the floor z = 0 with the centre of its outline on the vertical through the origin.
        radius_m: its largest horizontal half width.
        note: a remark for the reader, or "".
    """

    body: FreeBody
    radius_m: float
    note: str = ""


def grasp_object(config: HandConfig) -> GraspObject:
    """Return the configured object with its extra weights.

    Raises:
        UserError: a mesh that cannot be used, or an object that no gripper of this kind is meant for.
    """
    shapes, mass, note = _part(config.object) if config.object.mesh else _simple(config.object)
    bottom = -max(support(shape, DOWN) for shape in shapes)
    high, low = (
        [max(support(shape, sign * axis) for shape in shapes) for axis in np.eye(3)[:2]]
        for sign in (1.0, -1.0)
    )
    across = [0.5 * (a - b) for a, b in zip(high, low, strict=True)]
    if config.extra_weights:
        place = mass.com_m.copy()
        if config.weights_height_m is not None:
            place[2] = bottom + config.weights_height_m
        mass = mass.joined(MassProperties(config.extra_weights * config.weight_kg, place, np.zeros((3, 3))))
    if mass.mass_kg > HEAVIEST_KG:
        raise UserError(
            f"task: the object weighs {mass.mass_kg:.3g} kg with its extra weights, more than {HEAVIEST_KG:g} kg; "
            "were units forgotten (a bare number is kilograms, write '20 g')?"
        )
    body = FreeBody(
        name=config.object.mesh.stem if config.object.mesh else str(config.object.shape),
        mass=mass,
        shapes=(*shapes, *_foot(shapes[0], config.object)),
        friction=config.object_friction,
        position_m=np.array([-across[0], -across[1], -bottom]),
        rotation=np.eye(3),
    )
    return GraspObject(body, max(0.5 * (a + b) for a, b in zip(high, low, strict=True)), note)


def _simple(config: ObjectConfig) -> tuple[tuple[Shape, ...], MassProperties, str]:
    """Return an egg or cylinder, homogeneous, about its centre."""
    assert config.shape is not None
    radius, height, mass = (
        given if given is not None else usual
        for given, usual in zip(
            (config.radius_m, config.height_m, config.mass_kg), DIMENSIONS[config.shape], strict=True
        )
    )
    half = height / 2
    if config.shape == "egg":
        across, upright = mass * (radius**2 + half**2) / 5, mass * 2 * radius**2 / 5
        shape = Shape("ellipsoid", (radius, radius, half), np.zeros(3), np.eye(3))
    else:
        across, upright = mass * (radius**2 / 4 + height**2 / 12), mass * radius**2 / 2
        shape = Shape("cylinder", (radius, half), np.zeros(3), np.eye(3))
    return (shape,), MassProperties(mass, np.zeros(3), np.diag([across, across, upright])), ""


def _foot(shape: Shape, config: ObjectConfig) -> tuple[Shape, ...]:
    """Return the disc from the floor to the height at which the egg has the foot's radius; it has no mass.

    Raises:
        UserError: the foot is wider than the egg.
    """
    radius = FOOT_RADIUS_M if config.foot_radius_m is None else config.foot_radius_m
    if config.shape != "egg" or radius == 0.0:
        return ()
    across, _, half = shape.size_m
    if radius >= across:
        raise UserError(f"task.object: a foot of radius {1e3 * radius:g} mm is wider than the egg.")
    height = half * (1.0 - np.sqrt(1.0 - (radius / across) ** 2))
    return (Shape("cylinder", (radius, height / 2), np.array([0.0, 0.0, height / 2 - half]), np.eye(3)),)


def _part(config: ObjectConfig) -> tuple[tuple[Shape, ...], MassProperties, str]:
    """Return a part from a file; its convex hull collides, or the convex parts that it is cut into."""
    assert config.mesh is not None
    solid = read_solid(config.mesh, config.scale)
    density = config.density_kg_m3 or (config.mass_kg or 0.0) / solid.volume_m3
    hulls = convex_parts(solid, config.convex_parts)
    excess = sum(hull.volume_m3 for hull in hulls) / solid.volume_m3 - 1.0
    note = ""
    if excess > HULL_EXCESS:
        many = len(hulls) > 1
        what = f"its {len(hulls)} convex parts, which are what the fingers touch, enclose"
        note = (
            f"'{config.mesh.name}' is not convex: "
            + (what if many else "its hull, which is what the fingers touch, encloses")
            + f" {100 * excess:.0f} % more than the part"
            + (", overlaps counted twice." if many else "; 'convex_parts: 16' cuts it into convex parts.")
        )
    shapes = tuple(Shape("mesh", (), np.zeros(3), np.eye(3), hull.surface) for hull in hulls)
    return shapes, solid.mass(density), note


@dataclass(frozen=True, eq=False)
class Draw:
    """The noise of one trial: factor of the friction, offsets of the pressure (Pa) and the object (3,) m."""

    friction: float
    pressure_pa: float
    offset_m: Array

    @staticmethod
    def none() -> Draw:
        """Return the nominal trial, without noise."""
        return Draw(1.0, 0.0, np.zeros(3))

    @staticmethod
    def from_config(config: GraspConfig, trial: int, radius_m: float) -> Draw:
        """Return trial `trial` of the config's seed: uniform numbers, and a position uniform in a disc."""
        random = np.random.default_rng([config.seed, trial])
        friction, pressure = random.uniform(-1.0, 1.0, 2)
        reach = config.noise.placement * radius_m * np.sqrt(random.uniform())
        angle = random.uniform(0.0, 2 * np.pi)
        return Draw(
            1.0 + config.noise.friction * float(friction),
            config.noise.pressure_pa * float(pressure),
            reach * np.array([np.cos(angle), np.sin(angle), 0.0]),
        )


def grasp_scene(chain: ChainModel, config: HandConfig, target: GraspObject, draw: Draw) -> Scene:
    """Place copies of the chain around the object, above it by the lowering height.

    A finger's chain axis is tilted outward by the inclination; its −z side, toward which it bends, faces the vertical.
    Its base is at the base radius and at the height for which the lowest point of the straight, lowered finger is at
    the grasp height.

    Raises:
        UserError: the chain has no collision shapes.
    """
    if not any(chain.shapes):
        raise UserError(
            f"task '{config.kind}': the chain has no collision shapes; give the study a 'family' block, or the chain a "
            "'module_radius'."
        )
    usual = INSETS_M.get(config.object.shape or "", OTHER_INSET_M)
    inset = usual if config.base_inset_m is None else config.base_inset_m
    radius = target.radius_m - inset if config.base_radius_m is None else config.base_radius_m
    if radius < 0:
        raise UserError(
            f"task '{config.kind}': base_inset {1e3 * inset:g} mm is larger than the object's radius of "
            f"{1e3 * target.radius_m:g} mm."
        )
    # the finger's frame on the world's +x side: x down and outward, −z toward the vertical
    s, c = np.sin(config.inclination_rad), np.cos(config.inclination_rad)
    x, z = np.array([s, 0.0, -c]), np.array([c, 0.0, s])
    tilted = np.stack([x, np.cross(z, x), z], axis=1)
    height = config.grasp_height_m + _depth_m(chain, tilted) + config.lower_height_m
    arms = []
    for k in range(config.fingers):
        turn = exp_map(np.array([0.0, 0.0, 2 * np.pi * k / config.fingers]))
        place = turn @ np.array([radius, 0.0, height])
        finger = chain.with_(base_position_m=place, base_rotation=turn @ tilted)
        arms.append(Arm(finger, draw.friction * config.friction))
    return Scene(
        arms=tuple(arms),
        objects=(replace(target.body, position_m=target.body.position_m + draw.offset_m),),
        floor_m=0.0,
        gravity_m_s2=np.asarray(chain.gravity_m_s2, float),
        arms_touch=config.finger_contact,
    )


def _depth_m(chain: ChainModel, rotation: Array) -> float:
    """Return the distance of the straight chain's lowest point below its base."""
    geometry = ChainGeometry.from_chain(chain.with_(base_position_m=np.zeros(3), base_rotation=rotation))
    pose = geometry.forward(np.zeros((chain.n_joints, len(chain.axes))))
    bodies = zip(chain.shapes, pose.rotations, pose.origins, strict=True)
    return max(support(s.placed(turn, origin), DOWN) for shapes, turn, origin in bodies for s in shapes)
