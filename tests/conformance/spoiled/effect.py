"""A good effect, an actuation gain, and effects that reach where they should not."""

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from pliant.interfaces.effect import Effect, EffectConfig, EffectParameter, Model, Place
from pliant.records.design import Array
from pliant.records.law import Domain, Effort, JointKind, JointLaw, LawRecord
from pliant.records.rollout import Inputs
from pliant.registry.component import Component
from pliant.units import Ratio
from spoiled import Spoils

PARAMETER = EffectParameter("gain", "1", neutral=1.0, bounds=(0.1, 10.0), plausible=(0.8, 1.2))


class GainConfig(EffectConfig):
    """A factor on the pressure that reaches the law."""

    kind: Literal["small"] = "small"
    gain: Ratio = Field(default=1.0, ge=0.1, le=10.0)


@dataclass(frozen=True, eq=False)
class GainedLaw(JointLaw):
    """τ(g p, u)."""

    inner: JointLaw
    gain: float
    joint: JointKind = field(init=False)
    axes: tuple[str, ...] = field(init=False)
    actuation_name: str = field(init=False)
    domain: Domain = field(init=False)

    def __post_init__(self) -> None:
        for name in ("joint", "axes", "actuation_name", "domain"):
            object.__setattr__(self, name, getattr(self.inner, name))

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        inner = self.inner.evaluate(self.gain * actuation, deformation)
        return replace(inner, dtau_dp=self.gain * inner.dtau_dp)

    def record(self) -> LawRecord:
        return self.inner.record()


class Gain(Effect):
    """Wraps every law."""

    place: ClassVar[Place] = "law"
    parameters: ClassVar[tuple[EffectParameter, ...]] = (PARAMETER,)
    config: GainConfig
    law: ClassVar[type[GainedLaw]] = GainedLaw

    def apply(self, model: Model) -> Model:
        laws = tuple(self.law(law, self.config.gain) for law in model.chain.laws)
        return model.with_(chain=model.chain.with_(laws=laws))


spoils = Spoils(
    Component("effect", "small", "spoiled.effect:GainConfig", "spoiled.effect:Gain", "a gain", {"gain": 1.1})
)


@spoils.by("declares_place_and_parameters", "plausible .* is not an ordered range")
class SwappedRange(Gain):
    """Plausible from high to low."""

    parameters = (replace(PARAMETER, plausible=(1.2, 0.8)),)


class BoundlessConfig(GainConfig):
    """No hard bounds."""

    gain: Ratio = 1.0


spoils.add("parameters_are_config_fields", "outside the bounds", config="spoiled.effect:BoundlessConfig")


@spoils.by("neutral_values_change_nothing", "every parameter neutral the law differs")
class NeverNeutral(Gain):
    """Neutral is said to be 0.9."""

    parameters = (replace(PARAMETER, neutral=0.9),)


@spoils.by("plausible_values_change_something", "parameter 'gain' has no effect")
class Unused(Gain):
    """Forgets its parameter."""

    def apply(self, model: Model) -> Model:
        return model


@spoils.by("acts_only_at_its_place", "place 'law' changed the chain")
class Lightens(Gain):
    """Also takes the payload off."""

    def apply(self, model: Model) -> Model:
        changed = super().apply(model)
        return changed.with_(chain=changed.chain.with_(payload_kg=0.0))


@spoils.by("leaves_the_model_alone", "changed in place")
class InPlace(Gain):
    """Turns gravity round in the caller's chain."""

    def apply(self, model: Model) -> Model:
        model.chain.gravity_m_s2[:] *= -1
        return super().apply(model)


@spoils.by("keeps_earlier_effects", "maps of effects applied before are lost")
class StartsAnew(Gain):
    """Makes a new model from the chain alone."""

    def apply(self, model: Model) -> Model:
        return Model(super().apply(model).chain)


class Unslopedlaw(GainedLaw):
    """Values with the gain, slopes without."""

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        good = super().evaluate(actuation, deformation)
        return replace(good, dtau_dp=self.inner.evaluate(actuation, deformation).dtau_dp)


@spoils.by("wrapped_laws_stay_laws", "dtau_dp of the wrapped law is not the slope")
class ForgetsTheSlope(Gain):
    """Its law's ∂τ/∂p lacks the gain."""

    law = Unslopedlaw


@spoils.by("model_runs_under_a_task", "AttributeError|NoneType")
class ReturnsNothing(Gain):
    """Its input map forgets to return."""

    def apply(self, model: Model) -> Model:
        def forget(inputs: Inputs) -> Any:
            np.multiply(1.1, inputs.moment_n_m)

        return super().apply(model).with_(inputs=(*model.inputs, forget))
