"""Forces at joints that MuJoCo lacks: Stribeck friction, a spring that slips, a spring that relaxes.

    stribeck_friction      M = −M_s (ρ + (1 − ρ) e^(−(v/v_s)²)) sign(v)
    friction_hysteresis    M = −k z,    z' = clip(z + Δq, −δ, δ),    k = M_y / δ
    viscoelastic           M = −k h,    dh/dt = v − h / T

Stribeck's curve is that of Armstrong-Hélouvry, Dupont & Canudas de Wit (Automatica 30, 1994): friction M_s at rest, and
ρ M_s at speed. MuJoCo's friction loss is raised by M_s, so that the joint really stops, and the share
(1 − ρ)(1 − e^(−(v/v_s)²)) of it is given back while it moves. Hysteresis is the stop of Iwan (J. Appl. Mech. 33,
1966), as for chains. The Maxwell branch over a step Δt of constant velocity is exact (Taylor, Pister & Goudreau, Int.
J. Numer. Meth. Eng. 2, 1970):

    h' = e^(−Δt/T) h + (1 − e^(−Δt/T)) T/Δt Δq

As for chains, several springs may slip one after another or relax in several times (`spread`). Runs begin with relaxed
springs. A spring is no stiffer than a step resolves, k ≤ I / Δt² with the inertia I of
`elements.Joints`: a shorter break-away is then M_y / k.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from pliant.interfaces.effect import EffectConfig, EffectNotes, parameter
from pliant.interfaces.model import SystemParts, effect_kind
from pliant.records.design import Array
from pliant.units import Angle, Moment, Ratio, Time
from pliant_mjcf.effect_bases import EffectChange, JointForce, JointMemory
from pliant_mjcf.effects_joint import WHERE, add_friction
from pliant_mjcf.elements import Joints
from pliant_plugins.effects.friction_hysteresis import FrictionHysteresis
from pliant_plugins.effects.viscoelastic import Viscoelastic


class StribeckFrictionConfig(EffectConfig):
    """Friction that falls with the speed."""

    kind: str = effect_kind("stribeck_friction")
    moment_n_m: Moment = parameter(neutral=0.0, bounds=(0.0, 1e5), plausible=(0.0, 0.5), example="0.1 N*m")
    """friction at rest; of a slide in N"""
    sliding_ratio: Ratio = parameter(
        neutral=0.5,
        bounds=(0.0, 1.0),
        plausible=(0.3, 0.9),
        role="shape",
        simpler={1.0: "it never falls: coulomb_friction is enough"},
    )
    """friction at speed over friction at rest"""
    speed_rad_s: float = parameter(
        unit="rad/s",
        neutral=0.1,
        bounds=(1e-4, 100.0),
        plausible=(0.01, 1.0),
        role="shape",
        prior="log_normal",
        simpler={100.0: "it never falls: coulomb_friction is enough"},
    )
    """speed at which most of it is lost"""


class StribeckFriction(JointForce):
    """Dry friction that is larger at rest than at speed."""

    config: StribeckFrictionConfig
    notes = EffectNotes(
        signature="the joint sticks, breaks loose with a jerk and then runs with less friction; slow motions go by "
        "sticks and slips, fast ones are smooth.",
        inspection="raise the drive slowly and read its level when the joint breaks loose, and the one at which it "
        "keeps moving slowly; look at the grease.",
        confounder="coulomb_friction",
        distinguishing_test="the level that starts the joint and the one that keeps it moving: dry friction alone has "
        "one level.",
        excitation="cycles from very slow to fast, with reversals.",
        where=WHERE,
    )
    recommended_experiments = ("slow_cycles", "small_loops", "fast_cycles")

    def act(self, parts: SystemParts) -> SystemParts:
        """Return the parts with friction loss, and a force that gives back what is lost with the speed."""
        return super().act(parts if self.is_neutral else parts.with_change(EffectChange(self)))

    def change(self, model: Any) -> None:
        add_friction(model, self.numbers(model), self.config.moment_n_m)

    def force(self, q: Array, v: Array) -> Array:
        lost = -np.expm1(-((v / self.config.speed_rad_s) ** 2))
        most = (1.0 - self.config.sliding_ratio) * self.config.moment_n_m
        return np.asarray(most * lost * np.sign(v))


class JointHysteresisConfig(EffectConfig):
    """Dry friction of elastic parts."""

    kind: str = effect_kind("friction_hysteresis")
    yield_n_m: Moment = parameter(neutral=0.0, bounds=(0.0, 1e5), plausible=(0.0, 0.5), example="0.1 N*m")
    """moment at which it slips; of a slide in N"""
    break_away_rad: Angle = parameter(
        neutral=0.02,
        bounds=(1e-5, 1.0),
        plausible=(0.002, 0.2),
        role="shape",
        prior="log_normal",
        simpler={1e-5: "it slips at once: coulomb_friction is enough"},
        example="1 deg",
    )
    """distance after which it slips; of a slide in m"""
    spread: Ratio = parameter(neutral=0.0, bounds=(0.0, 0.95), plausible=(0.0, 0.8), role="form")
    """of surfaces that slip one after another: how far the distances of three of them are apart"""


class JointHysteresis(JointMemory):
    """A spring that slips: stiffness M_y / δ, moment at most M_y; or the mean of three of them."""

    config: JointHysteresisConfig
    notes = replace(
        FrictionHysteresis.notes,
        inspection="move the joint by hand to either side with the drive off, let it come back and mark where it "
        "stays; look for cables, belts and sleeves that rub.",
        confounder="coulomb_friction",
        distinguishing_test="small loops: an elastic element follows them with its stiffness, dry friction does not.",
        excitation="slow cycles with small loops inside the large one, at two rates a factor of ten apart.",
        where=WHERE,
    )
    recommended_experiments = ("small_loops", "slow_cycles", "fast_cycles")

    def begin(self, joints: Joints, q: Array, v: Array) -> tuple[Array, Array]:
        """Return the position, and (m, r, n) the stretch of the springs."""
        return q.copy(), np.zeros((3 if self.config.spread else 1, *q.shape))

    def advance(self, joints: Joints, state: Any, q: Array, v: Array, step_s: float) -> tuple[Array, Any]:
        """Return the moments of the springs, and their next states."""
        before, stretch = state
        spread, parts = self.config.spread, len(stretch)
        ratios = np.array([1.0, 1.0 - spread, 1.0 + 3.0 * spread][:parts])[:, None, None]
        yields = self.config.yield_n_m / parts
        stiffness = np.minimum(
            yields / (self.config.break_away_rad * ratios), joints.inertia / (parts * step_s**2)
        )
        most = yields / stiffness
        stretch = np.clip(stretch + (q - before), -most, most)
        return -np.sum(stiffness * stretch, axis=0), (q.copy(), stretch)


class JointRelaxationConfig(EffectConfig):
    """A Maxwell branch."""

    kind: str = effect_kind("viscoelastic")
    stiffness_n_m_per_rad: float = parameter(
        unit="N*m/rad", neutral=0.0, bounds=(0.0, 1e6), plausible=(0.0, 1.0), example=0.5
    )
    """stiffness that relaxes; of a slide in N/m"""
    time_s: Time = parameter(
        neutral=1.0,
        bounds=(0.001, 1000.0),
        plausible=(0.05, 50.0),
        role="shape",
        prior="log_normal",
        simpler={0.001: "it relaxes at once: viscous_damping is enough"},
        example="2 s",
    )
    """time constant in which it relaxes"""
    spread: Ratio = parameter(neutral=1.0, bounds=(1.0, 12.0), plausible=(1.0, 5.0), role="form")
    """with more than one time constant: ratio of each of three to the next"""


class JointRelaxation(JointMemory):
    """A spring and a dashpot in series, parallel to the joint's own spring; or three of them."""

    config: JointRelaxationConfig
    notes = replace(
        Viscoelastic.notes,
        signature="the joint continues to creep while the inputs are held, and comes back as slowly; fast runs look "
        "stiffer than slow ones.",
        inspection="hold every input for several times as long as usual and see whether the joint still creeps at "
        "the end.",
        excitation="step the inputs quickly, hold them for long, return and keep recording.",
        where=WHERE,
    )
    recommended_experiments = ("holds", "fast_cycles", "slow_cycles")

    def begin(self, joints: Joints, q: Array, v: Array) -> tuple[Array, Array]:
        """Return the position, and (m, r, n) the stretch of the springs."""
        return q.copy(), np.zeros((1 if self.config.spread == 1.0 else 3, *q.shape))

    def advance(self, joints: Joints, state: Any, q: Array, v: Array, step_s: float) -> tuple[Array, Any]:
        """Return the moments of the branches, and their next states."""
        before, stretch = state
        spread, parts = self.config.spread, len(stretch)
        ratios = np.array([1.0, spread, 1.0 / spread][:parts])[:, None, None]
        steps = step_s / (self.config.time_s * ratios)
        stretch = np.exp(-steps) * stretch - np.expm1(-steps) / steps * (q - before)
        stiffness = np.minimum(self.config.stiffness_n_m_per_rad, joints.inertia / step_s**2) / parts
        return -stiffness * np.sum(stretch, axis=0), (q.copy(), stretch)
