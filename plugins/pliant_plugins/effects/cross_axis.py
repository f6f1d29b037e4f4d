"""Modules that bend about a turned axis.

    R_child = R_parent · rest · Rx(α) · exp(B q) · Rx(−α)

per joint in place of R_parent · rest · exp(B q): its axes are turned by α about the chain axis, and the body behind the
joint keeps its orientation, so that turns do not accumulate along the chain and the chain at rest is unchanged. A
chamber or a tendon that is displaced by the angle α about the chain axis has this effect. The whole law of a ball joint
is turned. The angle of a joint is measured about its turned axis.

Without gravity a chain of equal joints in one plane is turned as a whole: by α about the chain axis at its base.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from pliant.errors import ImpossibleEffectError
from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.mechanics.rotations import exp_map
from pliant.records.chain import ChainModel, Ring
from pliant.records.design import Array
from pliant.units import Angle


class CrossAxisConfig(EffectConfig):
    """Turn α of the bending axis about the chain."""

    kind: Literal["cross_axis"] = "cross_axis"
    turn_rad: Angle = parameter(neutral=0.0, bounds=(-1.5, 1.5), plausible=(-0.2, 0.2), example="8 deg")
    """turn of the bending axis about the chain axis"""


class CrossAxis(Effect):
    """A turn of the axes of every joint about the chain axis."""

    place = "chain"
    notes = EffectNotes(
        signature="under pressure the tip leaves the plane in which the model bends, in proportion to the "
        "bend; what is missing within the plane is of second order. At rest positions are right, and so are "
        "angles.",
        inspection="sight along the chain while it bends: do the seams or the stiff layers of all modules "
        "lie in one line?",
        confounder="base_misalignment",
        distinguishing_test="a tilted or turned base moves the tip of the unloaded chain too and shows in "
        "angles when gravity acts; a turned axis shows only as the chain bends.",
        excitation="film the tip from two sides in a cycle of pressure; then roll the base by 90° and repeat "
        "it under gravity.",
        where="hinge and ball joints of every family, every engine; positions across the plane must be "
        "measured, for angles show it only where a load or a weight acts across the plane.",
    )
    recommended_experiments = ("second_sensor", "sideways")
    config: CrossAxisConfig

    def apply(self, model: Model) -> Model:
        """Return model with its joints' axes turned. Raises `ImpossibleEffectError` for a chain that does not bend."""
        if model.chain.laws[0].joint == "prismatic":
            raise ImpossibleEffectError(
                f"effect '{self.config.kind}' turns the axis about which modules bend, and this chain only extends"
            )
        if self.config.turn_rad == 0.0:
            return model
        turn = exp_map(np.array([self.config.turn_rad, 0.0, 0.0]))
        return model.with_(chain=with_turned_axes(model.chain, turn))


def with_turned_axes(chain: ChainModel, turn: Array) -> ChainModel:
    """Return the chain with every joint's axes turned by `turn` (3, 3), and the same at rest.

    Frames of bodies behind a joint are turned along, as a body has its joint's rest frame; what they carry is
    written in the turned frame, where it stays in place.
    """
    back = turn.T

    def seen(ring: Ring) -> Ring:
        return Ring(ring.body, back @ ring.point_m) if ring.body else ring

    joints = [
        replace(
            joint,
            offset_m=back @ joint.offset_m if i else joint.offset_m,
            rest_rotation=(back if i else np.eye(3)) @ joint.rest_rotation @ turn,
        )
        for i, joint in enumerate(chain.joints)
    ]
    moved = [tuple(shape.placed(back, np.zeros(3)) for shape in piece) for piece in chain.shapes[1:]]
    return chain.with_(
        joints=tuple(joints),
        bodies=(chain.bodies[0], *(body.rotated(back) for body in chain.bodies[1:])),
        tip_offset_m=back @ chain.tip_offset_m,
        shapes=(*chain.shapes[:1], *moved),
        rings=tuple(seen(ring) for ring in chain.rings),
        centre_line=tuple(seen(ring) for ring in chain.centre_line),
    )
