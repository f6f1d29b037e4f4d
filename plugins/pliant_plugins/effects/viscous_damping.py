"""A moment against the motion, in proportion to its rate.

    M = −c du/dt,      c = T k₀

per joint: the dashpot of a Kelvin–Voigt solid (Findley, Lai & Onaran, Creep and Relaxation of Nonlinear
Viscoelastic Materials, 1976). T is its retardation time: let go, a joint of stiffness k₀ returns as
e^(−t/T). k₀ is the stiffness of the model's law at rest, so that T means the same for joints of any size.
"""

from __future__ import annotations

from typing import Literal

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.records.design import Array
from pliant.records.term import LawTerm
from pliant.units import Time
from pliant_plugins.effects.scale import rest_stiffness


class ViscousDampingConfig(EffectConfig):
    """T, retardation time: damping / stiffness at rest."""

    kind: Literal["viscous_damping"] = "viscous_damping"
    time_s: Time = parameter(neutral=0.0, bounds=(0.0, 60.0), plausible=(0.02, 1.0))
    """retardation time, damping / stiffness at rest"""


class ViscousDamping(Effect):
    """Adds a dashpot to every joint."""

    place = "law"
    notes = EffectNotes(
        signature="a loop between up and down whose width is proportional to the rate; within a second or so of a "
        "hold the angle stands where the slow run had it.",
        on_the_bench="take the hose off, bend the chain by hand, let go and film how long it takes to come back: no "
        "air is moved then.",
        look_alike="supply_lag",
        told_apart="change the load at constant pressure: a dashpot delays that motion too, a slow supply does not.",
        excited_by="run the same triangle at three rates a factor of three apart, and step a load at constant "
        "pressure.",
        where="every family; recordings with a clock, in engines that follow histories: `quasistatic` and `mujoco`.",
    )
    exciting = ("step_response", "fast_cycles", "load_steps")
    config: ViscousDampingConfig

    def apply(self, model: Model) -> Model:
        """The model with a dashpot in every joint. Raises `UserError` for a law that is not stiff at rest."""
        damping = self.config.time_s * rest_stiffness(model.chain)
        return model.with_term(LawTerm("moment", _moment, (damping,), needs_time=True))


def _moment(
    angle: float, rate: float, dt_s: float, actuation: float, temp_c: float, old: Array, new: Array, c: Array
) -> float:
    return -c[0] * rate
