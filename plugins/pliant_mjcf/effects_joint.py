"""Effects that are numbers of a joint in MuJoCo, and a damping that is no number of it.

    stiffness           M = −k (q − q₀)         k₀' = max(k₀ + k, 0), about the joint's springref q₀
    rest_angle          M = −k₀ (q − q₀ − δ)    springref q₀' = q₀ + δ
    viscous_damping     M = −c v                c₀' = max(c₀ + c, 0)
    coulomb_friction    |M| ≤ M_c               frictionloss M_c' = max(M_c + M, 0)

for each chosen hinge, and for slides with forces in place of moments (MuJoCo documentation, Computation: passive forces
and friction loss). A model may have too much of each: strengths may be negative, down to what it has. A joint held by
friction loss creeps: at (M/I) (1 − d)/d d_max T/2, 1 ms M/I with MuJoCo's impedances d and time constant T by default.
A damping that thins or thickens with the rate is M = −c ω̂ sign(v) (|v|/ω̂)^n, ω̂ = 0.1 rad/s (Ostwald & de Waele), as
the force at the end of the step: −g v / (1 + g Δt / I) with the secant g = M/v and the inertia I of `elements.Joints`,
which is stable in any step.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from pliant.errors import ImpossibleEffectError
from pliant.interfaces.effect import EffectConfig, EffectNotes, parameter
from pliant.interfaces.model import SystemParts, effect_kind
from pliant.records.design import Array
from pliant.units import Angle, AngularDamping, Moment
from pliant_mjcf.effect_bases import EffectChange, JointMemory, ModelEffect
from pliant_mjcf.elements import Joints, added, set_linear, with_id
from pliant_plugins.effects.factors import STILL_RAD_S, TYPICAL_RAD_S
from pliant_plugins.effects.stiffness import Stiffness
from pliant_plugins.effects.viscous_damping import ViscousDamping

WHERE = "hinges and slides of MuJoCo models, all or those that a pattern names."


class JointStiffnessConfig(EffectConfig):
    """Additional stiffness of a joint."""

    kind: str = effect_kind("stiffness")
    stiffness_n_m_per_rad: float = parameter(
        unit="N*m/rad", neutral=0.0, bounds=(-1e6, 1e6), plausible=(-1.0, 1.0), example=0.5
    )
    """true − model's stiffness; of a slide in N/m"""


class JointStiffness(ModelEffect):
    """An additional spring about the joint's springref."""

    place = "joint"
    config: JointStiffnessConfig
    notes = replace(
        Stiffness.notes,
        signature="the joint rests and swings as with another spring: the error grows with the angle from where "
        "its spring rests, whatever the rate.",
        inspection="hang known weights on the joint with the drive off and read the angle; feel for cables and hoses "
        "that bend with it.",
        distinguishing_test="with the drive at rest, a load shows a stiffness and not a gain.",
        excitation="hold several levels of every input, slowly, in both directions.",
        where=WHERE,
    )
    recommended_experiments = ("slow_cycles", "step_response")

    def change(self, model: Any) -> None:
        for k in self.numbers(model):
            model.jnt_stiffness[k] = added(model.jnt_stiffness[k], self.config.stiffness_n_m_per_rad)

    def write(self, spec: Any, model: Any) -> None:
        for k in self.numbers(model):
            joint = with_id(spec.joints, k)
            fix_spring(joint, model)
            set_linear(joint, "stiffness", model.jnt_stiffness[k])


class RestAngleConfig(EffectConfig):
    """Shift of the angle at which a joint's spring rests."""

    kind: str = effect_kind("rest_angle")
    shift_rad: Angle = parameter(neutral=0.0, bounds=(-6.3, 6.3), plausible=(-0.2, 0.2), example="3 deg")
    """true − model's springref; of a slide in m"""


class RestAngle(ModelEffect):
    """A spring that rests elsewhere; joints without a spring keep none."""

    place = "joint"
    config: RestAngleConfig
    notes = EffectNotes(
        signature="angles are off by one amount at every level of the inputs, most where the joint is soft, and with "
        "the drive off as well.",
        inspection="switch the drive off and read where the joint rests; look for a set of rubber or a bent spring.",
        confounder="sensor_bias",
        distinguishing_test="read a position as well: a spring that rests elsewhere moves the body, a sensor's zero "
        "only its reading; and a drive that holds a position hides the spring.",
        excitation="no motion of any input, then slow cycles.",
        where=WHERE + " They need a stiffness.",
    )
    recommended_experiments = ("vented_zero", "slow_cycles")

    def numbers(self, model: Any) -> list[int]:
        """Return the numbers of the chosen joints with a spring; raise `UserError` without any."""
        higher = getattr(model, "jnt_stiffnesspoly", np.zeros((model.njnt, 1)))
        found = [k for k in super().numbers(model) if model.jnt_stiffness[k] or np.any(higher[k])]
        if not found:
            raise ImpossibleEffectError(
                f"effect '{self.config.kind}' shifts springs, and no joint of it has one"
            )
        return found

    def change(self, model: Any) -> None:
        model.qpos_spring[model.jnt_qposadr[self.numbers(model)]] += self.config.shift_rad

    def write(self, spec: Any, model: Any) -> None:
        import mujoco

        for k in self.numbers(model):
            joint = with_id(spec.joints, k)
            degrees = spec.compiler.degree and model.jnt_type[k] == int(mujoco.mjtJoint.mjJNT_HINGE)
            rest = float(model.qpos_spring[model.jnt_qposadr[k]])
            joint.springref = np.degrees(rest) if degrees else rest


class JointDampingConfig(EffectConfig):
    """Additional damping of a joint."""

    kind: str = effect_kind("viscous_damping")
    damping_n_m_s: AngularDamping = parameter(
        neutral=0.0, bounds=(-1e5, 1e5), plausible=(-0.2, 0.2), example="0.05 N*m*s"
    )
    """true − model's damping; of a slide in N·s/m"""
    rate_power: float = parameter(unit="1", neutral=1.0, bounds=(0.3, 2.0), plausible=(0.6, 1.4), role="form")
    """power of the rate with which the moment grows"""


class JointDamping(JointMemory):
    """An additional dashpot."""

    config: JointDampingConfig
    notes = replace(
        ViscousDamping.notes,
        signature="a loop between up and down whose width is proportional to the rate; free swings die out sooner or "
        "later than the model's.",
        inspection="switch the drive off, swing the joint by hand, let go and film how fast the swing dies out.",
        confounder="coulomb_friction",
        distinguishing_test="swing freely: by damping each swing is smaller by one factor, by dry friction by one "
        "amount, until it stops.",
        excitation="run the same cycle at three rates a factor of three apart, and steps.",
        where=WHERE,
    )
    recommended_experiments = ("fast_cycles", "step_response")

    def change(self, model: Any) -> None:
        for dof in model.jnt_dofadr[self.numbers(model)]:
            model.dof_damping[dof] = added(model.dof_damping[dof], self.config.damping_n_m_s)

    def write(self, spec: Any, model: Any) -> None:
        for k in self.numbers(model):
            joint = with_id(spec.joints, k)
            fix_spring(joint, model)
            set_linear(joint, "damping", model.dof_damping[model.jnt_dofadr[k]])

    def act(self, parts: SystemParts) -> SystemParts:
        """Return the parts with a number of the joints, or with a force if it is not in proportion to the rate."""
        return parts.with_change(EffectChange(self)) if self.config.rate_power == 1.0 else super().act(parts)

    def advance(self, joints: Joints, state: Any, q: Array, v: Array, step_s: float) -> tuple[Array, Any]:
        """Return the moments; no more is taken away than the model's damping has."""
        size = np.sqrt(v * v + STILL_RAD_S * STILL_RAD_S) / TYPICAL_RAD_S
        secant = np.maximum(
            self.config.damping_n_m_s * size ** (self.config.rate_power - 1.0), -joints.damping
        )
        return -secant * v / (1.0 + np.maximum(secant, 0.0) * step_s / joints.inertia), state


class CoulombFrictionConfig(EffectConfig):
    """Additional dry friction of a joint."""

    kind: str = effect_kind("coulomb_friction")
    moment_n_m: Moment = parameter(neutral=0.0, bounds=(-1e5, 1e5), plausible=(-0.5, 0.5), example="0.1 N*m")
    """true − model's friction; of a slide in N"""


class CoulombFriction(ModelEffect):
    """An additional friction loss."""

    place = "joint"
    config: CoulombFrictionConfig
    notes = EffectNotes(
        signature="the joint rests until the drive exceeds one level, and lags by the same moment at every rate; "
        "free swings lose the same amount each time and end off their rest.",
        inspection="raise the drive slowly until the joint breaks loose, in both directions: half the difference is "
        "friction.",
        confounder="viscous_damping",
        distinguishing_test="a slow cycle: its loop stays as wide by dry friction, and closes by damping.",
        excitation="slow cycles with small loops, and the same at a rate ten times as high.",
        where=WHERE,
    )
    recommended_experiments = ("slow_cycles", "small_loops")

    def change(self, model: Any) -> None:
        add_friction(model, self.numbers(model), self.config.moment_n_m)

    def write(self, spec: Any, model: Any) -> None:
        write_friction(spec, model, self.numbers(model))


def add_friction(model: Any, joints: list[int], moment: float) -> None:
    """Add to the friction loss of joints, down to none."""
    for dof in model.jnt_dofadr[joints]:
        model.dof_frictionloss[dof] = added(model.dof_frictionloss[dof], moment)


def write_friction(spec: Any, model: Any, joints: list[int]) -> None:
    """Write the friction loss of joints into the specification."""
    for k in joints:
        with_id(spec.joints, k).frictionloss = float(model.dof_frictionloss[model.jnt_dofadr[k]])


def fix_spring(joint: Any, model: Any) -> None:
    """Write stiffness and damping of a specification's joint as numbers, where a time constant stated them."""
    if np.any(np.asarray(joint.springdamper) > 0.0):
        set_linear(joint, "stiffness", model.jnt_stiffness[joint.id])
        set_linear(joint, "damping", model.dof_damping[model.jnt_dofadr[joint.id]])
        joint.springdamper = np.zeros(2)
