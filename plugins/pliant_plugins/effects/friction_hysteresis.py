"""Dry friction in the joint: a loop whose width does not depend on the rate.

    M = −M_c z,      z' = clip(z + Δu / δ, −1, 1),      M_c = w k₀

per joint: a spring that slips at the moment M_c after the break-away angle δ (the elastoplastic element of Iwan,
J. Appl. Mech. 33, 1966; of Prandtl–Ishlinskii models the single play-free case). Folds that rub, fibres that slide
in a sleeve. w is M_c as the angle that it makes on the stiffness at rest k₀, the half-width of the loop seen in the
angle of a soft joint. δ is bounded well below working angles: a spring that never slips would be a stiffness.
Surfaces that slip one after another are three such elements of M_c/3, with δ (1 − s), δ and δ (1 + 3 s) (a
Prandtl–Ishlinskii sum); friction that depends on the rate is M_c (|ω|/ω̂)^r, ω̂ = 0.1 rad/s.

The element needs the angle only, not the time, so it acts on states that are reached slowly as well.
"""

from __future__ import annotations

import math
from typing import Literal

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.records.design import Array
from pliant.records.term import LawTerm
from pliant.units import Angle, Ratio
from pliant_plugins.effects.factors import STILL_RAD_S, TYPICAL_RAD_S
from pliant_plugins.effects.scale import rest_stiffness


class FrictionHysteresisConfig(EffectConfig):
    """Half width w of the loop as an angle, and the distance δ over which friction builds up."""

    kind: Literal["friction_hysteresis"] = "friction_hysteresis"
    half_width_rad: Angle = parameter(
        neutral=0.0, bounds=(0.0, 0.5), plausible=(0.005, 0.1), example="1.5 deg"
    )
    """friction moment / stiffness at rest, per joint"""
    break_away_rad: Angle = parameter(
        neutral=0.01,
        bounds=(0.002, 0.05),
        plausible=(0.003, 0.03),
        role="shape",
        prior="log_normal",
        simpler={0.002: "it slips at once"},
        example="0.5 deg",
    )
    """angle after which a joint slips"""
    spread: Ratio = parameter(neutral=0.0, bounds=(0.0, 0.95), plausible=(0.0, 0.8), role="form")
    """of surfaces that slip one after another: how far the angles of three of them are apart"""
    rate_power: float = parameter(
        unit="1", neutral=0.0, bounds=(-0.3, 0.5), plausible=(-0.1, 0.2), role="form"
    )
    """power of the rate with which friction grows"""


class FrictionHysteresis(Effect):
    """An elastoplastic element in every joint."""

    place = "law"
    notes = EffectNotes(
        signature="loading and unloading run apart by the same width at every rate; after a reversal the "
        "joint first stands nearly still; in a hold nothing drifts, and the joint does not return to where "
        "it began.",
        inspection="bend the vented joint by hand to either side, let it come back slowly and mark where it "
        "stays; look for sleeves, hoses and cables that rub.",
        confounder="viscoelastic",
        distinguishing_test="the loop of friction is as wide in a slow run as in a fast one and does not "
        "close in a hold.",
        excitation="cycle the pressure up and down, with small loops inside the large one, at two rates a "
        "factor of ten apart.",
        where="folds, fibres and sleeves that rub; recordings with or without a clock, in engines that "
        "follow histories: `quasistatic` and `mujoco`.",
    )
    recommended_experiments = ("small_loops", "slow_cycles", "fast_cycles")
    config: FrictionHysteresisConfig

    def apply(self, model: Model) -> Model:
        """Return the model with friction in every joint. Raises `UserError` for a law that is not stiff at rest."""
        slip_moment = self.config.half_width_rad * rest_stiffness(model.chain)
        config = self.config
        parameters = (slip_moment, config.break_away_rad, config.spread, config.rate_power)
        return model.with_term(LawTerm("moment", _moment, parameters, n_states=4, needs_time=True))


def _moment(
    angle: float, rate: float, dt_s: float, actuation: float, temp_c: float, old: Array, new: Array, c: Array
) -> float:
    # Memory: the stretch of each element in units of its δ, and the angle of the sample before.
    total = 0.0
    for k in range(3):
        slips_at = c[1] * (1.0, 1.0 - c[2], 1.0 + 3.0 * c[2])[k]
        new[k] = min(max(old[k] + (angle - old[3]) / slips_at, -1.0), 1.0)
        total += new[k]
    new[3] = angle
    if c[3] != 0.0 and not math.isinf(dt_s):
        size = (rate * rate + STILL_RAD_S * STILL_RAD_S) / (TYPICAL_RAD_S * TYPICAL_RAD_S)
        total *= math.exp(0.5 * c[3] * math.log(size))
    return -c[0] * total / 3.0
