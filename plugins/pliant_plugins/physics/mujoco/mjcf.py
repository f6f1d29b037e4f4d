"""MJCF of a chain: nested bodies, one joint each, exact inertias, no contacts."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree

from pliant.mechanics.inertia import regular
from pliant.mechanics.kinematics import ChainGeometry
from pliant.mechanics.rotations import quaternion_of_matrix
from pliant.records.chain import ChainModel
from pliant.records.design import MassProperties

JOINT_TYPES = {"revolute": "hinge", "spherical": "ball", "prismatic": "slide"}
# A moving body must have inertia: these floors keep the mass matrix regular. A body without mass is also
# freed from gravity, so that its floor weighs nothing.
MASS_FLOOR_KG = 1e-9
INERTIA_FLOOR_KG_M2 = 1e-12


def chain_mjcf(chain: ChainModel, integrator: str) -> str:
    """The MJCF document. Body names: base, body_1…n, tip (welded to the last body, carries the payload)."""
    geometry = ChainGeometry.of(chain)
    root = ElementTree.Element("mujoco", model="chain")
    ElementTree.SubElement(root, "compiler", angle="radian", autolimits="true")
    option = ElementTree.SubElement(
        root, "option", integrator=integrator, gravity=_text(chain.gravity_m_s2), jacobian="dense"
    )
    ElementTree.SubElement(option, "flag", contact="disable", autoreset="disable")
    world = ElementTree.SubElement(root, "worldbody")
    parent = ElementTree.SubElement(
        world,
        "body",
        name="base",
        pos=_text(chain.base_position_m),
        quat=_text(quaternion_of_matrix(chain.base_rotation)),
    )
    for i in range(chain.n_joints):
        parent = ElementTree.SubElement(
            parent,
            "body",
            name=f"body_{i + 1}",
            pos=_text(geometry.offsets[i]),
            quat=_text(quaternion_of_matrix(geometry.rest_rotations[i])),
        )
        _add_inertia(parent, chain.bodies[i + 1])
        joint = ElementTree.SubElement(parent, "joint", type=JOINT_TYPES[geometry.kind])
        if geometry.kind != "spherical":
            joint.set("axis", _text(geometry.basis[:, 0]))
    tip = ElementTree.SubElement(parent, "body", name="tip", pos=_text(chain.tip_offset_m))
    ElementTree.SubElement(
        tip, "inertial", pos="0 0 0", mass=repr(float(chain.payload_kg)), diaginertia="0 0 0"
    )
    return ElementTree.tostring(root, encoding="unicode")


def _add_inertia(body: ElementTree.Element, piece: MassProperties) -> None:
    if piece.mass_kg == 0.0:
        body.set("gravcomp", "1")
    moved = regular(piece, MASS_FLOOR_KG, INERTIA_FLOOR_KG_M2)
    entries = moved.inertia_kg_m2[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    ElementTree.SubElement(
        body, "inertial", pos=_text(piece.com_m), mass=repr(float(moved.mass_kg)), fullinertia=_text(entries)
    )


def _text(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
