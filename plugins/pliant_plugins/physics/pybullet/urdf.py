"""URDF of a chain: one link per body, inertias on their principal axes, no collision shapes."""

from __future__ import annotations

from collections.abc import Iterable
from math import atan2, cos, hypot, sin
from xml.etree import ElementTree

import numpy as np

from pliant.mechanics.inertia import regular
from pliant.mechanics.kinematics import ChainGeometry
from pliant.records.chain import ChainModel
from pliant.records.design import Array, MassProperties

JOINT_TYPES = {"revolute": "continuous", "spherical": "spherical", "prismatic": "prismatic"}
# A body without mass or inertia would make Bullet's recursion singular. The mass floor weighs 1e-11 N; the
# inertia floor is that of a 1 g piece of 1 mm and bounds the step that explicit stiffness needs.
MASS_FLOOR_KG = 1e-12
INERTIA_FLOOR_KG_M2 = 1e-9


def chain_urdf(chain: ChainModel) -> str:
    """The URDF document. Link names: base, body_1…n, tip (fixed to the last body, carries the payload)."""
    geometry = ChainGeometry.of(chain)
    root = ElementTree.Element("robot", name="chain")
    _add_link(root, "base", MassProperties.none())
    for i in range(chain.n_joints):
        _add_link(root, f"body_{i + 1}", moving(chain.bodies[i + 1]))
        joint = _add_joint(
            root,
            f"joint_{i + 1}",
            JOINT_TYPES[geometry.kind],
            "base" if i == 0 else f"body_{i}",
            f"body_{i + 1}",
        )
        _add_origin(joint, geometry.offsets[i], geometry.rest_rotations[i])
        ElementTree.SubElement(joint, "axis", xyz=_text(geometry.basis[:, 0]))
        if geometry.kind == "prismatic":
            # Wider than any chain, so that the limit never acts.
            ElementTree.SubElement(joint, "limit", lower="-1e3", upper="1e3", effort="1e9", velocity="1e9")
    _add_link(root, "tip", MassProperties(chain.payload_kg, np.zeros(3), np.zeros((3, 3))))
    tip = _add_joint(root, "tip", "fixed", f"body_{chain.n_joints}", "tip")
    _add_origin(tip, chain.tip_offset_m, np.eye(3))
    # Bullet's parser refuses long lines.
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")


def moving(piece: MassProperties) -> MassProperties:
    """A piece with Bullet's floors."""
    return regular(piece, MASS_FLOOR_KG, INERTIA_FLOOR_KG_M2)


def principal(piece: MassProperties) -> tuple[Array, Array]:
    """Principal moments (3,) and right-handed principal axes (3, 3) as columns; Bullet's link frame."""
    moments, axes = np.linalg.eigh(piece.inertia_kg_m2)
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] *= -1.0
    return moments, axes


def _add_link(root: ElementTree.Element, name: str, piece: MassProperties) -> None:
    inertial = ElementTree.SubElement(ElementTree.SubElement(root, "link", name=name), "inertial")
    moments, axes = principal(piece)
    _add_origin(inertial, piece.com_m, axes)
    ElementTree.SubElement(inertial, "mass", value=repr(float(piece.mass_kg)))
    ixx, iyy, izz = (repr(max(float(moment), 0.0)) for moment in moments)
    ElementTree.SubElement(inertial, "inertia", ixx=ixx, iyy=iyy, izz=izz, ixy="0", ixz="0", iyz="0")


def _add_joint(
    root: ElementTree.Element, name: str, kind: str, parent: str, child: str
) -> ElementTree.Element:
    joint = ElementTree.SubElement(root, "joint", name=name, type=kind)
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=child)
    return joint


def _add_origin(element: ElementTree.Element, position: Array, rotation: Array) -> None:
    ElementTree.SubElement(element, "origin", xyz=_text(position), rpy=_text(roll_pitch_yaw(rotation)))


def roll_pitch_yaw(rotation: Array) -> tuple[float, float, float]:
    """Angles with R = Rz(yaw) Ry(pitch) Rx(roll), accurate also at a pitch of ±90°."""
    R = np.asarray(rotation, float)
    yaw = atan2(R[1, 0], R[0, 0])
    pitch = atan2(-R[2, 0], hypot(R[0, 0], R[1, 0]))
    # Roll from the axes with yaw undone: no division by cos(pitch).
    sine = sin(yaw) * R[0, 2] - cos(yaw) * R[1, 2]
    cosine = cos(yaw) * R[1, 1] - sin(yaw) * R[0, 1]
    return atan2(sine, cosine), pitch, yaw


def _text(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
