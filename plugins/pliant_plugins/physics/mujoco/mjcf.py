"""MJCF of a chain: nested bodies, one joint each, exact inertias, shapes where they collide."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree.ElementTree import Element, SubElement, tostring

from pliant.mechanics.inertia import regular
from pliant.mechanics.kinematics import ChainGeometry
from pliant.mechanics.rotations import quaternion_of_matrix
from pliant.records.chain import ChainModel
from pliant.records.design import Array, MassProperties

JOINT_TYPES = {"revolute": "hinge", "spherical": "ball", "prismatic": "slide"}
# A moving body must have inertia: these floors keep the mass matrix regular. A body without mass is also
# freed from gravity, so that its floor weighs nothing.
MASS_FLOOR_KG = 1e-9
INERTIA_FLOOR_KG_M2 = 1e-12


def chain_mjcf(chain: ChainModel) -> str:
    """The MJCF document. Body names: base, body_1…n, tip (welded to the last body, carries the payload)."""
    root = document("chain")
    # This integrator takes damping implicitly, and with it the laws' stiffness (`ChainJoints.drive`).
    gravity = text(chain.gravity_m_s2)
    option = SubElement(root, "option", integrator="implicitfast", gravity=gravity, jacobian="dense")
    SubElement(option, "flag", contact="disable", constraint="disable", autoreset="disable")
    add_chain(SubElement(root, "worldbody"), chain)
    return tostring(root, encoding="unicode")


def document(name: str) -> Element:
    """An empty MJCF document in radians; inertias are those that are given, never those of geoms."""
    root = Element("mujoco", model=name)
    SubElement(root, "compiler", angle="radian", autolimits="true", inertiafromgeom="false")
    return root


def add_chain(parent: Element, chain: ChainModel, prefix: str = "") -> tuple[Element, ...]:
    """Adds the chain's bodies below `parent`, names with the prefix; returns base and body 1…n."""
    geometry = ChainGeometry.of(chain)
    base = add_body(parent, f"{prefix}base", chain.base_position_m, chain.base_rotation)
    bodies = [base]
    for i in range(chain.n_joints):
        body = add_body(bodies[-1], f"{prefix}body_{i + 1}", geometry.offsets[i], geometry.rest_rotations[i])
        add_inertia(body, chain.bodies[i + 1])
        joint = SubElement(body, "joint", type=JOINT_TYPES[geometry.kind])
        if geometry.kind != "spherical":
            joint.set("axis", text(geometry.basis[:, 0]))
        bodies.append(body)
    tip = SubElement(bodies[-1], "body", name=f"{prefix}tip", pos=text(chain.tip_offset_m))
    SubElement(tip, "inertial", pos="0 0 0", mass=repr(float(chain.payload_kg)), diaginertia="0 0 0")
    return tuple(bodies)


def add_body(parent: Element, name: str, position_m: Array, rotation: Array) -> Element:
    """A body at this pose in its parent's frame."""
    return SubElement(
        parent, "body", name=name, pos=text(position_m), quat=text(quaternion_of_matrix(rotation))
    )


def add_inertia(body: Element, piece: MassProperties) -> None:
    """Mass and inertia of a moving body, raised to the floors."""
    if piece.mass_kg == 0.0:
        body.set("gravcomp", "1")
    moved = regular(piece, MASS_FLOOR_KG, INERTIA_FLOOR_KG_M2)
    entries = moved.inertia_kg_m2[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    SubElement(
        body, "inertial", pos=text(piece.com_m), mass=repr(float(moved.mass_kg)), fullinertia=text(entries)
    )


def text(values: Iterable[float]) -> str:
    """Numbers as MJCF writes them, exact."""
    return " ".join(repr(float(value)) for value in values)
