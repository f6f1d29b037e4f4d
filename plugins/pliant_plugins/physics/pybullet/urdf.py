"""URDF of chains and free bodies: one link per body, inertias on their principal axes, collision shapes on request."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree

import numpy as np

from pliant.mechanics.inertia import regular
from pliant.mechanics.kinematics import ChainGeometry
from pliant.records.chain import ChainModel
from pliant.records.design import Array, MassProperties
from pliant.records.shape import Shape
from pliant_plugins.physics.pybullet.collisions import CollisionWriter
from pliant_plugins.physics.pybullet.xml_values import add_origin, text

JOINT_TYPES = {"revolute": "continuous", "spherical": "spherical", "prismatic": "prismatic"}
# A body without mass or inertia would make Bullet's recursion singular. The mass floor weighs 1e-11 N; the
# inertia floor is that of a 1 g piece of 1 mm and bounds the step that explicit stiffness needs.
MASS_FLOOR_KG = 1e-12
INERTIA_FLOOR_KG_M2 = 1e-9


def chain_urdf(
    chain: ChainModel, base: MassProperties | None = None, collisions: CollisionWriter | None = None
) -> str:
    """The URDF document of `chain_tree`."""
    return document(chain_tree(chain, base, collisions))


def chain_tree(
    chain: ChainModel, base: MassProperties | None = None, collisions: CollisionWriter | None = None
) -> ElementTree.Element:
    """A chain's links and joints, with bodies as they are (`floored` makes them fit for Bullet).

    Link names: base, body_1…n, tip (fixed to the last body, carries the payload).

    Args:
        base: what the base link weighs; nothing by default, for a base that is fixed.
        collisions: writes the chain's shapes; without it nothing collides.
    """
    geometry = ChainGeometry.of(chain)
    shapes = chain.shapes if collisions is not None and chain.shapes else ((),) * (chain.n_joints + 1)
    root = ElementTree.Element("robot", name="chain")
    add_link(root, "base", base or MassProperties.none(), shapes[0], collisions)
    for i in range(chain.n_joints):
        add_link(root, f"body_{i + 1}", chain.bodies[i + 1], shapes[i + 1], collisions)
        joint = add_joint(
            root,
            f"joint_{i + 1}",
            JOINT_TYPES[geometry.kind],
            "base" if i == 0 else f"body_{i}",
            f"body_{i + 1}",
        )
        add_origin(joint, geometry.offsets[i], geometry.rest_rotations[i])
        ElementTree.SubElement(joint, "axis", xyz=text(geometry.basis[:, 0]))
        if geometry.kind == "prismatic":
            # Wider than any chain, so that the limit never acts.
            ElementTree.SubElement(joint, "limit", lower="-1e3", upper="1e3", effort="1e9", velocity="1e9")
    add_link(root, "tip", MassProperties(chain.payload_kg, np.zeros(3), np.zeros((3, 3))))
    tip = add_joint(root, "tip", "fixed", f"body_{chain.n_joints}", "tip")
    add_origin(tip, chain.tip_offset_m, np.eye(3))
    return root


def body_urdf(piece: MassProperties, shapes: Iterable[Shape], collisions: CollisionWriter) -> str:
    """The URDF document of one free body."""
    root = ElementTree.Element("robot", name="object")
    add_link(root, "object", piece, shapes, collisions)
    return document(root)


def document(root: ElementTree.Element) -> str:
    """The tree as text."""
    # Bullet's parser refuses long lines.
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")


def floored(chain: ChainModel) -> ChainModel:
    """The chain with bodies that Bullet can move."""
    return chain.with_(bodies=tuple(moving(body) for body in chain.bodies))


def moving(piece: MassProperties) -> MassProperties:
    """A piece with Bullet's floors."""
    return regular(piece, MASS_FLOOR_KG, INERTIA_FLOOR_KG_M2)


def principal(piece: MassProperties) -> tuple[Array, Array]:
    """Principal moments (3,) and right-handed principal axes (3, 3) as columns; Bullet's link frame."""
    moments, axes = np.linalg.eigh(piece.inertia_kg_m2)
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] *= -1.0
    return moments, axes


def add_link(
    root: ElementTree.Element,
    name: str,
    piece: MassProperties,
    shapes: Iterable[Shape] = (),
    collisions: CollisionWriter | None = None,
) -> ElementTree.Element:
    """A link with the piece's inertia on its principal axes, and shapes."""
    link = ElementTree.SubElement(root, "link", name=name)
    inertial = ElementTree.SubElement(link, "inertial")
    moments, axes = principal(piece)
    add_origin(inertial, piece.com_m, axes)
    ElementTree.SubElement(inertial, "mass", value=repr(float(piece.mass_kg)))
    ixx, iyy, izz = (repr(max(float(moment), 0.0)) for moment in moments)
    ElementTree.SubElement(inertial, "inertia", ixx=ixx, iyy=iyy, izz=izz, ixy="0", ixz="0", iyz="0")
    if collisions is not None:
        collisions.add(link, shapes)
    return link


def add_joint(
    root: ElementTree.Element, name: str, kind: str, parent: str, child: str
) -> ElementTree.Element:
    """A joint between two links."""
    joint = ElementTree.SubElement(root, "joint", name=name, type=kind)
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=child)
    return joint
