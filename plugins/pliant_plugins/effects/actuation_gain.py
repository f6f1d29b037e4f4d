"""Actuation that acts with another gain than the model's.

    p' = g p

for every input of the chain, pressures and tendon forces alike: a regulator's scale error, a supply that sags
in proportion, or a constant share of a tendon's force lost on the way (the scale error of a linear transducer
model).

Signature: all actuated angles and blocked moments change as if the pressure were scaled; nothing changes
at p = 0; no dependence on rate, history or orientation.
Nearest look-alike: `stiffness`, which shows under load at p = 0, where a gain is silent;
`pressure_offset` is largest, in proportion, at small pressures.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import ClassVar, Literal

from pydantic import Field

from pliant.interfaces.effect import Effect, EffectConfig, EffectParameter, Model, Place
from pliant.records.rollout import Inputs
from pliant.units import Ratio

BOUNDS = (0.05, 20.0)


class ActuationGainConfig(EffectConfig):
    """g, acting / commanded actuation."""

    kind: Literal["actuation_gain"] = "actuation_gain"
    gain: Ratio = Field(default=1.0, ge=BOUNDS[0], le=BOUNDS[1], description="true actuation / nominal")


class ActuationGain(Effect):
    """Scales every actuation before it reaches the chain."""

    place: ClassVar[Place] = "input"
    parameters: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter("gain", "1", neutral=1.0, bounds=BOUNDS, plausible=(0.8, 1.2)),
    )
    config: ActuationGainConfig

    def apply(self, model: Model) -> Model:
        """The model with one more map of its inputs."""
        return model.with_(inputs=(*model.inputs, partial(_scaled, self.config.gain)))


def _scaled(gain: float, inputs: Inputs) -> Inputs:
    return replace(inputs, actuation={name: gain * value for name, value in inputs.actuation.items()})
