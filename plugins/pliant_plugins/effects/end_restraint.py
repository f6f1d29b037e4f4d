"""Restraint of end sections: only a share of the first and last module bends, in series with the mount's compliance.

    u = s v − c τ',      τ'(p, u) = τ(p, v)

at the first joint of a chain with (s, c) of the base and at the last with those of the cap. A clamp or a glued cap
keeps its section round, whereas the adjacent wall ovalises when it bends; the restraint decays along the wall (end
effects in tubes: Brazier, Proc. R. Soc. A 116, 1927; Whatham, J. Pressure Vessel Technol. 108, 1986). The share s of
the module remains flexible: it turns by s times the angle under the same moment. The compliance c is that of the mount:
the tilt that a moment or a force at the end adds to that of the module; it is stated as c k₀, k₀ the stiffness at rest.
Both are exact law changes (`ShortLaw`, `series_law.py`). Positions of pieces and joints do not change. Full FEM of
bending modules: s = 0.99 and c k₀ = 0.1 at the clamp, 0.64 and 1.9 at the cap (docs/chain_of_modules.md).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

from pliant.errors import ImpossibleEffectError
from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.mechanics.law_wrapper import LawWrapper
from pliant.records.chain import Joint
from pliant.records.design import Array
from pliant.records.law import Domain, Effort, JointLaw
from pliant.units import Ratio
from pliant_plugins.effects.scale import rest_stiffness
from pliant_plugins.effects.series_law import SeriesLaw


@dataclass(frozen=True, eq=False)
class ShortLaw(LawWrapper):
    """τ'(p, u) = τ(p, u/s), Π'(p, u) = s Π(p, u/s): the share s of a module bends as the whole of it would.

    Attributes:
        law: the whole module's.
        share: s > 0.
    """

    share: float

    @property
    def domain(self) -> Domain:  # type: ignore[override]
        return Domain(self.law.domain.actuation, self.share * self.law.domain.deformation)

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        """Evaluate the shortened law; shapes (n, a), (n, a), (n, a, a)."""
        effort = self.law.evaluate(actuation, deformation / self.share)
        return Effort(effort.tau, effort.dtau_dp, effort.dtau_du / self.share)

    def potential(self, actuation: Array, deformation: Array) -> Array:
        """Return Π' (n,) in J."""
        return self.share * self.law.potential(actuation, deformation / self.share)

    def band(self, actuation: Array, deformation: Array, level: float = 0.9) -> Array | None:
        """Return the law's band at u/s."""
        return self.law.band(actuation, deformation / self.share, level)

    def draws(self, count: int, seed: int) -> tuple[JointLaw, ...]:
        """Return the law's draws, shortened."""
        return tuple(ShortLaw(law, self.share) for law in self.law.draws(count, seed))

    def unwrap(self) -> tuple[JointLaw, float, float]:
        """See `JointLaw.unwrap`."""
        law, stretch, give = self.law.unwrap()
        return law, stretch / self.share, give


class EndRestraintConfig(EffectConfig):
    """s and c k₀ at both ends."""

    kind: Literal["end_restraint"] = "end_restraint"
    base_share: Ratio = parameter(neutral=1.0, bounds=(0.2, 1.5), plausible=(0.5, 1.0), example=0.97)
    """share of the first module that bends"""
    cap_share: Ratio = parameter(neutral=1.0, bounds=(0.2, 1.5), plausible=(0.5, 1.0), example=0.65)
    """share of the last module that bends"""
    base_give: Ratio = parameter(neutral=0.0, bounds=(0.0, 10.0), plausible=(0.0, 2.0))
    """compliance of the clamp x stiffness at rest"""
    cap_give: Ratio = parameter(neutral=0.0, bounds=(0.0, 10.0), plausible=(0.0, 2.0))
    """compliance of the cap's mount x stiffness at rest"""


class EndRestraint(Effect):
    """A shorter flexible length and a spring at both ends of the chain."""

    place = "law"
    notes = EffectNotes(
        signature="the joints at the clamp and at the cap bend too little by the same share at every "
        "pressure and load, those between them are right; the tip's turn is off by a constant, however many "
        "modules there are.",
        inspection="look how far glue, hose clamp and cap reach over the first and the last bellow, and "
        "whether the clamp itself gives.",
        confounder="stiffness",
        distinguishing_test="read every joint's angle: a stiffness is wrong in all of them, held ends at the "
        "ends alone.",
        excitation="film a marker on every module through a slow pressure sweep, without a load and with "
        "loads either way.",
        where="chains of two joints or more of every family; every engine, in those that compile laws a "
        "slower way.",
    )
    recommended_experiments = ("second_sensor", "passive_load_steps")
    config: EndRestraintConfig

    def apply(self, model: Model) -> Model:
        """Return the model with its end joints shortened. Raises `ImpossibleEffectError` for a chain of one joint."""
        chain = model.chain
        if chain.n_joints < 2:
            raise ImpossibleEffectError(
                "effect 'end_restraint' acts on the ends of a chain and needs two joints or more, and "
                "this chain has one",
                "take it out of 'effects', or raise 'chain.modules'",
            )
        c = self.config
        per_give = int(chain.parts.max()) / rest_stiffness(chain)
        ends = ((c.base_share, c.base_give * per_give), (c.cap_share, c.cap_give * per_give))
        laws, joints = _restrained(chain.laws, chain.joints, ends)
        return model.with_(chain=chain.with_(laws=laws, joints=joints))


@lru_cache(maxsize=128)
def _restrained(
    laws: tuple[JointLaw, ...],
    joints: tuple[Joint, ...],
    ends: tuple[tuple[float, float], tuple[float, float]],
) -> tuple[tuple[JointLaw, ...], tuple[Joint, ...]]:
    """Append the laws of the two ends and assign them to their joints; return laws and joints.

    `ends` are share and compliance of the base's end and of the cap's. Equal input gives the same objects, because
    engines tabulate a law once per object.
    """
    wanted = list(joints)
    for at, (share, compliance) in zip((0, -1), ends, strict=True):
        law = laws[joints[at].law]
        if share != 1.0:
            law = ShortLaw(law, share)
        if compliance:
            law = SeriesLaw(law, compliance)
        if law is not laws[joints[at].law]:
            laws, wanted[at] = (*laws, law), replace(joints[at], law=len(laws))
    return laws, tuple(wanted)
