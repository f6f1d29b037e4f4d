"""A law of one chamber where several act on the joint: each brings its push, and all together one elasticity.

The law of a module holds its elasticity, τ(0, u), and what the chamber adds. K chambers on one joint do not make K
modules: Σ_k T_k [τ(p_k, T_kᵀu) − (1 − 1/K) τ(0, T_kᵀu)] has once the mean of the K elasticities, turned each to its
side, and every chamber's own push in full. It derives from the energy Σ_k [Π(p_k, T_kᵀu) − (1 − 1/K) Π(0, T_kᵀu)].
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pliant.mechanics.law_around import LawAround
from pliant.records.design import Array
from pliant.records.error_bar import ErrorBar
from pliant.records.law import Effort, JointLaw, ScalarLaw


@dataclass(frozen=True, eq=False)
class SharedElasticity(LawAround):
    """τ(p, u) − (1 − 1/K) τ(0, u) of the law inside: the part of one of K actuators on a joint.

    Attributes:
        count: K ≥ 2.
    """

    count: int

    @property
    def error(self) -> ErrorBar | None:  # type: ignore[override]
        """The bar of the law inside."""
        return self.law.error

    @property
    def less_rest(self) -> float:
        """1 − 1/K."""
        return 1.0 - 1.0 / self.count

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        """As the law's, shapes (n, a), (n, a), (n, a, a)."""
        effort = self.law.evaluate(actuation, deformation)
        rest = self.law.evaluate(np.zeros(len(deformation)), deformation)
        less = self.less_rest
        return Effort(effort.tau - less * rest.tau, effort.dtau_dp, effort.dtau_du - less * rest.dtau_du)

    def potential(self, actuation: Array, deformation: Array) -> Array:
        """Π(p, u) − Π(p, 0) of this part in J, shape (n,)."""
        rest = self.law.potential(np.zeros(len(deformation)), deformation)
        return self.law.potential(actuation, deformation) - self.less_rest * rest

    def band(self, actuation: Array, deformation: Array, level: float = 0.9) -> Array | None:
        """That of the law inside, (n, a)."""
        return self.law.band(actuation, deformation, level)

    def draws(self, count: int, seed: int) -> tuple[JointLaw, ...]:
        """Draws of the law inside in the same place; empty where it has no way of its own."""
        return tuple(replace(self, law=law) for law in self.law.draws(count, seed))

    def scalar(self) -> ScalarLaw | None:
        """The scalar form of the law inside, of which engines take off the share at p = 0; None where it has none."""
        inside = self.law.scalar()
        if inside is None or inside.less_rest:
            return None
        return replace(inside, less_rest=self.less_rest, shared=None)


def sharing_elasticity(law: JointLaw, count: int) -> JointLaw:
    """The law for one of `count` actuators on a joint; itself where it is alone, or has several of its own."""
    return law if count < 2 or len(law.actuations) > 1 else SharedElasticity(law, count)
