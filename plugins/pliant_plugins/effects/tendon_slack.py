"""A tendon that goes slack when it is paid out: it pulls and does not push.

    a' = a                              for a ≥ −p
    a' = −p + (1 − s) (a + p)           for a < −p

for every travel or force of a tendon, a, positive when the tendon pulls. s is the share of the negative actuation that
is lost (1: the tendon is slack and transmits nothing), p the pretension, by which the tendon stays tight. A corner of
some width w is the softplus. In a chain with opposed tendons the tendon that is paid out then opposes nothing, as in
the unilateral constraints of cable-driven robots (Camarillo et al., IEEE Trans. Robot. 24, 2008: tendons remain in
tension only above a minimum).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import partial
from typing import Literal

import numpy as np

from pliant.errors import ImpossibleEffectError
from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.mechanics.full_scale import full_scale
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import History
from pliant.units import Ratio

TENDON = re.compile(r"tendon_(force|travel)(_\d+)?_(n|m)")


class TendonSlackConfig(EffectConfig):
    """s and p."""

    kind: Literal["tendon_slack"] = "tendon_slack"
    share: Ratio = parameter(neutral=0.0, bounds=(0.0, 1.0), plausible=(0.3, 0.95), example=0.9)
    """share of a negative travel or force that the tendon does not transmit"""
    pretension: Ratio = parameter(neutral=0.0, bounds=(0.0, 1.0), plausible=(0.0, 0.2), role="form")
    """travel or force by which a tendon stays tight when it is paid out, as a share of the full scale"""
    rounding: Ratio = parameter(neutral=0.0, bounds=(0.0, 0.5), plausible=(0.0, 0.1), role="form")
    """width of the corner, as a share of the full scale"""


class TendonSlack(Effect):
    """A tendon input that keeps its positive part and loses a share of its negative part."""

    place = "input"
    notes = EffectNotes(
        signature="the model bends too far, or the wrong way, where a tendon is paid out; where every tendon "
        "pulls it is right. Up and down, fast and slow are alike.",
        inspection="pay out each tendon by hand: feel whether it hangs loose, and read its tension with a "
        "spring scale.",
        confounder="unequal_actuators",
        distinguishing_test="move one tendon through zero: a slack tendon changes its slope at zero travel, "
        "an actuator with another gain keeps it.",
        excitation="pull each tendon alone with the others at rest, then pay it out by the same travel.",
        where="chains whose inputs are travels or forces of tendons that become negative, every engine.",
    )
    actuation = "tendon_force_n"
    recommended_experiments = ("paid_out", "slow_cycles")
    config: TendonSlackConfig

    def unsuited(self, chain: ChainModel, histories: Sequence[History]) -> str:
        """Return a sentence if no tendon has a negative travel or force in these runs; otherwise empty."""
        lowest = min(
            (
                float(np.nanmin(values, initial=0.0))
                for history in histories
                for name, values in history.actuation.items()
                if TENDON.fullmatch(name)
            ),
            default=0.0,
        )
        return "" if lowest < 0.0 else "no tendon has a negative travel or force in these runs"

    def apply(self, model: Model) -> Model:
        """Return the model with one more map of its inputs. Raises `ImpossibleEffectError` without a tendon."""
        inputs = sorted({actuator.input for actuator in model.chain.actuators})
        if not any(TENDON.fullmatch(name) for name in inputs):
            raise ImpossibleEffectError(
                f"effect 'tendon_slack' needs a tendon, and the chain is actuated by {', '.join(inputs)}"
            )
        scale = full_scale(model.chain)
        scale = scale if np.isfinite(scale) else 0.0
        width = self.config.rounding * scale
        return model.with_input(partial(_slack, self.config.share, self.config.pretension * scale, width))


def _slack(share: float, tight: float, width: float, history: History) -> History:
    """Return the history with tendons that transmit only a part of what lies below −`tight`."""
    changed = {
        name: values + share * _below(values + tight, width)
        for name, values in history.actuation.items()
        if TENDON.fullmatch(name)
    }
    return history.with_actuation(**changed)


def _below(excess: Array, width: float) -> Array:
    """Return max(−excess, 0), with a corner of this width."""
    if width > 0.0:
        return np.asarray(width * np.logaddexp(0.0, -excess / width))
    return np.asarray(np.maximum(-excess, 0.0))
