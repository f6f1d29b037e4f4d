"""Weights that differ from the model's.

    g' = f g,      c_i' = c_i + a L n

for the pieces of the chain and its payload: masses are known worse than gravity (fittings, hoses, a density from a
data sheet), and in statics a mass and gravity enter only as their product, the weight. Omitted masses are seldom on the
axis: the centres of mass c_i of all pieces move by the share a of the chain's length L along n, across the chain in the
plane in which it bends.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.mechanics.kinematics import main_axis
from pliant.units import Ratio

# Across the chain, in the plane of bending about the main axis, in a piece's frame.
ACROSS = {"x": 1, "y": 2, "z": 1}


class GravityScaleConfig(EffectConfig):
    """f, true weight / model's, and a."""

    kind: Literal["gravity_scale"] = "gravity_scale"
    factor: Ratio = parameter(neutral=1.0, bounds=(0.0, 10.0), plausible=(0.8, 1.3), example=1.1)
    """true weight / model's"""
    aside: Ratio = parameter(neutral=0.0, bounds=(-0.5, 0.5), plausible=(-0.03, 0.03))
    """centres of mass beside the axis / length of the chain"""


class GravityScale(Effect):
    """A factor on the gravity of the chain."""

    place = "chain"
    notes = EffectNotes(
        signature="the error changes with the orientation of the base, is largest with the chain held level, "
        "grows toward the base, and is gone where the chain lies on a table; weights beside the axis show "
        "where it hangs straight down, too.",
        inspection="weigh the chain with its hoses, cap and markers, and balance it on an edge to find its "
        "centre of mass.",
        confounder="stiffness",
        distinguishing_test="turn the base by 90° and 180°: the error of a weight turns with it, that of a "
        "stiffness stays.",
        excitation="repeat one pressure sweep with the base hanging, level and turned over.",
        where="chains that their weight or payload bends, every engine; a chain on a table does not show it.",
    )
    recommended_experiments = ("level", "upside_down", "sideways")
    config: GravityScaleConfig

    def apply(self, model: Model) -> Model:
        """Return the model with its chain's gravity scaled and its centres of mass moved."""
        chain = model.chain.with_(gravity_m_s2=self.config.factor * model.chain.gravity_m_s2)
        if self.config.aside:
            move = np.zeros(3)
            move[ACROSS[chain.axes[main_axis(chain.axes)]]] = self.config.aside * chain.length_m
            chain = chain.with_(bodies=tuple(body.shifted(move) for body in chain.bodies))
        return model.with_(chain=chain)
