"""A tendon that rubs where it bends.

    A'(F, u) = e^(−μ w z) A(F, u),      w_i = (i − 1/2) |u_i| + i w₀,      z' = clip(z + Δu / δ, −1, 1)

for joint i from the base: tension falls by e^(−μ w) behind the wrap w while the tendon is pulled in (z = 1) and is as
much larger while it is let out (z = −1): the capstan equation of Euler and Eytelwein, for tendons in sheaths as in
Kaneko, Yamashita & Tanie (Proc. Int. Conf. Advanced Robotics, 1991) and Do et al. (Mechatronics 24, 2014). The wrap up
to the middle of joint i is taken as if all joints before it were bent as far, plus w₀ per joint for the tendon's own
curves at rest. The direction z turns over within the small angle δ, as the element of `friction_hysteresis` does.
Pulled and released, the actuation at one angle differs by the factor e^(2 μ w).

The angle decides, not the time, so it acts on states that are reached slowly as well.
"""

from __future__ import annotations

import math
from typing import Literal

from pliant.errors import ImpossibleEffectError
from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.term import LawTerm
from pliant.units import Angle, Ratio

TENDON = "tendon_force_n"


class TendonFrictionConfig(EffectConfig):
    """μ, w₀ and δ."""

    kind: Literal["tendon_friction"] = "tendon_friction"
    friction: Ratio = parameter(neutral=0.0, bounds=(0.0, 1.5), plausible=(0.05, 0.4), example=0.2)
    """coefficient of friction of the tendon in its guides"""
    wrap_at_rest_rad: Angle = parameter(neutral=0.0, bounds=(0.0, 3.2), plausible=(0.0, 0.2), role="form")
    """angle by which the tendon bends in each joint at rest"""
    break_away_rad: Angle = parameter(
        neutral=0.01, bounds=(0.002, 0.05), plausible=(0.004, 0.03), role="form", prior="log_normal"
    )
    """angle of a joint in which friction turns over"""


class TendonFriction(Effect):
    """A factor on the actuation part: the share of the tendon's tension that friction transmits."""

    place = "law"
    notes = EffectNotes(
        signature="pulling and releasing run apart in proportion to the tension, the wider the more the "
        "chain is bent and the farther from the base, at every rate; loads without tension are followed "
        "without a loop.",
        inspection="pull the tendon over the bent chain with a spring scale, in and out: half the difference "
        "is friction; clean or line the guides.",
        confounder="friction_hysteresis",
        distinguishing_test="the loop of a rubbing tendon grows with its tension and its wrap; that of dry "
        "friction in the joint is as wide at small forces as at large ones.",
        excitation="pull and release the tendon slowly to a third, two thirds and all of the range, and step "
        "a load without tension; read every joint.",
        where="families with a tendon (tendon_joint) that pulls one way; engines that follow memory.",
    )
    recommended_experiments = ("slow_cycles", "small_loops", "passive_load_steps", "second_sensor")
    actuation = TENDON
    config: TendonFrictionConfig

    def apply(self, model: Model) -> Model:
        """Return the model with one more factor on the actuation part.

        Raises:
            UserError: a chain that no tendon drives, or tendons that pull either way.
        """
        config, sign = self.config, _pull(model.chain)
        parameters = (config.friction, config.wrap_at_rest_rad, config.break_away_rad, sign)
        rows = tuple((float(i),) for i in range(1, model.chain.n_joints + 1))
        term = LawTerm("actuation", _factor, parameters, n_states=2, needs_time=True, per_joint=rows)
        return model.with_term(term)


def _pull(chain: ChainModel) -> float:
    """Return the sign of the angle toward which the tendons bend a joint."""
    names = sorted({law.actuation_name for law in chain.laws})
    if names != [TENDON]:
        raise ImpossibleEffectError(
            f"effect 'tendon_friction' needs a tendon, and the chain's law takes {', '.join(names)}; families with "
            "tendons are 'tendon_joint' and measured laws of tendon_force_n"
        )
    signs = {math.copysign(1.0, actuator.sign) for actuator in chain.actuators}
    if len(signs) > 1:
        raise ImpossibleEffectError(
            "effect 'tendon_friction' is for tendons that pull one way, and this chain has opposed ones: while one is "
            "pulled in the other is let out"
        )
    return signs.pop()


def _factor(
    angle: float, rate: float, dt_s: float, actuation: float, temp_c: float, old: Array, new: Array, c: Array
) -> float:
    # Memory: the direction z, and the angle of the sample before. Numbers: μ, w₀, δ, sign of the pull, i.
    moved = c[3] * (angle - old[1]) / c[2]
    new[0] = min(max(old[0] + moved, -1.0), 1.0)
    new[1] = angle
    wrap = (c[4] - 0.5) * abs(angle) + c[4] * c[1]
    return math.exp(-c[0] * wrap * new[0])
