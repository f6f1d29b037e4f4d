"""Softening of rubber below its largest previous strain.

    E'(u) = (1 − d erf((W_m − W) / m)) E(u),      W = u²/2,  W_m = largest W so far,  m = s²/2

per joint: the pseudo-elastic softening of Ogden & Roxburgh (Proc. R. Soc. Lond. A 455, 1999,
doi 10.1098/rspa.1999.0431, with r = 1/d), with the joint's u²/2 in place of the strain energy. On the virgin curve, W =
W_m, there is no softening; below it the elastic part is reduced by at most the share d, and s is the angle below the
largest one over which this develops. Other rubbers soften over a shorter or longer range: erf(((W_m − W)/m)^n). Rest
does not restore the stiffness: the memory continues from run to run of one specimen.
"""

from __future__ import annotations

import math
from typing import Literal

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.records.design import Array
from pliant.records.term import LawTerm
from pliant.units import Angle, Ratio


class MullinsConfig(EffectConfig):
    """Largest softening d and the angle s over which it fades."""

    kind: Literal["mullins"] = "mullins"
    softening: Ratio = parameter(neutral=0.0, bounds=(0.0, 0.9), plausible=(0.05, 0.4), example=0.2)
    """share of the elastic effort that is lost at most"""
    scale_rad: Angle = parameter(
        neutral=0.2,
        bounds=(0.05, 1.0),
        plausible=(0.06, 0.6),
        role="shape",
        prior="log_normal",
        simpler={
            0.05: "the loss comes at once",
            1.0: "the loss is in proportion to the energy below the largest",
        },
        example=0.2,
    )
    """angle over which the loss comes, per joint"""
    power: float = parameter(unit="1", neutral=1.0, bounds=(0.3, 2.0), plausible=(0.5, 1.3), role="form")
    """power of the energy below the largest, within erf"""


class Mullins(Effect):
    """A softer elastic part below the largest past angle."""

    place = "law"
    notes = EffectNotes(
        signature="the first loading of a new specimen is stiffer than all that follow up to the same angle; "
        "going beyond the largest past angle it is as stiff as new.",
        inspection="cycle the specimen three times to the top of the range before every recording, and write "
        "down what it has been through.",
        confounder="stiffness",
        distinguishing_test="a stiffness is the same in the first and the second cycle; give cycle numbers "
        "and a virgin specimen.",
        excitation="take a specimen that was never loaded and cycle it three times each to a third, two "
        "thirds and all of the range.",
        where="filled rubbers and silicones, with the order of runs and specimens recorded; engines that "
        "follow histories: `quasistatic` and `mujoco`.",
    )
    recommended_experiments = ("virgin", "slow_cycles")
    config: MullinsConfig

    def apply(self, model: Model) -> Model:
        """Return the model with one more factor on the elastic part."""
        parameters = (self.config.softening, self.config.scale_rad, self.config.power)
        term = LawTerm("elastic", _factor, parameters, n_states=1, keeps=True, needs_time=True)
        return model.with_term(term)


def _factor(
    angle: float, rate: float, dt_s: float, actuation: float, temp_c: float, old: Array, new: Array, c: Array
) -> float:
    largest = max(old[0], abs(angle))
    new[0] = largest
    below = (largest * largest - angle * angle) / (c[1] * c[1])
    if c[2] != 1.0:
        below = math.exp(c[2] * math.log(below)) if below > 0.0 else 0.0
    return 1.0 - c[0] * math.erf(below)
