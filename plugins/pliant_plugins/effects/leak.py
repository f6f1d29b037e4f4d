"""Leaking chambers: a regulated pressure is lower than commanded, and the pressure of a closed chamber decays.

    dd/dt = λ (p_c − d) − v d / T_s,      p = p_c − d

for every pressure of the chain: the mass balance of a chamber behind a linear resistance (a hose with the filling time
T_s) with a second one to the outside (Beater, Pneumatic Drives, 2007, ch. 3, at small pressures). p_c is the pressure
without a leak, d the deficit. With the valve open (v = 1) the regulator refills: d settles with T_s / (1 + λ T_s) at
the share λ T_s / (1 + λ T_s) of p_c. Closed off (`History.valve_open` 0, v = 0) p_c is constant and dp/dt = −λ p.
Between samples p_c is a straight line of slope s, for which, with r = λ + v / T_s, a step h is exact:

    d(t + h) = d*(t + h) + (d(t) − d*(t)) e^(−r h),      d* = λ/r (p_c − s/r)

A run starts in balance with the valve open. Without times, open states are in balance too; closed states, whose
duration is unknown, keep their pressure. Tendon forces are not changed.
"""

from __future__ import annotations

from functools import partial
from typing import Literal

import numpy as np

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.mechanics.full_scale import full_scale
from pliant.records.design import Array
from pliant.records.history import PRESSURE, History
from pliant.units import Time
from pliant_plugins.effects.pressures import needs_pressure


class LeakConfig(EffectConfig):
    """Rate λ of the leak and time constant T_s of the supply that refills it."""

    kind: Literal["leak"] = "leak"
    bare_keys = ("rate_1_s",)
    rate_1_s: float = parameter(
        unit="s^-1", neutral=0.0, bounds=(0.0, 2.0), plausible=(0.001, 0.1), example=0.03
    )
    """share of its pressure that a closed chamber loses, 1/s"""
    filling_time_s: Time = parameter(
        neutral=0.2, bounds=(1e-6, 60.0), plausible=(0.05, 0.8), role="form", prior="log_normal"
    )
    """time constant in which the supply fills the chamber"""
    power: float = parameter(unit="1", neutral=1.0, bounds=(0.3, 2.0), plausible=(0.5, 1.5), role="form")
    """power of the pressure with which gas leaves"""


class Leak(Effect):
    """A leak of every chamber."""

    place = "input"
    notes = EffectNotes(
        signature="with the valve closed the joint sinks back at a rate in proportion to its pressure; "
        "connected to the supply it stands nearly still, a small share below the model.",
        inspection="close the valve at full pressure, watch the gauge for a minute and brush soapy water "
        "over seams and fittings.",
        confounder="viscoelastic",
        distinguishing_test="a material that relaxes continues to bend under a pressure that is held by the "
        "regulator; a leak shows only once the valve is closed, and always toward the straight joint.",
        excitation="fill the chamber, close the valve and record for a minute.",
        where="families that a pressure drives, every engine; recordings with the column valve_open.",
    )
    recommended_experiments = ("closed_valve", "holds")
    config: LeakConfig

    def apply(self, model: Model) -> Model:
        """Return the model with one more map of its inputs. Raises `UserError` for a chain without a pressure."""
        needs_pressure(self.config.kind, model.chain)
        return model.with_input(partial(_leaking, self.config, full_scale(model.chain)))


def _leaking(config: LeakConfig, full: float, history: History) -> History:
    """Apply the leak; `full` is the pressure at which the rate is the stated one, whatever the power."""
    rate, filling_time = config.rate_1_s, config.filling_time_s
    if rate == 0.0:
        return history
    valve = np.ones(len(history)) if history.valve_open is None else history.valve_open
    left = {}
    for name, pressure in history.actuation.items():
        if PRESSURE.fullmatch(name) and history.time_s is None:
            left[name] = pressure / (1.0 + rate * filling_time)
        elif PRESSURE.fullmatch(name):
            assert history.time_s is not None
            left[name] = pressure - _lacking(pressure, valve, np.diff(history.time_s), config, full)
    return history.with_actuation(**left)


def _lacking(pressure: Array, valve: Array, steps: Array, config: LeakConfig, full: float) -> Array:
    """Return d at the samples."""
    from pliant_plugins.effects.recurrences import lacking

    series = (np.ascontiguousarray(values, float) for values in (pressure, valve, steps))
    found: Array = lacking(*series, config.rate_1_s, config.filling_time_s, config.power, full)
    return found
