"""Walls that are thicker or thinner than the model's.

    τ'(p, u) = s^a E(u) + s^b A(p, u)        E(u) = τ(0, u),  A(p, u) = τ(p, u) − E(u)

with s the true thickness over the nominal one. In a thin plate that only bends, stiffness goes with the cube of the
thickness (Timoshenko & Woinowsky-Krieger, Theory of Plates and Shells, 1959); the walls of a bellow also stretch. The
default exponents were fitted to this project's FEM of `bellow_bending` (neo-Hookean, 0 to 15 kPa): the first finger's
module with walls of 1.3 to 1.7 mm gives a = 2.15, b = 0.39, a gripper module (r 3.5, R 7.5, l 10 mm) 2.16 and 0.27,
by least squares over angles that all walls share. They leave at most 2 % of E and 1 % of A, where the walls
make up to 35 % and 6 %. The slope at rest alone grows faster (a = 2.6 and 2.8). Other families have exponents of their
own, which two designs with different walls tell; a flexure of `tendon_joint` should come near the plate (a = 3, b = 0).
"""

from __future__ import annotations

from typing import Literal

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.records.term import LawTerm
from pliant.units import Ratio
from pliant_plugins.effects.factors import constant_factor


class WallThicknessConfig(EffectConfig):
    """s, a and b."""

    kind: Literal["wall_thickness"] = "wall_thickness"
    ratio: Ratio = parameter(neutral=1.0, bounds=(0.5, 2.0), plausible=(0.85, 1.15), example=1.1)
    """true thickness of the walls / nominal"""
    elastic_exponent: float = parameter(
        unit="1", neutral=2.15, bounds=(0.0, 4.0), plausible=(1.6, 2.7), role="form"
    )
    """a: the elastic part grows as thickness^a"""
    actuation_exponent: float = parameter(
        unit="1", neutral=0.33, bounds=(-4.0, 4.0), plausible=(0.1, 0.6), role="form"
    )
    """b: the actuation part grows as thickness^b"""


class WallThickness(Effect):
    """Factors on the elastic and the actuation part of every joint law from one thickness."""

    place = "law"
    notes = EffectNotes(
        signature="every angle is off as by another stiffness, with and without pressure, and the torque at "
        "a blocked joint is off too, by much less and the same way.",
        inspection="cut a spare module open and measure its wall at four places around and along; without a "
        "spare, weigh it.",
        confounder="stiffness",
        distinguishing_test="the blocked torque at the straight joint: a stiffness leaves it alone, a wall "
        "changes it by about a seventh of what it changes the stiffness.",
        excitation="vent the chamber and step loads of both signs, then hold the joint straight by a load at "
        "several pressures.",
        where="families with walls, every engine; the exponents are those of bending bellows.",
    )
    recommended_experiments = ("passive_load_steps", "blocked", "load_steps")
    config: WallThicknessConfig

    def apply(self, model: Model) -> Model:
        """Return the model with a factor on the elastic part and one on the actuation part."""
        config = self.config
        elastic = LawTerm("elastic", constant_factor, (config.ratio**config.elastic_exponent,))
        actuation = LawTerm("actuation", constant_factor, (config.ratio**config.actuation_exponent,))
        return model.with_term(elastic).with_term(actuation)
