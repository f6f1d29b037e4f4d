"""A law of several actuations as a law of one of them, the others at zero: what a picture over one input shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.mechanics.law_around import LawAround
from pliant.records.design import Array
from pliant.records.error_bar import ErrorBar
from pliant.records.law import Domain, Effort, JointLaw, ScalarLaw


@dataclass(frozen=True, eq=False)
class OneInput(LawAround):
    """τ((0, …, p, …, 0), u) of the law inside.

    Attributes:
        place: which of its actuations p is.
    """

    place: int = 0

    @property
    def actuation_name(self) -> str:  # type: ignore[override]
        return self.law.actuations[self.place]

    @property
    def domain(self) -> Domain:  # type: ignore[override]
        inside = self.law.domain
        return Domain(inside.actuation[self.place], inside.deformation)

    @property
    def error(self) -> ErrorBar | None:  # type: ignore[override]
        """The bar of the law inside; `band` says how wide it is here."""
        return self.law.error

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        """Shapes (n, a), (n, a) and (n, a, a) for actuation (n,) and deformation (n, a)."""
        effort = self.law.evaluate(self._all(actuation), deformation)
        return Effort(effort.tau, effort.dtau_dp[:, :, self.place], effort.dtau_du)

    def potential(self, actuation: Array, deformation: Array) -> Array:
        """Π(p, u) − Π(p, 0) in J, shape (n,)."""
        return self.law.potential(self._all(actuation), deformation)

    def band(self, actuation: Array, deformation: Array, level: float = 0.9) -> Array | None:
        """That of the law inside, (n, a)."""
        return self.law.band(self._all(actuation), deformation, level)

    def scalar(self) -> ScalarLaw | None:
        """None: it is no law of a chain."""
        return None

    def _all(self, actuation: Array) -> Array:
        values = np.zeros((len(actuation), len(self.law.actuations)))
        values[:, self.place] = actuation
        return values


def of_one_input(law: JointLaw) -> JointLaw:
    """The law of the first input alone; the law itself where it has no other."""
    return law if len(law.actuations) == 1 else OneInput(law)
