"""Law whose supply gets a share of the chain's actuation, as behind a separate regulator."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pliant.mechanics.law_wrapper import LawWrapper
from pliant.records.design import Array
from pliant.records.error_bar import BarsOfAxes, ErrorBand, ErrorBar
from pliant.records.law import Domain, Effort, JointLaw, ScalarLaw


@dataclass(frozen=True, eq=False)
class SharedActuation(LawWrapper):
    """τ(s p, u) of the wrapped law, with p the chain's actuation.

    Attributes:
        share: s > 0.
    """

    share: float

    @property
    def domain(self) -> Domain:  # type: ignore[override]
        """The box of the wrapped law, in the chain's actuation."""
        inside = self.law.domain
        return Domain(inside.actuation / self.share, inside.deformation)

    @property
    def error(self) -> ErrorBand | None:  # type: ignore[override]
        """The error of the wrapped law, in the chain's actuation."""
        return None if self.law.error is None else _scaled(self.law.error, self.share)

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        """Return effort and slopes, shapes (n, a), (n, a), (n, a, a); ∂τ/∂p is by the chain's actuation."""
        effort = self.law.evaluate(self._acting(actuation), deformation)
        return Effort(effort.tau, self.share * effort.dtau_dp, effort.dtau_du)

    def potential(self, actuation: Array, deformation: Array) -> Array:
        """Return Π(s p, u) − Π(s p, 0) in J, shape (n,)."""
        return self.law.potential(self._acting(actuation), deformation)

    def band(self, actuation: Array, deformation: Array, level: float = 0.9) -> Array | None:
        """Return the band of the wrapped law at s p, (n, a)."""
        return self.law.band(self._acting(actuation), deformation, level)

    def draws(self, count: int, seed: int) -> tuple[JointLaw, ...]:
        """Return the draws of the wrapped law under the same share; empty if it does not implement draws."""
        return tuple(SharedActuation(law, self.share) for law in self.law.draws(count, seed))

    def scalar(self) -> ScalarLaw | None:
        """Return the scalar form of the wrapped law with other parameters; None if it has none for a share."""
        inside = self.law.scalar()
        if inside is None or inside.shared is None:
            return None
        return replace(inside, parameters=inside.shared(inside.parameters, self.share))

    def _acting(self, actuation: Array) -> Array:
        return self.share * np.asarray(actuation, float)


def shared(law: JointLaw, share: float) -> JointLaw:
    """Return the law with a share of the actuation; the law itself for a share of 1."""
    return law if share == 1.0 else SharedActuation(law, share)


def unshared(law: JointLaw) -> tuple[JointLaw, float]:
    """Return the wrapped law and its share; a law without wrapper has the share 1."""
    return (law.law, law.share) if isinstance(law, SharedActuation) else (law, 1.0)


def _scaled(bar: ErrorBand, share: float) -> ErrorBand:
    """Return the bar with its box in the chain's actuation; its places are relative to the box and unchanged."""
    if isinstance(bar, BarsOfAxes):
        return BarsOfAxes(tuple(None if one is None else _scaled(one, share) for one in bar.bars))
    if not isinstance(bar, ErrorBar):
        return _ScaledBand(bar, share)
    box = np.array(bar.box)
    box[: len(box) - bar.misses.shape[1]] /= share
    return replace(bar, box=box)


@dataclass(frozen=True)
class _ScaledBand:
    """An error band as a function of the chain's actuation."""

    band: ErrorBand
    share: float

    def half_width(self, actuation: Array, deformation: Array, level: float = 0.9) -> Array:
        return self.band.half_width(self.share * np.asarray(actuation, float), deformation, level)
