"""Passive stiffness that differs from the model's.

    τ'(p, u) = τ(p, u) + (f − 1) τ(0, u)

The effort is split as in the reference study (Yao, Howard, Maiolino, doi 10.1002/aisy.70406) into an
elastic part, which is all that is left at p = 0, and an actuation part; the modulus of the material
scales the first.

Signature: angles under load at p = 0 scale by 1/f; free angles change less than in proportion where
pressure stiffens the module; no dependence on rate, history or orientation.
Nearest look-alike: `actuation_gain`, which has the same free angles (1/f for the gain) but nothing at p =
0: load steps without pressure separate the two.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from pliant.interfaces.effect import Effect, EffectConfig, EffectParameter, Model, Place
from pliant.records.design import Array
from pliant.records.law import Domain, Effort, JointKind, JointLaw, LawRecord
from pliant.units import Ratio

BOUNDS = (0.05, 20.0)


class StiffnessConfig(EffectConfig):
    """f, true passive stiffness / model's."""

    kind: Literal["stiffness"] = "stiffness"
    factor: Ratio = Field(
        default=1.0, ge=BOUNDS[0], le=BOUNDS[1], description="true passive stiffness / model's"
    )


class Stiffness(Effect):
    """Scales the elastic part of every joint law."""

    place: ClassVar[Place] = "law"
    parameters: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter("factor", "1", neutral=1.0, bounds=BOUNDS, plausible=(0.7, 1.4)),
    )
    config: StiffnessConfig

    def apply(self, model: Model) -> Model:
        """The model with every law of its chain wrapped."""
        laws = tuple(StiffenedLaw(law, self.config.factor) for law in model.chain.laws)
        return model.with_(chain=model.chain.with_(laws=laws))


@dataclass(frozen=True, eq=False)
class StiffenedLaw(JointLaw):
    """A law whose effort at zero actuation is scaled. Its domain is that of the inner law."""

    inner: JointLaw
    factor: float
    joint: JointKind = field(init=False)
    axes: tuple[str, ...] = field(init=False)
    actuation_name: str = field(init=False)
    domain: Domain = field(init=False)

    def __post_init__(self) -> None:
        for name in ("joint", "axes", "actuation_name", "domain"):
            object.__setattr__(self, name, getattr(self.inner, name))

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        """τ' and its slopes for actuation (n,) and deformation (n, a)."""
        whole = self.inner.evaluate(actuation, deformation)
        elastic = self.inner.evaluate(np.zeros(len(deformation)), deformation)
        more = self.factor - 1
        return Effort(whole.tau + more * elastic.tau, whole.dtau_dp, whole.dtau_du + more * elastic.dtau_du)

    def potential(self, actuation: Array, deformation: Array) -> Array:
        """The inner potential and (f − 1) times that at zero actuation, shape (n,)."""
        elastic = self.inner.potential(np.zeros(len(deformation)), deformation)
        potential: Array = self.inner.potential(actuation, deformation) + (self.factor - 1) * elastic
        return potential

    def record(self) -> LawRecord:
        """The inner law's record with the factor; for provenance, the study's `effects` make it again."""
        inner = self.inner.record()
        values = {"factor": self.factor, "inner": {"kind": inner.kind, "values": dict(inner.values)}}
        return LawRecord("effect:stiffness", values, inner.arrays)
