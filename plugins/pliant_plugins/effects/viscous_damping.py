"""A moment against the motion, in proportion to its rate.

    M = −c du/dt,      c = T k₀

per joint: the dashpot of a Kelvin–Voigt solid (Findley, Lai & Onaran, Creep and Relaxation of Nonlinear
Viscoelastic Materials, 1976). T is its retardation time: let go, a joint of stiffness k₀ returns as
e^(−t/T). k₀ is the stiffness of the model's law at rest, so that T means the same for joints of any size. A dashpot
that thins or thickens with the rate is M = −c ω̂ sign(ω) (|ω|/ω̂)^n, ω = du/dt, ω̂ = 0.1 rad/s (Ostwald & de Waele).
"""

from __future__ import annotations

import math
from typing import Literal

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.records.design import Array
from pliant.records.term import LawTerm
from pliant.units import Time
from pliant_plugins.effects.factors import STILL_RAD_S, TYPICAL_RAD_S
from pliant_plugins.effects.scale import rest_stiffness


class ViscousDampingConfig(EffectConfig):
    """T, retardation time: damping / stiffness at rest."""

    kind: Literal["viscous_damping"] = "viscous_damping"
    time_s: Time = parameter(neutral=0.0, bounds=(0.0, 60.0), plausible=(0.02, 1.0), example="0.2 s")
    """retardation time, damping / stiffness at rest"""
    rate_power: float = parameter(unit="1", neutral=1.0, bounds=(0.3, 2.0), plausible=(0.6, 1.4), role="form")
    """power of the rate with which the moment grows"""


class ViscousDamping(Effect):
    """A dashpot in every joint."""

    place = "law"
    notes = EffectNotes(
        signature="a loop between up and down whose width is proportional to the rate; within a second or so "
        "of a hold the angle stands where the slow run had it.",
        inspection="take the hose off, bend the chain by hand, let go and film how long it takes to come "
        "back: no air is moved then.",
        confounder="supply_lag",
        distinguishing_test="change the load at constant pressure: a dashpot delays that motion too, a slow "
        "supply does not.",
        excitation="run the same triangle at three rates a factor of three apart, and step a load at "
        "constant pressure.",
        where="every family; recordings with a clock, in engines that follow histories: `quasistatic` and "
        "`mujoco`.",
    )
    recommended_experiments = ("step_response", "fast_cycles", "load_steps")
    config: ViscousDampingConfig

    def apply(self, model: Model) -> Model:
        """Return the model with a dashpot in every joint. Raises `UserError` for a law that is not stiff at rest."""
        damping = self.config.time_s * rest_stiffness(model.chain)
        return model.with_term(LawTerm("moment", _moment, (damping, self.config.rate_power), needs_time=True))


def _moment(
    angle: float, rate: float, dt_s: float, actuation: float, temp_c: float, old: Array, new: Array, c: Array
) -> float:
    if c[1] == 1.0:
        return -c[0] * rate
    size = (rate * rate + STILL_RAD_S * STILL_RAD_S) / (TYPICAL_RAD_S * TYPICAL_RAD_S)
    return -c[0] * rate * math.exp(0.5 * (c[1] - 1.0) * math.log(size))
