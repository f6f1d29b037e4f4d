"""Play between a joint and what reads its angle.

    y_k = min(max(y_(k−1), q_k − w/2), q_k + w/2)

for every angle q that is recorded, in the order of the samples: a gear, a cable or a clutch with the clearance w on the
way to the encoder or potentiometer (the play operator: Krasnosel'skii & Pokrovskii, Systems with Hysteresis, 1989;
Visintin, Differential Models of Hysteresis, 1994, ch. III). It needs no clock. A run begins with the sensor in the
middle of its clearance. Each reading has the play of one sensor, and so has the sum along the chain. The chain, its
markers and its efforts do not change.
"""

from __future__ import annotations

from functools import partial
from typing import Literal

import numpy as np

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.records.design import Array
from pliant.units import Angle, Ratio
from pliant_plugins.effects.angles import with_recorded_angles


class BacklashConfig(EffectConfig):
    """Width w of the play."""

    kind: Literal["backlash"] = "backlash"
    play_rad: Angle = parameter(neutral=0.0, bounds=(0.0, 0.5), plausible=(0.005, 0.1), example="2 deg")
    """clearance between joint and sensor, whole width"""
    spread: Ratio = parameter(neutral=0.0, bounds=(0.0, 1.0), plausible=(0.0, 0.6), role="form")
    """of parts in a row with clearances of their own: how far three of them are from their mean"""


class Backlash(Effect):
    """A play of half a clearance between the joint's angle and every recorded angle."""

    place = "output"
    notes = EffectNotes(
        signature="after every reversal the reading stands still until the joint has turned by the "
        "clearance, then follows with the model's slope; the loop is as wide at any rate, pressure and load, "
        "and positions have none.",
        inspection="turn the joint a little back and forth by hand while you watch the reading; tighten the "
        "grub screw or preload the shaft by a spring.",
        confounder="friction_hysteresis",
        distinguishing_test="positions: friction holds the chain itself back, a play only its reading. By "
        "angles alone: the loop of a play is as wide where the joint is stiff as where it is soft, "
        "friction's narrows as the joint stiffens.",
        excitation="cycle the pressure in loops of different size, and loads at constant pressure, and film "
        "the tip beside the angle.",
        where="joints whose angle a gear, a cable or a shaft transmits to a sensor, as on tendon fingers; "
        "not cameras or strain gauges. Every engine that follows histories, for it acts on readings only.",
    )
    recommended_experiments = ("small_loops", "load_steps", "second_sensor")
    config: BacklashConfig

    def apply(self, model: Model) -> Model:
        """Return the model with one more map of its readings; where no angle is recorded it changes nothing."""
        half = self.config.play_rad / 2
        if half == 0.0:
            return model
        change = (
            partial(_played_by_parts, half, self.config.spread)
            if self.config.spread
            else partial(played, half)
        )
        return model.with_output(partial(with_recorded_angles, change=change))


def _played_by_parts(half: float, spread: float, angle: Array) -> Array:
    """Return the (t,) mean of three plays of other widths: readings still move slightly after a reversal."""
    return np.asarray(np.mean([played(half * (1.0 + k * spread), angle) for k in (-1, 0, 1)], axis=0))


def played(half: float, angle: Array) -> Array:
    """Return the (t,) play operator of half the clearance."""
    from pliant_plugins.effects.recurrences import behind_play

    return np.asarray(behind_play(np.array(angle, float), half))
