"""MJCF of a chain, and of a scene with every pair of shapes that may touch.

A chain is nested bodies, one joint each, with exact inertias. A scene is arms on a carriage, free
objects, fixed obstacles and a floor. Arms that a free object carries are nested in its body.
Pairs are written out one by one, because the scene's friction rule is the product of both coefficients and
MuJoCo's own is the larger. The carriage is a body on three slides of enormous inertia, whose velocity is
prescribed: unlike a mocap body's it is seen by the contact solver, so what is held moves with it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np

from pliant.mechanics.inertia import regular
from pliant.mechanics.kinematics import ChainGeometry
from pliant.mechanics.rotations import quaternion_from_matrix
from pliant.meshing.surfaces import support
from pliant.records.chain import ChainModel
from pliant.records.design import Array, MassProperties
from pliant.records.scene import Part, Scene
from pliant.records.shape import Shape
from pliant_plugins.physics.mujoco.config import MujocoConfig

# Joints of one body act in their order: an extensible one turns, then slides along its own x.
JOINT_TYPES = {
    "revolute": ("hinge",),
    "spherical": ("ball",),
    "prismatic": ("slide",),
    "extensible": ("ball", "slide"),
}
# A moving body must have inertia: these floors keep the mass matrix regular. A body without mass is also
# freed from gravity, so that its floor has no weight.
MASS_FLOOR_KG = 1e-9
INERTIA_FLOOR_KG_M2 = 1e-12


def chain_mjcf(chain: ChainModel) -> str:
    """Return the MJCF document. Body names: base, body_1…n, tip (welded to the last body, carries the payload)."""
    root = document("chain")
    # This integrator takes damping implicitly, and with it the laws' stiffness (`ChainJoints.drive`).
    gravity = text(chain.gravity_m_s2)
    option = SubElement(root, "option", integrator="implicitfast", gravity=gravity, jacobian="dense")
    SubElement(option, "flag", contact="disable", constraint="disable", autoreset="disable")
    base, *_ = add_chain(SubElement(root, "worldbody"), chain)
    add_base_inertia(base, chain)
    return tostring(root, encoding="unicode")


def document(name: str) -> Element:
    """Return an empty MJCF document in radians; inertias are those that are given, never those of geoms."""
    root = Element("mujoco", model=name)
    SubElement(root, "compiler", angle="radian", autolimits="true", inertiafromgeom="false")
    return root


def add_chain(parent: Element, chain: ChainModel, prefix: str = "") -> tuple[Element, ...]:
    """Add the chain's bodies below `parent`, names with the prefix; return base and body 1…n."""
    geometry = ChainGeometry.from_chain(chain)
    base = add_body(parent, f"{prefix}base", chain.base_position_m, chain.base_rotation)
    bodies = [base]
    for i in range(chain.n_joints):
        body = add_body(bodies[-1], f"{prefix}body_{i + 1}", geometry.offsets[i], geometry.rest_rotations[i])
        add_inertia(body, chain.bodies[i + 1])
        for kind in JOINT_TYPES[geometry.kind]:
            joint = SubElement(body, "joint", type=kind)
            if kind != "ball":
                joint.set("axis", text(geometry.basis[:, 0]))
        bodies.append(body)
    tip = SubElement(bodies[-1], "body", name=f"{prefix}tip", pos=text(chain.tip_offset_m))
    SubElement(tip, "inertial", pos="0 0 0", mass=repr(float(chain.payload_kg)), diaginertia="0 0 0")
    return tuple(bodies)


def add_body(parent: Element, name: str, position_m: Array, rotation: Array) -> Element:
    """Add a body at this pose in its parent's frame."""
    return SubElement(
        parent, "body", name=name, pos=text(position_m), quat=text(quaternion_from_matrix(rotation))
    )


def add_inertia(body: Element, piece: MassProperties) -> None:
    """Add mass and inertia of a moving body, raised to the floors."""
    if piece.mass_kg == 0.0:
        body.set("gravcomp", "1")
    moved = regular(piece, MASS_FLOOR_KG, INERTIA_FLOOR_KG_M2)
    entries = moved.inertia_kg_m2[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    SubElement(
        body, "inertial", pos=text(piece.com_m), mass=repr(float(moved.mass_kg)), fullinertia=text(entries)
    )


def add_base_inertia(base: Element, chain: ChainModel) -> None:
    """Add mass and inertia of the piece on the base, which moves with the chain's carrier."""
    if chain.bodies[0].mass_kg > 0.0:
        add_inertia(base, chain.bodies[0])


def text(values: Iterable[float]) -> str:
    """Return numbers as MJCF writes them, exact."""
    return " ".join(repr(float(value)) for value in values)


# The heaviest arm cannot slow a carriage of this inertia: 1 N changes its speed by 2e-9 m/s in 2 ms.
CARRIAGE_KG = 1e6
CARRIAGE_DOFS = 3
# MuJoCo's default of 1e-8 lets held objects jitter, and slip below their limit.
SOLVER_TOLERANCE = 1e-12
# Kinds of pairs of an arm and a fixed body.
FIXED_BY_ARM = ({"arm", "floor"}, {"arm", "obstacle"})
# A ball's rolling resistance and a patch's resistance to spinning are not in the scene's rule.
POINT_FRICTION = 3


@dataclass(frozen=True)
class Geom:
    """A shape in the document: its name, the body of the scene that carries it, its coefficient of friction."""

    name: str
    part: Part
    friction: float


def scene_mjcf(scene: Scene, config: MujocoConfig) -> tuple[str, tuple[Geom, ...]]:
    """Return the document of a scene with the config's contact settings, and its geoms in MuJoCo's order.

    Names of the bodies of arm k begin with `arm_k_`; objects are `object_0`, `object_1`, …
    """
    root = document("scene")
    option = SubElement(
        root,
        "option",
        integrator="discrete",
        gravity=text(scene.gravity_m_s2),
        jacobian="dense",
        cone="elliptic",
        impratio=repr(config.impratio),
        tolerance=repr(SOLVER_TOLERANCE),
        noslip_iterations=str(config.noslip_iterations),
    )
    SubElement(option, "flag", autoreset="disable")
    assets, world = SubElement(root, "asset"), SubElement(root, "worldbody")
    geoms: list[Geom] = []

    def add(body: Element, part: Part, friction: float, **how: str) -> None:
        geoms.append(Geom(f"geom_{len(geoms)}", part, friction))
        # contype 0: only the listed pairs collide.
        none = {"mass": "0", "contype": "0", "conaffinity": "0"}
        SubElement(body, "geom", {"name": geoms[-1].name, **none, **how})

    def add_shapes(body: Element, part: Part, friction: float, shapes: Sequence[Shape]) -> None:
        for shape in shapes:
            if shape.mesh is None:
                look = {"size": text(shape.size_m)}
            else:  # a mesh collides as its convex hull; MuJoCo computes its faces
                look = {"mesh": f"mesh_{len(geoms) + 1}"}
                vertices = text(np.asarray(shape.mesh.vertices_m, float).ravel())
                SubElement(assets, "mesh", name=look["mesh"], vertex=vertices, inertia="convex")
            add(body, part, friction, **placed(shape), **look)

    if scene.floor_m is not None:
        how = {"type": "plane", "size": "0 0 1", "pos": text((0.0, 0.0, scene.floor_m))}
        add(world, Part("floor"), scene.floor_friction, **how)
    for number, obstacle in enumerate(scene.obstacles):
        add_shapes(world, Part("obstacle", number), obstacle.friction, obstacle.shapes)
    carriage = SubElement(world, "body", name="carriage", gravcomp="1")
    inertia = text([INERTIA_FLOOR_KG_M2] * 3)
    SubElement(carriage, "inertial", pos="0 0 0", mass=repr(MASS_FLOOR_KG), diaginertia=inertia)
    for axis in np.eye(CARRIAGE_DOFS):
        SubElement(carriage, "joint", type="slide", axis=text(axis), armature=repr(CARRIAGE_KG))

    def add_arms(parent: Element, carrier: int | None) -> None:
        for number, arm in enumerate(scene.arms):
            if arm.base_object != carrier:
                continue
            place = {}
            if carrier is not None:
                position, rotation = scene.base_on_object(number)
                place = {"base_position_m": position, "base_rotation": rotation}
            bodies = add_chain(parent, arm.chain.with_(**place), f"arm_{number}_")
            if carrier is not None:
                add_base_inertia(bodies[0], arm.chain)
            for index, (body, shapes) in enumerate(zip(bodies, arm.chain.shapes, strict=False)):
                friction = arm.friction if index or carrier is None else scene.objects[carrier].friction
                add_shapes(body, Part("arm", number, index), friction, shapes)

    add_arms(carriage, None)
    for number, free in enumerate(scene.objects):
        body = add_body(world, f"object_{number}", free.position_m, free.rotation)
        SubElement(body, "freejoint")
        add_inertia(body, free.mass)
        add_shapes(body, Part("object", number), free.friction, free.shapes)
        add_arms(body, number)
    contact = SubElement(root, "contact")
    # Negative numbers are MuJoCo's direct format: the penetration does not depend on the step.
    stiffness = {
        "solref": text((-config.contact_stiffness, -config.contact_damping)),
        "solreffriction": text((-config.contact_stiffness, -config.slip_damping)),
        "solimp": text((config.contact_impedance, config.contact_impedance, 1e-3, 0.5, 2.0)),
    }
    apart = [parts_apart(arm.chain) for arm in scene.arms] if scene.arms_touch else []
    for one, other in combinations(geoms, 2):
        kinds = {one.part.kind, other.part.kind}
        if _is_carried(scene, one.part, other.part) or _is_carried(scene, other.part, one.part):
            continue
        # Objects touch everything else; arms touch what is fixed, and each other where the scene says so.
        usual = ("object" in kinds and one.part != other.part) or kinds in FIXED_BY_ARM
        if usual or (scene.arms_touch and kinds == {"arm"} and _meet(one.part, other.part, apart)):
            coefficient = one.friction * other.friction
            pair = SubElement(contact, "pair", stiffness, geom1=one.name, geom2=other.name)
            pair.set("condim", str(POINT_FRICTION if coefficient > 0.0 else 1))
            pair.set("friction", text([coefficient, coefficient, 0.0, 0.0, 0.0]))
            pair.set("gap", repr(config.near_m) if "arm" in kinds else "0")
    return tostring(root, encoding="unicode"), tuple(geoms)


def parts_apart(chain: ChainModel) -> int:
    """Return the smallest difference of body numbers in a chain at which a collision of two bodies counts.

    The piece of chain between them is then longer than half a turn about half the chain's thickness in a plane of
    bending: nearer bodies meet on the inner side of any bend, where a soft module is compressed and its law includes
    the effort.
    """
    across = {"y": (0.0, 0.0, 1.0), "z": (0.0, 1.0, 0.0)}  # where a bend about an axis moves the next body
    ways = [np.array(across[axis]) for axis in chain.axes if axis in across] or list(np.eye(3)[1:])
    each = [(support(s, way) + support(s, -way)) for way in ways for on in chain.shapes for s in on]
    links = [float(np.linalg.norm(joint.offset_m)) for joint in chain.joints[1:]]
    return 1 + math.ceil(math.pi * max(each, default=0.0) / 2 / max(min(links, default=0.0), 1e-6))


def _meet(one: Part, other: Part, apart: Sequence[int]) -> bool:
    """Return whether these bodies of arms can touch."""
    return one.number != other.number or abs(one.body - other.body) >= apart[one.number]


def _is_carried(scene: Scene, one: Part, other: Part) -> bool:
    """Return whether one part is of an arm on the other, an object."""
    kinds = (one.kind, other.kind)
    return kinds == ("arm", "object") and scene.arms[one.number].base_object == other.number


def placed(shape: Shape) -> dict[str, str]:
    """Return kind and pose of a shape as a geom has them."""
    rotation = text(quaternion_from_matrix(np.asarray(shape.rotation, float)))
    return {"type": shape.kind, "pos": text(shape.position_m), "quat": rotation}
