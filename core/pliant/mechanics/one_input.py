"""Restriction of a law of several actuations to one of them, the others at zero, for pictures over one input."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.mechanics.law_wrapper import LawWrapper
from pliant.records.design import Array
from pliant.records.error_bar import ErrorBand
from pliant.records.law import Domain, Effort, JointLaw, ScalarLaw


@dataclass(frozen=True, eq=False)
class OneInput(LawWrapper):
    """τ((0, …, p, …, 0), u) of the wrapped law.

    Attributes:
        place: index of p among its actuations.
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
    def error(self) -> ErrorBand | None:  # type: ignore[override]
        """The error of the wrapped law; `band` gives its width here."""
        return self.law.error

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        """Return shapes (n, a), (n, a) and (n, a, a) for actuation (n,) and deformation (n, a)."""
        effort = self.law.evaluate(self._all(actuation), deformation)
        return Effort(effort.tau, effort.dtau_dp[:, :, self.place], effort.dtau_du)

    def potential(self, actuation: Array, deformation: Array) -> Array:
        """Return Π(p, u) − Π(p, 0) in J, shape (n,)."""
        return self.law.potential(self._all(actuation), deformation)

    def band(self, actuation: Array, deformation: Array, level: float = 0.9) -> Array | None:
        """Return the band of the wrapped law, (n, a)."""
        return self.law.band(self._all(actuation), deformation, level)

    def scalar(self) -> ScalarLaw | None:
        """Return None, since it is not a law of a chain."""
        return None

    def _all(self, actuation: Array) -> Array:
        values = np.zeros((len(actuation), len(self.law.actuations)))
        values[:, self.place] = actuation
        return values


def first_input_law(law: JointLaw) -> JointLaw:
    """Return the law of the first input; the law itself if it has no other input."""
    return law if len(law.actuations) == 1 else OneInput(law)
