"""Effects of tendons of MuJoCo models.

    tendon_friction     |F| ≤ F_c          frictionloss F_c' = max(F_c + F, 0)
    tendon_stiffness    F = −k (L − L₀)    k₀' = max(k₀ + k, 0), about the tendon's springlength L₀
    tendon_slack        a drive that pulls the tendon shorter first takes up the slack s (see `effects_drive`)

for each chosen tendon of length L (MuJoCo documentation, Modeling: tendons). A model may have too much friction or
stiffness: strengths may be negative, down to what it has.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.interfaces.effect import EffectConfig, EffectNotes, parameter
from pliant.interfaces.model import effect_kind
from pliant.records.design import Array
from pliant.units import Force, Length
from pliant_mjcf.effect_bases import ModelEffect
from pliant_mjcf.effects_drive import DriveEffect
from pliant_mjcf.elements import added, set_linear, with_id

WHERE = "tendons of MuJoCo models, all or those that a pattern names."


class TendonFrictionConfig(EffectConfig):
    """Additional dry friction along a tendon."""

    kind: str = effect_kind("tendon_friction")
    force_n: Force = parameter(neutral=0.0, bounds=(-1e5, 1e5), plausible=(-5.0, 5.0), example="1 N")
    """true − model's friction"""


class TendonFriction(ModelEffect):
    """An additional friction loss of a tendon."""

    place = "tendon"
    config: TendonFrictionConfig
    notes = EffectNotes(
        signature="pulling and releasing run apart by one force at every rate, in all joints that the tendon passes.",
        inspection="pull the tendon by a spring scale, in and out: half the difference is friction; clean or line the "
        "guides.",
        confounder="coulomb_friction",
        distinguishing_test="move the joints by hand with the tendon unhooked: the friction of a tendon is gone.",
        excitation="pull and release the tendon slowly, in large and small cycles.",
        where=WHERE,
    )
    recommended_experiments = ("slow_cycles", "small_loops")

    def change(self, model: Any) -> None:
        for k in self.numbers(model):
            model.tendon_frictionloss[k] = added(model.tendon_frictionloss[k], self.config.force_n)

    def write(self, spec: Any, model: Any) -> None:
        for k in self.numbers(model):
            with_id(spec.tendons, k).frictionloss = float(model.tendon_frictionloss[k])


class TendonStiffnessConfig(EffectConfig):
    """Additional stiffness of a tendon."""

    kind: str = effect_kind("tendon_stiffness")
    stiffness_n_per_m: float = parameter(
        unit="N/m", neutral=0.0, bounds=(-1e8, 1e8), plausible=(-100.0, 100.0), example=50.0
    )
    """true − model's stiffness"""


class TendonStiffness(ModelEffect):
    """An additional spring about the tendon's length at rest."""

    place = "tendon"
    config: TendonStiffnessConfig
    notes = EffectNotes(
        signature="the joints that the tendon passes rest and swing together as with another spring.",
        inspection="hang a known weight on the tendon and read how far it stretches.",
        confounder="stiffness",
        distinguishing_test="move one joint of the tendon alone: a tendon's spring moves the others, a joint's not.",
        excitation="hold several levels of every input, slowly, in both directions.",
        where=WHERE,
    )
    recommended_experiments = ("slow_cycles", "step_response")

    def change(self, model: Any) -> None:
        for k in self.numbers(model):
            model.tendon_stiffness[k] = added(model.tendon_stiffness[k], self.config.stiffness_n_per_m)

    def write(self, spec: Any, model: Any) -> None:
        for k in self.numbers(model):
            set_linear(with_id(spec.tendons, k), "stiffness", model.tendon_stiffness[k])


class TendonSlackConfig(EffectConfig):
    """Slack of a driven tendon."""

    kind: str = effect_kind("tendon_slack")
    slack_m: Length = parameter(neutral=0.0, bounds=(0.0, 1.0), plausible=(0.0, 0.01), example="2 mm")
    """length by which the drive must move before the tendon pulls"""


class TendonSlack(DriveEffect):
    """A tendon that is longer than the model's, and that position drives first have to take up."""

    place = "tendon"
    transmissions = ("mjTRN_TENDON",)
    config: TendonSlackConfig
    notes = EffectNotes(
        signature="the joints stand while the drive takes up the slack, then follow as the model does; the joints move "
        "less far than commanded by one length.",
        inspection="feel at rest whether the tendon hangs loose, and how far the drive turns before it is tight.",
        confounder="dead_zone",
        distinguishing_test="load the joints against the tendon: a slack tendon is taken up earlier, a dead zone of "
        "the command stays as wide.",
        excitation="pull every tendon from rest slowly, alone.",
        where="tendons that position actuators of MuJoCo models pull, all or those that a pattern names.",
    )
    recommended_experiments = ("slow_cycles", "small_loops")

    def lost(self, error: Array) -> Array:
        """Return the part of the pull that takes up the slack."""
        return np.clip(error, -self.config.slack_m, 0.0)
