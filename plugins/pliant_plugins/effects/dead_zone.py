"""Pressure without effect below a threshold.

    p' = sign(p) max(|p| − p₀, 0)

for every pressure of the chain: a valve that sticks, a membrane or a fold that must open first (the dead zone of
Tao & Kokotović, Adaptive Control of Systems with Actuator and Sensor Nonlinearities, 1996, with unit slopes). A corner
of some width is the softplus w ln(1 + e^((|p| − p₀)/w)), less its value at zero.
Tendon forces are not changed.
"""

from __future__ import annotations

from functools import partial
from typing import Literal

import numpy as np

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.records.design import Array
from pliant.units import Pressure, Ratio
from pliant_plugins.effects.pressures import needs_pressure, with_pressures


class DeadZoneConfig(EffectConfig):
    """p₀, the pressure that is lost before anything moves."""

    kind: Literal["dead_zone"] = "dead_zone"
    threshold_pa: Pressure = parameter(
        neutral=0.0, bounds=(0.0, 1e5), plausible=(100.0, 2e3), example="600 Pa"
    )
    """pressure that is lost before anything moves"""
    rounding: Ratio = parameter(neutral=0.0, bounds=(0.0, 1.0), plausible=(0.0, 0.4), role="form")
    """width of the corner at the threshold, as a share of it"""


class DeadZone(Effect):
    """A threshold that is subtracted from every pressure before it reaches the chain."""

    place = "input"
    notes = EffectNotes(
        signature="nothing moves at the smallest pressures, and above the threshold the angle lags behind by the "
        "same pressure; up and down are alike.",
        inspection="raise the pressure by hand from zero and note where the joint first moves; read the smallest "
        "pressure in the regulator's data sheet.",
        confounder="pressure_offset",
        distinguishing_test="at zero pressure a dead zone has no influence; an offset bends the joint there.",
        excitation="raise the pressure from zero in small steps through the lowest tenth of the range, and lower it "
        "again.",
        where="families that a pressure drives, every engine; it needs samples at the lowest pressures.",
    )
    recommended_experiments = ("slow_cycles", "vented_zero", "blocked")
    config: DeadZoneConfig

    def apply(self, model: Model) -> Model:
        """Return the model with one more map of its inputs. Raises `UserError` for a chain without a pressure."""
        needs_pressure(self.config.kind, model.chain)
        return model.with_input(
            partial(with_pressures, change=partial(_above, self.config.threshold_pa, self.config.rounding))
        )


def _above(threshold: float, rounding: float, pressure: Array) -> Array:
    if rounding * threshold > 0.0:
        width = rounding * threshold
        size = np.logaddexp(0.0, (np.abs(pressure) - threshold) / width) - np.logaddexp(0.0, -1.0 / rounding)
        return np.asarray(np.sign(pressure) * width * size)
    return np.asarray(np.sign(pressure) * np.maximum(np.abs(pressure) - threshold, 0.0))
