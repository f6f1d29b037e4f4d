"""What effects have to beat: polynomials of the pressures without any memory, their degree chosen on one run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from benchmarks.real.folds import folds, rms

from pliant.records.design import Array

DEGREES = (1, 2, 3)
UNIT_PA = 5e4  # keeps the powers of the pressures near 1


@dataclass(frozen=True, eq=False)
class StaticLaw:
    """angle = polynomial of p₁ − p₂, or of p₁ and p₂ apart (total degree), fitted to one run.

    Attributes:
        apart: whether the chambers are two variables.
        training, blocked: rms error of the run that was fitted, and of its blocks left out, rad.
    """

    degree: int
    apart: bool
    weights: Array
    training: float
    blocked: float

    @property
    def name(self) -> str:
        return f"degree {self.degree} in {'p1 and p2' if self.apart else 'p1 - p2'}"

    def predict(self, p1: Array, p2: Array) -> Array:
        """(t,) angle, rad."""
        return np.asarray(_columns(p1, p2, self.degree, self.apart) @ self.weights, float)


def static_laws(p1: Array, p2: Array, angle: Array, time_s: Array) -> list[StaticLaw]:
    """All degrees, chambers together and apart."""
    number = folds(time_s)
    found = []
    for apart in (False, True):
        for degree in DEGREES:
            columns = _columns(p1, p2, degree, apart)
            left = np.empty_like(angle)
            for fold in np.unique(number):
                out = number == fold
                left[out] = angle[out] - columns[out] @ _fit(columns[~out], angle[~out])
            weights = _fit(columns, angle)
            found.append(StaticLaw(degree, apart, weights, rms(angle - columns @ weights), rms(left)))
    return found


def _fit(columns: Array, angle: Array) -> Array:
    return np.asarray(np.linalg.lstsq(columns, angle, rcond=None)[0], float)


def _columns(p1: Array, p2: Array, degree: int, apart: bool) -> Array:
    a, b = p1 / UNIT_PA, p2 / UNIT_PA
    if not apart:
        return np.stack([(a - b) ** k for k in range(degree + 1)], axis=1)
    powers = [(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]
    return np.stack([a**i * b**j for i, j in powers], axis=1)
