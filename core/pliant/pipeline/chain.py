"""Stage 3: modules and laws become a chain of rigid pieces (docs/conventions.md)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pliant.config.chain import BaseConfig, ChainConfig
from pliant.errors import UserError
from pliant.interfaces.family import ActuatorFamily
from pliant.mechanics.rotations import exp_map, matrix_of_quaternion
from pliant.records.chain import Actuator, ChainModel, Joint, default_base_rotation
from pliant.records.design import Array, MassProperties, ModuleMass
from pliant.records.law import JointLaw

WATER_KG_M3 = 1000.0


@dataclass(frozen=True, eq=False)
class Module:
    """What the chain needs to know of one module: its law, length and masses."""

    law: JointLaw
    length_m: float
    mass: ModuleMass


@dataclass(frozen=True, eq=False)
class Segment:
    """Equal modules in a row; `rotation_rad` turns them about the chain axis, relative to the base."""

    module: Module
    count: int
    rotation_rad: float


def rod_module(law: JointLaw, length_m: float, mass_kg: float) -> Module:
    """A module without a family: a thin uniform rod."""
    half = mass_kg / 2

    def piece(centre: float) -> MassProperties:
        inertia = half * (length_m / 2) ** 2 / 12
        return MassProperties(half, np.array([centre, 0.0, 0.0]), np.diag([0.0, inertia, inertia]))

    return Module(law, length_m, ModuleMass(piece(-length_m / 4), piece(length_m / 4)))


def family_module(law: JointLaw, family: ActuatorFamily, density_kg_m3: float | None) -> Module:
    """A module of a family; without a density it has that of water, for chains on which no weight acts."""
    density = WATER_KG_M3 if density_kg_m3 is None else density_kg_m3
    return Module(law, family.module_length_m, family.mass(density))


def build_chain(config: ChainConfig, segments: Sequence[Segment]) -> ChainModel:
    """Rigid pieces l/2, l, …, l, l/2 between base, joints and tip; each module's mass goes to its two halves.

    A segment's rotation is about the chain axis and relative to the base frame, so that the rest frame of its
    first joint is turned by the difference to the segment before it.

    Raises:
        UserError: the chain's actuators and its laws take different inputs.
    """
    modules = [(s.module, s.rotation_rad) for s in segments for _ in range(s.count)]
    laws = list(dict.fromkeys(module.law for module, _ in modules))
    joints: list[Joint] = []
    bodies: list[MassProperties] = []
    previous_rotation, before = 0.0, 0.0
    tail = MassProperties.none()
    for module, rotation in modules:
        turn = exp_map(np.array([rotation - previous_rotation, 0.0, 0.0]))
        offset = np.array([before + module.length_m / 2, 0.0, 0.0])
        # The start half moves with the parent body, whose axes are turned back by `turn`.
        start = module.mass.start.rotated(turn).shifted(offset)
        bodies.append(tail.joined(start))
        joints.append(Joint(laws.index(module.law), offset, turn))
        tail, before, previous_rotation = module.mass.end, module.length_m / 2, rotation
    bodies.append(tail)
    return ChainModel(
        joints=tuple(joints),
        bodies=tuple(bodies),
        laws=tuple(laws),
        tip_offset_m=np.array([before, 0.0, 0.0]),
        base_position_m=np.array(config.base.position_m, float),
        base_rotation=base_rotation(config.base),
        gravity_m_s2=np.array(config.gravity_m_s2, float),
        payload_kg=config.payload_kg,
        actuators=_actuators(config, laws),
    )


def base_rotation(base: BaseConfig) -> Array:
    """Rotation of the base in the world, (3, 3); see docs/conventions.md for `direction` and `roll`."""
    if base.quaternion is not None:
        quaternion = np.array(base.quaternion, float)
        return matrix_of_quaternion(quaternion / np.linalg.norm(quaternion))
    rest = default_base_rotation()
    if base.direction is not None:
        rest = _smallest_rotation(np.array(base.direction, float)) @ rest
    return rest @ exp_map(np.array([base.roll_rad or 0.0, 0.0, 0.0]))


def _smallest_rotation(direction: Array) -> Array:
    """The smallest rotation that takes world −z to `direction`; a half turn about world y for +z."""
    target = direction / np.linalg.norm(direction)
    down = np.array([0.0, 0.0, -1.0])
    axis = np.cross(down, target)
    sine, cosine = float(np.linalg.norm(axis)), float(down @ target)
    if sine < 1e-12:
        return np.eye(3) if cosine > 0 else exp_map(np.array([0.0, np.pi, 0.0]))
    return exp_map(axis / sine * np.arctan2(sine, cosine))


def _actuators(config: ChainConfig, laws: Sequence[JointLaw]) -> tuple[Actuator, ...]:
    """The config's actuators, or one of the laws' input. Every actuator drives every law: their inputs agree."""
    names = sorted({law.actuation_name for law in laws})
    if len(names) > 1:
        raise UserError(f"one chain has one kind of actuation, and its laws take {' and '.join(names)}")
    for actuator in config.actuators:
        if _unnumbered(actuator.input) != _unnumbered(names[0]):
            raise UserError(f"chain.actuators names '{actuator.input}', but the chain's law takes {names[0]}")
    if config.actuators:
        return tuple(Actuator(a.input, a.sign) for a in config.actuators)
    return (Actuator(names[0]),)


def _unnumbered(name: str) -> str:
    """`pressure_pa` of `pressure_2_pa`."""
    return re.sub(r"_\d+_", "_", name)
