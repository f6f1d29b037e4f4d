"""Walls that touch: beyond an angle the joint has another spring.

    M = −k max(u − u_c, 0),      k = c k₀

per joint, on the side toward which actuation bends it: folds of a bellow or neighbouring chambers that meet (penalty
contact: Wriggers, Computational Contact Mechanics, 2006). Rounded walls touch
with M = −k û (max(u − u_c, 0)/û)^n, û = 0.1 rad. k is stated in stiffnesses at rest k₀. The angle
u_c is bounded away from zero: contact from the start would be a stiffness.
"""

from __future__ import annotations

import math
from typing import Literal

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.records.design import Array
from pliant.records.term import LawTerm
from pliant.units import Angle, Ratio
from pliant_plugins.effects.factors import DEPTH_RAD
from pliant_plugins.effects.scale import rest_stiffness


class SelfContactConfig(EffectConfig):
    """Stiffening c beyond the angle u_c where walls touch."""

    kind: Literal["self_contact"] = "self_contact"
    stiffening: Ratio = parameter(neutral=0.0, bounds=(0.0, 100.0), plausible=(0.3, 10.0), example=3)
    """stiffness of the contact / stiffness at rest"""
    contact_rad: Angle = parameter(
        neutral=0.25,
        bounds=(0.05, 2.0),
        plausible=(0.1, 0.6),
        role="shape",
        prior="log_normal",
        simpler={0.05: "walls touch from the start: a stiffness is enough"},
        example="15 deg",
    )
    """angle at which walls touch, per joint"""
    power: float = parameter(unit="1", neutral=1.0, bounds=(1.0, 3.0), plausible=(1.0, 2.0), role="form")
    """power of the depth with which the moment grows"""


class SelfContact(Effect):
    """A spring beyond the contact angle."""

    place = "law"
    notes = EffectNotes(
        signature="the curve of angle over pressure has a kink: below it the model is right, beyond it the joint "
        "bends too little, at the same angle under any load, up and down alike.",
        inspection="slide a strip of paper between the folds at the top of the range: where it is held, walls "
        "touch.",
        confounder="stiffness",
        distinguishing_test="a stiffness is wrong from the first degree on; contact begins at its angle.",
        excitation="sweep the pressure slowly to the top of the range, without a load and with loads either way, in "
        "small steps near the end.",
        where="bellows and ribbed chambers that bend far, every engine; solid fingers have no folds that meet.",
    )
    recommended_experiments = ("slow_cycles", "load_steps", "passive_load_steps")
    config: SelfContactConfig

    def apply(self, model: Model) -> Model:
        """Return the model with contact in every joint. Raises `UserError` for a law that is not stiff at rest."""
        stiffness = self.config.stiffening * rest_stiffness(model.chain)
        return model.with_term(
            LawTerm("moment", _moment, (stiffness, self.config.contact_rad, self.config.power))
        )


def _moment(
    angle: float, rate: float, dt_s: float, actuation: float, temp_c: float, old: Array, new: Array, c: Array
) -> float:
    depth = max(angle - c[1], 0.0)
    if c[2] == 1.0 or depth == 0.0:
        return -c[0] * depth
    return -c[0] * DEPTH_RAD * math.exp(c[2] * math.log(depth / DEPTH_RAD))
