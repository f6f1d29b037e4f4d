"""Law of one of several chambers on a joint: each adds its actuation part, and all together one elasticity.

The law of a module contains its elasticity, τ(0, u), and the chamber's actuation part. K chambers on one joint are not
K modules: Σ_k T_k [τ(p_k, T_kᵀu) − (1 − 1/K) τ(0, T_kᵀu)] contains the mean of the K elasticities, each rotated to its
side, once, and every chamber's actuation part in full. It derives from the energy
Σ_k [Π(p_k, T_kᵀu) − (1 − 1/K) Π(0, T_kᵀu)].
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pliant.mechanics.law_wrapper import LawWrapper
from pliant.records.design import Array
from pliant.records.error_bar import ErrorBand
from pliant.records.law import Effort, JointLaw, ScalarLaw


@dataclass(frozen=True, eq=False)
class SharedElasticity(LawWrapper):
    """τ(p, u) − (1 − 1/K) τ(0, u) of the wrapped law: the part of one of K actuators on a joint.

    Attributes:
        count: K ≥ 2.
    """

    count: int

    @property
    def error(self) -> ErrorBand | None:  # type: ignore[override]
        """The error of the wrapped law."""
        return self.law.error

    @property
    def less_rest(self) -> float:
        """1 − 1/K."""
        return 1.0 - 1.0 / self.count

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        """Return effort and slopes, shapes (n, a), (n, a), (n, a, a)."""
        effort = self.law.evaluate(actuation, deformation)
        rest = self.law.evaluate(np.zeros(len(deformation)), deformation)
        less = self.less_rest
        return Effort(effort.tau - less * rest.tau, effort.dtau_dp, effort.dtau_du - less * rest.dtau_du)

    def potential(self, actuation: Array, deformation: Array) -> Array:
        """Return Π(p, u) − Π(p, 0) of this part in J, shape (n,)."""
        rest = self.law.potential(np.zeros(len(deformation)), deformation)
        return self.law.potential(actuation, deformation) - self.less_rest * rest

    def band(self, actuation: Array, deformation: Array, level: float = 0.9) -> Array | None:
        """Return the band of the wrapped law, (n, a)."""
        return self.law.band(actuation, deformation, level)

    def draws(self, count: int, seed: int) -> tuple[JointLaw, ...]:
        """Return the draws of the wrapped law in the same wrapper; empty if it does not implement draws."""
        return tuple(replace(self, law=law) for law in self.law.draws(count, seed))

    def scalar(self) -> ScalarLaw | None:
        """Return the wrapped law's scalar form, from which engines subtract the share at p = 0; None without one."""
        inside = self.law.scalar()
        if inside is None or inside.less_rest:
            return None
        return replace(inside, less_rest=self.less_rest, shared=None)


def sharing_elasticity(law: JointLaw, count: int) -> JointLaw:
    """Return the law for one of `count` actuators on a joint; itself if `count` is 1 or the law takes several."""
    return law if count < 2 or len(law.actuations) > 1 else SharedElasticity(law, count)
