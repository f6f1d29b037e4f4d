"""A law whose supply gets a share of the chain's actuation, as behind a regulator of its own."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pliant.mechanics.law_around import LawAround
from pliant.records.design import Array
from pliant.records.error_bar import BarsOfAxes, ErrorBar
from pliant.records.law import Domain, Effort, JointLaw, ScalarLaw


@dataclass(frozen=True, eq=False)
class SharedActuation(LawAround):
    """τ(s p, u) of the law inside, p being the chain's actuation.

    Attributes:
        share: s > 0.
    """

    share: float

    @property
    def domain(self) -> Domain:  # type: ignore[override]
        """The box of the law inside, in the chain's actuation."""
        inside = self.law.domain
        return Domain(inside.actuation / self.share, inside.deformation)

    @property
    def error(self) -> ErrorBar | None:  # type: ignore[override]
        """The bar of the law inside, in the chain's actuation."""
        return None if self.law.error is None else _scaled(self.law.error, self.share)

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        """As the law's, shapes (n, a), (n, a), (n, a, a); ∂τ/∂p is by the chain's actuation."""
        effort = self.law.evaluate(self._acting(actuation), deformation)
        return Effort(effort.tau, self.share * effort.dtau_dp, effort.dtau_du)

    def potential(self, actuation: Array, deformation: Array) -> Array:
        """Π(s p, u) − Π(s p, 0) in J, shape (n,)."""
        return self.law.potential(self._acting(actuation), deformation)

    def band(self, actuation: Array, deformation: Array, level: float = 0.9) -> Array | None:
        """That of the law inside at s p, (n, a)."""
        return self.law.band(self._acting(actuation), deformation, level)

    def draws(self, count: int, seed: int) -> tuple[JointLaw, ...]:
        """Draws of the law inside under the same share; empty where it has no way of its own."""
        return tuple(SharedActuation(law, self.share) for law in self.law.draws(count, seed))

    def scalar(self) -> ScalarLaw | None:
        """The scalar form of the law inside with other parameters; None where it has none for a share."""
        inside = self.law.scalar()
        if inside is None or inside.shared is None:
            return None
        return replace(inside, parameters=inside.shared(inside.parameters, self.share))

    def _acting(self, actuation: Array) -> Array:
        return self.share * np.asarray(actuation, float)


def shared(law: JointLaw, share: float) -> JointLaw:
    """The law behind a share of the actuation; the law itself where it gets all of it."""
    return law if share == 1.0 else SharedActuation(law, share)


def unshared(law: JointLaw) -> tuple[JointLaw, float]:
    """The law inside and its share; a law without one gets all."""
    return (law.law, law.share) if isinstance(law, SharedActuation) else (law, 1.0)


def _scaled(bar: ErrorBar, share: float) -> ErrorBar:
    """The bar with its box in the chain's actuation; its places are shares of the box and stay."""
    if isinstance(bar, BarsOfAxes):
        return BarsOfAxes(tuple(None if one is None else _scaled(one, share) for one in bar.bars))
    box = np.array(bar.box)
    box[: len(box) - bar.misses.shape[1]] /= share
    return replace(bar, box=box)
