"""Actuation that acts with another gain than the model's.

    p' = g p

for every input of the chain, pressures and tendon forces alike: a regulator's scale error, a supply that sags
in proportion, or a constant share of a tendon's force lost on the way (the scale error of a linear transducer
model).
"""

from __future__ import annotations

from functools import partial
from typing import Literal

import numpy as np

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.mechanics.full_scale import full_scale
from pliant.records.history import History
from pliant.units import Ratio


class ActuationGainConfig(EffectConfig):
    """g, acting / commanded actuation."""

    kind: Literal["actuation_gain"] = "actuation_gain"
    gain: Ratio = parameter(neutral=1.0, bounds=(0.05, 20.0), plausible=(0.8, 1.2), example=0.9)
    """true actuation / nominal"""
    fading: Ratio = parameter(neutral=0.0, bounds=(-0.9, 0.9), plausible=(-0.3, 0.3), role="form")
    """share of the change that is gone at the largest pressure of the law"""


class ActuationGain(Effect):
    """A factor on every actuation before it reaches the chain."""

    place = "input"
    notes = EffectNotes(
        signature="the error grows in proportion to the pressure and is gone at zero pressure, whatever the load; up "
        "and down, fast and slow are alike.",
        inspection="hold a second gauge to the chamber at full pressure and measure the inside of one module: "
        "pressure times area is the drive.",
        confounder="stiffness",
        distinguishing_test="a load without pressure: a gain has no influence there, a stiffness has.",
        excitation="step the pressure through its whole range without load, then hang a load at zero pressure.",
        where="every family, pressures and tendon forces alike, and every engine.",
    )
    recommended_experiments = ("slow_cycles", "passive_load_steps", "blocked")
    config: ActuationGainConfig

    def apply(self, model: Model) -> Model:
        """Return the model with one more map of its inputs."""
        faded = self.config.fading / full_scale(model.chain)
        return model.with_input(partial(_scaled, self.config.gain, faded))


def _scaled(gain: float, faded: float, history: History) -> History:
    """Scale the input; `faded` is the share of the excess that is lost per unit of actuation."""
    if faded == 0.0:
        return history.with_actuation(**{name: gain * values for name, values in history.actuation.items()})
    return history.with_actuation(
        **{
            name: values * (1.0 + (gain - 1.0) * (1.0 - faded * np.abs(values)))
            for name, values in history.actuation.items()
        }
    )
