"""Pressure that differs from the reading by a constant.

    p' = p + p₀

for every pressure of the chain: the zero error of a gauge or regulator (the offset of a linear transducer
model). Tendon forces are left alone.

Signature: a bend at zero commanded pressure, along the actuation and the same in every run; the error in
angle is largest where the module is softest, and shrinks in proportion as pressure grows.
Nearest look-alike: `sensor_bias`, which shifts the angle alike at every pressure and has no torque: a
blocked moment at p = 0 tells them apart; `permanent_set` grows with the loading history.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import ClassVar, Literal

from pydantic import Field

from pliant.errors import UserError
from pliant.interfaces.effect import Effect, EffectConfig, EffectParameter, Model, Place
from pliant.records.rollout import Inputs
from pliant.units import Pressure

BOUNDS = (-1e5, 1e5)


class PressureOffsetConfig(EffectConfig):
    """p₀, acting − commanded pressure."""

    kind: Literal["pressure_offset"] = "pressure_offset"
    offset_pa: Pressure = Field(
        default=0.0, ge=BOUNDS[0], le=BOUNDS[1], description="acting − commanded pressure"
    )


class PressureOffset(Effect):
    """Adds a constant to every pressure before it reaches the chain."""

    place: ClassVar[Place] = "input"
    parameters: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter("offset_pa", "Pa", neutral=0.0, bounds=BOUNDS, plausible=(-1e3, 1e3)),
    )
    config: PressureOffsetConfig

    def apply(self, model: Model) -> Model:
        """The model with one more map of its inputs. Raises `UserError` for a chain without a pressure."""
        names = [actuator.input for actuator in model.chain.actuators]
        if not any(_is_pressure(name) for name in names):
            raise UserError(
                f"effect 'pressure_offset' needs a pressure, and the chain is actuated by {', '.join(names)}"
            )
        return model.with_(inputs=(*model.inputs, partial(_shifted, self.config.offset_pa)))


def _is_pressure(name: str) -> bool:
    return name.startswith("pressure") and name.endswith("_pa")


def _shifted(offset: float, inputs: Inputs) -> Inputs:
    actuation = {
        name: value + offset if _is_pressure(name) else value for name, value in inputs.actuation.items()
    }
    return replace(inputs, actuation=actuation)
