"""Pressure that differs from the reading by a constant.

    p' = p + p₀

for every pressure of the chain: the zero error of a gauge or regulator (the offset of a linear transducer
model). Tendon forces are not changed.
"""

from __future__ import annotations

from functools import partial
from typing import Literal

import numpy as np

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.mechanics.full_scale import full_scale
from pliant.records.design import Array
from pliant.units import Pressure, Ratio
from pliant_plugins.effects.pressures import needs_pressure, with_pressures


class PressureOffsetConfig(EffectConfig):
    """p₀, acting − commanded pressure."""

    kind: Literal["pressure_offset"] = "pressure_offset"
    offset_pa: Pressure = parameter(neutral=0.0, bounds=(-1e5, 1e5), plausible=(-1e3, 1e3), example="500 Pa")
    """acting − commanded pressure"""
    fading: Ratio = parameter(neutral=0.0, bounds=(-0.9, 0.9), plausible=(-0.3, 0.3), role="form")
    """share of the change that is gone at the largest pressure of the law"""


class PressureOffset(Effect):
    """A constant added to every pressure before it reaches the chain."""

    place = "input"
    notes = EffectNotes(
        signature="the joint stands bent at zero commanded pressure, the same in every run, and the error in "
        "angle is largest where the joint is softest.",
        inspection="open the line to the room and read the gauge: what it shows is the offset; zero it when "
        "it is warm.",
        confounder="sensor_bias",
        distinguishing_test="an offset of pressure shrinks where a load or a large angle makes the joint "
        "stiff and shows in positions too; a sensor's bias is the same everywhere and moves no marker.",
        excitation="record the angle at zero pressure and at full pressure, each with and without a load.",
        where="families that a pressure drives, every engine; a chain of tendons refuses it.",
    )
    recommended_experiments = ("vented_zero", "passive_load_steps", "load_steps")
    config: PressureOffsetConfig

    def apply(self, model: Model) -> Model:
        """Return the model with one more map of its inputs. Raises `UserError` for a chain without a pressure."""
        needs_pressure(self.config.kind, model.chain)
        faded = self.config.fading / full_scale(model.chain)
        shift = partial(_shifted, self.config.offset_pa, faded)
        return model.with_input(partial(with_pressures, change=shift))


def _shifted(offset: float, faded: float, pressure: Array) -> Array:
    """Shift the pressures; `faded` is the share of the offset that is lost per Pa."""
    return pressure + offset * (1.0 - faded * np.abs(pressure))
