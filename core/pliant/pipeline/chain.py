"""Stage 3: assembly of modules and laws into a chain of rigid pieces (docs/conventions.md)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pliant.config.chain import BaseConfig, ChainConfig
from pliant.errors import UserError
from pliant.interfaces.family import ActuatorFamily
from pliant.mechanics.rotations import exp_map, matrix_from_quaternion
from pliant.mechanics.shared_actuation import shared
from pliant.mechanics.shared_elasticity import sharing_elasticity
from pliant.meshing.masses import UNIFORM
from pliant.meshing.surfaces import merged, stretched
from pliant.pipeline.wiring import Wiring
from pliant.records.chain import Actuator, ChainModel, Joint, Ring, default_base_rotation
from pliant.records.design import Array, MassProperties, ModuleMass
from pliant.records.law import JointLaw
from pliant.records.shape import HalfShapes, Shape

WATER_KG_M3 = 1000.0
NO_SHAPES = HalfShapes((), ())


@dataclass(frozen=True, eq=False)
class Module:
    """Properties of one module that the chain needs: its law, length, masses and collision shapes.

    `offset_m` is the distance of the chain's centre line from the joint, along module z.
    """

    law: JointLaw
    length_m: float
    mass: ModuleMass
    shapes: HalfShapes = NO_SHAPES
    offset_m: float = 0.0


@dataclass(frozen=True, eq=False)
class RigidPiece:
    """A rigid piece without a joint, x from 0 to `length_m` in its own frame."""

    length_m: float
    mass: MassProperties
    shapes: tuple[Shape, ...] = ()


@dataclass(frozen=True, eq=False)
class Segment:
    """Equal modules in a row, turned by `rotation_rad` about the chain axis relative to the base; or a rigid piece.

    The modules get `actuation_share` of the chain's inputs. `actuators` are those of the segment; without any, the
    chain's actuators act on it.
    """

    piece: Module | RigidPiece
    count: int = 1
    rotation_rad: float = 0.0
    actuation_share: float = 1.0
    actuators: tuple[Actuator, ...] = ()


def rod_module(
    law: JointLaw, length_m: float, mass_kg: float, radius_m: float | None = None, offset_m: float = 0.0
) -> Module:
    """Return a module without a family: a uniform rod, thin without a radius, at `offset_m` from its joint."""

    def half(start_m: float) -> RigidPiece:
        rod = rigid_rod(length_m / 2, mass_kg / 2, radius_m)
        offset = np.array([start_m, 0.0, offset_m])
        shapes = tuple(shape.placed(np.eye(3), offset) for shape in rod.shapes)
        return RigidPiece(rod.length_m, rod.mass.shifted(offset), shapes)

    start, end = half(-length_m / 2), half(0.0)
    mass, shapes = ModuleMass(start.mass, end.mass), HalfShapes(start.shapes, end.shapes)
    return Module(law, length_m, mass, shapes, offset_m)


def rigid_rod(length_m: float, mass_kg: float, radius_m: float | None = None) -> RigidPiece:
    """Return a uniform cylinder about the chain axis; without a radius it is thin and has no shape."""
    radius = radius_m or 0.0
    across = mass_kg * (length_m**2 / 12 + radius**2 / 4)
    centre = np.array([length_m / 2, 0.0, 0.0])
    mass = MassProperties(mass_kg, centre, np.diag([mass_kg * radius**2 / 2, across, across]))
    if radius_m is None:
        return RigidPiece(length_m, mass)
    along_x = exp_map(np.array([0.0, np.pi / 2, 0.0]))
    return RigidPiece(length_m, mass, (Shape("cylinder", (radius, length_m / 2), centre, along_x),))


def module_like(piece: Module, length_m: float, mass_kg: float | None = None) -> RigidPiece:
    """Return a rigid piece with a module's section: its shapes and masses stretched along the chain to this length.

    Args:
        piece: the module.
        length_m: of the piece.
        mass_kg: of the piece; by default the module's mass per length.
    """
    factor = length_m / piece.length_m
    whole = piece.mass.start.joined(piece.mass.end)
    share = factor if mass_kg is None or whole.mass_kg == 0.0 else mass_kg / whole.mass_kg
    along = np.diag([factor, 1.0, 1.0])
    # ∫ r rᵀ dm about the centre scales with x; the inertia is tr(S) 1 − S.
    second = 0.5 * np.trace(whole.inertia_kg_m2) * np.eye(3) - whole.inertia_kg_m2
    second = share * along @ second @ along
    inertia = np.trace(second) * np.eye(3) - second
    mass = MassProperties(share * whole.mass_kg, along @ whole.com_m, inertia)
    offset = np.array([length_m / 2, 0.0, 0.0])
    halves = merged([*piece.shapes.start, *piece.shapes.end])
    shapes = tuple(stretched(shape, factor).placed(np.eye(3), offset) for shape in halves)
    return RigidPiece(length_m, mass.shifted(offset), shapes)


def family_module(
    law: JointLaw, family: ActuatorFamily, density_kg_m3: float | None, regions: Mapping[str, float] = UNIFORM
) -> Module:
    """Return a module of a family; the default density is that of water, for chains without gravity.

    `regions` are densities by region of the family, if it has regions.
    """
    density = WATER_KG_M3 if density_kg_m3 is None else density_kg_m3
    mass = family.mass(density, regions) if regions else family.mass(density)
    return Module(law, family.module_length_m, mass, family.shapes(), family.offset_m)


def build_chain(config: ChainConfig, segments: Sequence[Segment]) -> ChainModel:
    """Build the chain: rigid pieces l/2, l, …, l, l/2 between base, joints and tip, each module's mass in two halves.

    A segment's rotation is about the chain axis and relative to the base frame, so that the rest frame of its
    first joint is rotated by the difference to the segment before it. Rigid pieces lengthen the body that
    contains them. The centre line starts at the base and ends at the tip; joints may be offset from it.

    Raises:
        UserError: laws of different joint types, or actuators and laws with different inputs.
    """
    wiring = Wiring.from_segments(
        config.actuators, [(_segment_law(segment), segment.actuators) for segment in segments]
    )
    # A law that gets all of the actuation from one actuator is not wrapped.
    pairs = [
        (s.piece.law, s.actuation_share, wiring.sharers(number))
        for number, s in enumerate(segments)
        if isinstance(s.piece, Module)
    ]
    places = {pair: place for place, pair in enumerate(dict.fromkeys(pairs))}
    laws = [
        law if share == 1.0 and count < 2 else sharing_elasticity(shared(law, share), count)
        for law, share, count in places
    ]
    kinds = sorted({f"{law.joint} ({', '.join(law.axes)})" for law in laws})
    if len(kinds) > 1:
        raise UserError(
            f"one chain has one kind of joint with the same axes, and its segments have {' and '.join(kinds)}: give "
            "them laws of one kind, where need be with a stiff axis."
        )
    joints: list[Joint] = []
    bodies = [MassProperties.none()]
    shapes: list[tuple[Shape, ...]] = [()]
    rotation = 0.0
    # Present end of the centre line, in the last body's frame.
    reach = np.zeros(3)
    rings, line = [Ring(0, reach)], [Ring(0, reach)]
    for number, segment in enumerate(segments):
        for _ in range(segment.count):
            piece = segment.piece
            if isinstance(piece, RigidPiece):
                bodies[-1] = bodies[-1].joined(piece.mass.shifted(reach))
                shapes[-1] += tuple(shape.placed(np.eye(3), reach) for shape in piece.shapes)
                reach = reach + [piece.length_m, 0.0, 0.0]
                continue
            # The start half moves with the parent body, whose axes are rotated back by `turn`.
            turn = _about_axis(segment.rotation_rad - rotation)
            beside = np.array([0.0, 0.0, piece.offset_m])
            half = np.array([piece.length_m / 2, 0.0, 0.0])
            offset = reach + half - turn @ beside
            bodies[-1] = bodies[-1].joined(piece.mass.start.rotated(turn).shifted(offset))
            shapes[-1] += tuple(shape.placed(turn, offset) for shape in piece.shapes.start)
            line += [Ring(len(joints), reach + half), Ring(len(joints) + 1, beside)]
            place = places[piece.law, segment.actuation_share, wiring.sharers(number)]
            joints.append(Joint(place, offset, turn, wiring.drives[number]))
            bodies.append(piece.mass.end)
            shapes.append(piece.shapes.end)
            reach, rotation = half + beside, segment.rotation_rad
        rings.append(Ring(len(joints), reach))
    return ChainModel(
        joints=tuple(joints),
        bodies=tuple(bodies),
        laws=tuple(laws),
        tip_offset_m=reach,
        base_position_m=np.array(config.base.position_m, float),
        base_rotation=base_rotation(config.base),
        gravity_m_s2=np.array(config.gravity_m_s2, float),
        payload_kg=config.payload_kg,
        actuators=wiring.actuators,
        shapes=tuple(merged(piece) for piece in shapes) if any(shapes) else (),
        rings=tuple(rings),
        centre_line=(*line, rings[-1]),
        mount=None if config.base.mount is None else config.base.mount.record(),
    )


def _segment_law(segment: Segment) -> JointLaw | None:
    return segment.piece.law if isinstance(segment.piece, Module) else None


def base_rotation(base: BaseConfig) -> Array:
    """Return the rotation of the base in the world, (3, 3); see docs/conventions.md for `direction` and `roll`."""
    if base.quaternion is not None:
        quaternion = np.array(base.quaternion, float)
        return matrix_from_quaternion(quaternion / np.linalg.norm(quaternion))
    rest = default_base_rotation()
    if base.direction is not None:
        # The smallest rotation from world −z to `direction`; a half turn about world y for +z.
        target, down = np.array(base.direction, float), np.array([0.0, 0.0, -1.0])
        target = target / np.linalg.norm(target)
        axis = np.cross(down, target)
        sine, cosine = float(np.linalg.norm(axis)), float(down @ target)
        turn = axis / sine * np.arctan2(sine, cosine) if sine >= 1e-12 else np.array([0.0, np.pi, 0.0])
        rest = rest if sine < 1e-12 and cosine > 0 else exp_map(turn) @ rest
    return rest @ _about_axis(base.roll_rad or 0.0)


def _about_axis(angle_rad: float) -> Array:
    """Return the rotation about the chain axis, (3, 3)."""
    return exp_map(np.array([angle_rad, 0.0, 0.0])) if angle_rad else np.eye(3)
