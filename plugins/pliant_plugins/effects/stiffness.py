"""Passive stiffness that differs from the model's.

    τ'(p, u) = f E(u) + A(p, u)        E(u) = τ(0, u),  A(p, u) = τ(p, u) − E(u)

The effort is split as in the reference study (Yao, Howard, Maiolino, doi 10.1002/aisy.70406) into an
elastic part, the whole effort at p = 0, and an actuation part; the modulus of the material scales the first. A change
that depends on the angle is f(u) = 1 + (f − 1) (|u|/û)^a, û = 0.2 rad.
"""

from __future__ import annotations

import math
from typing import Literal

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.records.design import Array
from pliant.records.term import LawTerm
from pliant.units import Ratio
from pliant_plugins.effects.factors import SMALL_RAD, TYPICAL_RAD, constant_factor

LEAST_FACTOR = 0.02


class StiffnessConfig(EffectConfig):
    """f, true passive stiffness / model's."""

    kind: Literal["stiffness"] = "stiffness"
    factor: Ratio = parameter(neutral=1.0, bounds=(0.05, 20.0), plausible=(0.7, 1.4), example=1.2)
    """true passive stiffness / model's"""
    angle_power: float = parameter(
        unit="1", neutral=0.0, bounds=(-0.3, 1.0), plausible=(-0.25, 0.25), role="form"
    )
    """power of the angle with which the change grows"""


class Stiffness(Effect):
    """A factor on the elastic part of every joint law."""

    place = "law"
    notes = EffectNotes(
        signature="under a load without pressure every angle is off by the same factor; with pressure the error is "
        "smaller where pressure itself stiffens the module. Rate, history and orientation play no part.",
        inspection="hang one known weight on the vented joint and read its angle, then compare batch and cure of "
        "the rubber with the sample that was tested.",
        confounder="actuation_gain",
        distinguishing_test="a load without pressure: a stiffness shows there, a gain cannot.",
        excitation="vent the chamber and hang two or three loads one after the other, up and down, then repeat under "
        "pressure.",
        where="every family and every engine; without a load or a weight it is nearly a gain of the actuation.",
    )
    recommended_experiments = ("passive_load_steps", "load_steps")
    config: StiffnessConfig

    def apply(self, model: Model) -> Model:
        """Return the model with one more factor on the elastic part."""
        if self.config.angle_power == 0.0:
            return model.with_term(LawTerm("elastic", constant_factor, (self.config.factor,)))
        return model.with_term(LawTerm("elastic", _factor, (self.config.factor, self.config.angle_power)))


def _factor(
    angle: float, rate: float, dt_s: float, actuation: float, temp_c: float, old: Array, new: Array, c: Array
) -> float:
    size = max(abs(angle), SMALL_RAD) / TYPICAL_RAD
    return max(1.0 + (c[0] - 1.0) * math.exp(c[1] * math.log(size)), LEAST_FACTOR)
