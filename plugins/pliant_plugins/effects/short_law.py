"""A joint of which only a share bends: what effects at the ends of a chain put around its law."""

from __future__ import annotations

from dataclasses import dataclass

from pliant.mechanics.law_around import LawAround
from pliant.records.design import Array
from pliant.records.law import Domain, Effort, JointLaw


@dataclass(frozen=True, eq=False)
class ShortLaw(LawAround):
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
        """As the law's, shapes (n, a), (n, a), (n, a, a)."""
        effort = self.law.evaluate(actuation, deformation / self.share)
        return Effort(effort.tau, effort.dtau_dp, effort.dtau_du / self.share)

    def potential(self, actuation: Array, deformation: Array) -> Array:
        """Π' (n,) in J."""
        return self.share * self.law.potential(actuation, deformation / self.share)

    def band(self, actuation: Array, deformation: Array, level: float = 0.9) -> Array | None:
        """The law's band at u/s."""
        return self.law.band(actuation, deformation / self.share, level)

    def draws(self, count: int, seed: int) -> tuple[JointLaw, ...]:
        """The law's draws, shortened."""
        return tuple(ShortLaw(law, self.share) for law in self.law.draws(count, seed))
