"""Permanent set of a joint: its unloaded angle follows the largest past angle.

    E'(u) = E(u − u₀),      u₀ = s (u₊ + u₋)

per joint, with u₊ ≥ 0 and u₋ ≤ 0 the largest angles so far on either side: residual strain in proportion to the
largest strain, as observed in cyclic tests of filled rubbers and silicones (Dorfmann & Ogden, Int. J. Solids Struct.
41, 2004, doi 10.1016/j.ijsolstr.2003.11.014; here to first order, the share s). A first loading is therefore
softer by that share too. Rest does not reverse the set: the memory continues from run to run of one specimen.
"""

from __future__ import annotations

import math
from typing import Literal

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.records.design import Array
from pliant.records.term import LawTerm
from pliant.units import Ratio
from pliant_plugins.effects.factors import TYPICAL_RAD


class PermanentSetConfig(EffectConfig):
    """s, residual / largest angle."""

    kind: Literal["permanent_set"] = "permanent_set"
    share: Ratio = parameter(neutral=0.0, bounds=(0.0, 0.6), plausible=(0.01, 0.15), example=0.08)
    """angle that stays / largest past angle"""
    power: float = parameter(unit="1", neutral=1.0, bounds=(0.5, 3.0), plausible=(0.7, 2.0), role="form")
    """power of the largest angle with which the set grows"""


class PermanentSet(Effect):
    """A shift of every joint's rest angle toward its largest past angle."""

    place = "law"
    notes = EffectNotes(
        signature="vented and unloaded, the joint stays a little bent, the more the farther it has ever "
        "been; waiting does not help, and a repeat of the same cycle adds nothing.",
        inspection="photograph the vented chain from one place before the first cycle and after the largest "
        "one, and lay one picture over the other.",
        confounder="pressure_offset",
        distinguishing_test="an offset is there before the first loading and never grows; a set grows with "
        "the largest angle.",
        excitation="start with a virgin specimen, load to higher and higher levels and vent for a minute "
        "after each.",
        where="rubbers and 3D-printed elastomers, with the order of runs and specimens recorded; engines "
        "that follow histories: `quasistatic` and `mujoco`.",
    )
    recommended_experiments = ("virgin", "vented_zero")
    config: PermanentSetConfig

    def apply(self, model: Model) -> Model:
        """Return the model with a rest angle that moves."""
        term = LawTerm(
            "rest", _rest, (self.config.share, self.config.power), n_states=2, keeps=True, needs_time=True
        )
        return model.with_term(term)


def _rest(
    angle: float, rate: float, dt_s: float, actuation: float, temp_c: float, old: Array, new: Array, c: Array
) -> float:
    new[0] = max(old[0], angle)
    new[1] = min(old[1], angle)
    if c[1] == 1.0:
        return c[0] * (new[0] + new[1])
    up = math.exp(c[1] * math.log(new[0] / TYPICAL_RAD)) if new[0] > 0.0 else 0.0
    down = math.exp(c[1] * math.log(-new[1] / TYPICAL_RAD)) if new[1] < 0.0 else 0.0
    return c[0] * TYPICAL_RAD * (up - down)
