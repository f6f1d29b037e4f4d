"""A joint that is stiffer one way than the other.

    E'(u) = (1 + b s(u)) E(u),      s(u) = u / √(u² + w²)

per joint: a material with other moduli in tension than in compression, or folds that open more easily than they
close (Ambartsumyan, Elasticity Theory of Different Moduli, 1986; here the two moduli of the whole joint). With b > 0
the joint is stiffer on the side toward which actuation bends it. w only rounds the corner at u = 0: the slope of u s(u)
never exceeds 1.09, so that a law that is linear stays stable for every |b| ≤ 0.9.
"""

from __future__ import annotations

import math
from typing import Literal

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.records.design import Array
from pliant.records.term import LawTerm
from pliant.units import Angle, Ratio


class BimodulusConfig(EffectConfig):
    """Asymmetry b of the elastic effort and width w of its transition."""

    kind: Literal["bimodulus"] = "bimodulus"
    asymmetry: Ratio = parameter(neutral=0.0, bounds=(-0.9, 0.9), plausible=(-0.3, 0.3), example=0.2)
    """(stiffness toward actuation − stiffness away from it) / their sum"""
    width_rad: Angle = parameter(
        neutral=0.02, bounds=(1e-6, 0.5), plausible=(0.005, 0.08), role="form", prior="log_normal"
    )
    """angle over which one stiffness becomes the other, per joint"""


class Bimodulus(Effect):
    """A larger elastic part on one side and a smaller one on the other."""

    place = "law"
    notes = EffectNotes(
        signature="under loads without pressure the angle is too small one way and too large the other; "
        "there is a kink in the curve of angle over load at the straight joint, the same at every rate.",
        inspection="pull the vented joint to either side with a spring scale, and look for a wall, a seam or "
        "a sleeve that lies off the middle.",
        confounder="stiffness",
        distinguishing_test="load steps of both signs without pressure: a stiffness is off by the same "
        "factor both ways, a bimodulus by opposite ones.",
        excitation="vent the chamber and hang the same loads on either side of the joint, one after the "
        "other.",
        where="every family and engine; opposed chambers too, one side then being the softer.",
    )
    recommended_experiments = ("passive_load_steps", "load_steps", "upside_down")
    config: BimodulusConfig

    def apply(self, model: Model) -> Model:
        """Return the model with one more factor on the elastic part."""
        return model.with_term(LawTerm("elastic", _factor, (self.config.asymmetry, self.config.width_rad)))


def _factor(
    angle: float, rate: float, dt_s: float, actuation: float, temp_c: float, old: Array, new: Array, c: Array
) -> float:
    return 1.0 + c[0] * angle / math.sqrt(angle * angle + c[1] * c[1])
