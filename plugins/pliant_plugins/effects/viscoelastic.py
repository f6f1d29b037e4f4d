"""Stress relaxation: a Maxwell branch in parallel with the elastic law.

    M = −g k₀ h,      dh/dt = du/dt − h / T

per joint: the standard linear solid, one term of a Prony series (Simo & Hughes, Computational Inelasticity, 1998,
ch. 10; several branches are several entries of `effects`). The model's law is the slow, relaxed one; the instantaneous
stiffness is larger by the share g of the stiffness at rest k₀, and after a step of angle the additional moment decays
as e^(−t/T). Over a step Δt in which the angle changes linearly by Δu the solution is exact (Taylor, Pister & Goudreau,
Int. J. Numer. Meth. Eng. 2, 1970):

    h' = e^(−Δt/T) h + (1 − e^(−Δt/T)) T/Δt Δu

A material with several times has three branches of g/3, of T/s, T and s T. A state that is reached slowly has h = 0.
T is bounded away from the sampling step, where the branch would be a dashpot, and from infinity, where it would be a
spring.
"""

from __future__ import annotations

import math
from typing import Literal

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.records.design import Array
from pliant.records.term import LawTerm
from pliant.units import Ratio, Time
from pliant_plugins.effects.scale import rest_stiffness


class ViscoelasticConfig(EffectConfig):
    """g and T of one branch."""

    kind: Literal["viscoelastic"] = "viscoelastic"
    share: Ratio = parameter(neutral=0.0, bounds=(0.0, 5.0), plausible=(0.05, 0.5), example=0.3)
    """stiffness that relaxes / stiffness at rest"""
    time_s: Time = parameter(
        neutral=20.0,
        bounds=(1.0, 1000.0),
        plausible=(3.0, 200.0),
        role="shape",
        prior="log_normal",
        simpler={1.0: "it relaxes within a second: viscous_damping is enough"},
        example="30 s",
    )
    """time constant in which it relaxes"""
    spread: Ratio = parameter(neutral=1.0, bounds=(1.0, 12.0), plausible=(1.0, 5.0), role="form")
    """with more than one time constant: ratio of each of three to the next"""


class Viscoelastic(Effect):
    """A relaxing branch in every joint."""

    place = "law"
    notes = EffectNotes(
        signature="the angle continues to creep for seconds to minutes while the pressure is held, and comes "
        "back as slowly after venting; fast runs look stiffer than slow ones.",
        inspection="hold full pressure for five minutes with the camera on, and see whether the tip still "
        "creeps in the last one.",
        confounder="viscous_damping",
        distinguishing_test="a dashpot is at rest within a second of a hold; a relaxing branch still "
        "drifts after many seconds.",
        excitation="raise the pressure quickly, hold it for several minutes, vent and keep recording.",
        where="silicone, foam and 3D-printed modules; recordings with a clock, in engines that follow "
        "histories: `quasistatic` and `mujoco`.",
    )
    recommended_experiments = ("holds", "fast_cycles", "slow_cycles")
    config: ViscoelasticConfig

    def apply(self, model: Model) -> Model:
        """Return the model with one more branch. Raises `UserError` for a law that is not stiff at rest."""
        stiffness = self.config.share * rest_stiffness(model.chain)
        parameters = (stiffness, self.config.time_s, self.config.spread)
        return model.with_term(LawTerm("moment", _moment, parameters, n_states=3, needs_time=True))


def _moment(
    angle: float, rate: float, dt_s: float, actuation: float, temp_c: float, old: Array, new: Array, c: Array
) -> float:
    if math.isinf(dt_s):
        new[0] = new[1] = new[2] = 0.0
        return 0.0
    total = 0.0
    for k in range(3):
        if k and c[2] == 1.0:  # one time: the other branches are the first one
            new[k] = new[0]
        else:
            steps = dt_s / (c[1] * (1.0, c[2], 1.0 / c[2])[k])
            mean_decay = -math.expm1(-steps) / steps if steps > 1e-12 else 1.0
            new[k] = math.exp(-steps) * old[k] + mean_decay * rate * dt_s
        total += new[k]
    return -c[0] * total / 3.0
