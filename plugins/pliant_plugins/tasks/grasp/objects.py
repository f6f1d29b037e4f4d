"""The object of a grasp: its shape, its mass with the extra weights, and how it stands on the floor."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pliant.errors import UserError
from pliant.meshing.surfaces import support
from pliant.records.design import Array, MassProperties
from pliant.records.scene import FreeBody
from pliant.records.shape import Shape
from pliant_plugins.solids import read_solid
from pliant_plugins.tasks.grasp.config import GraspConfig, ObjectConfig

DIMENSIONS = {"egg": (0.030, 0.065, 0.050), "cylinder": (0.016, 0.035, 0.010)}  # radius m, height m, mass kg
FOOT_RADIUS_M = 0.008
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
        note: what a reader must know of it, or "".
    """

    body: FreeBody
    radius_m: float
    note: str = ""

    def moved(self, offset_m: Array) -> FreeBody:
        """The body placed beside the vertical."""
        return replace(self.body, position_m=self.body.position_m + offset_m)


def grasp_object(config: GraspConfig) -> GraspObject:
    """The configured object with its extra weights.

    Raises:
        UserError: a mesh that cannot be used, or an object that no gripper of this kind is meant for.
    """
    shape, mass, note = _part(config.object) if config.object.mesh else _simple(config.object)
    foot = _foot(shape, config.object)
    bottom = -support(shape, np.array([0.0, 0.0, -1.0]))
    high, low = ([support(shape, sign * axis) for axis in np.eye(3)[:2]] for sign in (1.0, -1.0))
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
        shapes=(shape, *foot),
        friction=config.object_friction,
        position_m=np.array([-across[0], -across[1], -bottom]),
        rotation=np.eye(3),
    )
    return GraspObject(body, max(0.5 * (a + b) for a, b in zip(high, low, strict=True)), note)


def default_inset_m(config: ObjectConfig) -> float:
    """Object's radius less base radius, as in the published study."""
    return INSETS_M.get(config.shape or "", OTHER_INSET_M)


def _simple(config: ObjectConfig) -> tuple[Shape, MassProperties, str]:
    """Egg or cylinder, homogeneous, about its centre."""
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
    return shape, MassProperties(mass, np.zeros(3), np.diag([across, across, upright])), ""


def _foot(shape: Shape, config: ObjectConfig) -> tuple[Shape, ...]:
    """The disc from the floor to the height at which the egg has the foot's radius; it weighs nothing.

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


def _part(config: ObjectConfig) -> tuple[Shape, MassProperties, str]:
    """A part from a file; its convex hull collides."""
    assert config.mesh is not None
    solid = read_solid(config.mesh, config.scale)
    density = config.density_kg_m3 or (config.mass_kg or 0.0) / solid.volume_m3
    excess = solid.hull_volume_m3 / solid.volume_m3 - 1.0
    note = ""
    if excess > HULL_EXCESS:
        note = (
            f"'{config.mesh.name}' is not convex: its hull, which is what the fingers touch, encloses "
            f"{100 * excess:.0f} % more than the part."
        )
    return Shape("mesh", (), np.zeros(3), np.eye(3), solid.hull), solid.mass(density), note
