"""Static laws of an actuator with two opposed chambers: what effects have to beat.

Polynomials of the pressures without any memory, their degree chosen on one run by blocks of it that are left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from benchmarks.real.recordings import rms
from numpy.typing import NDArray

from pliant.records.design import Array

BLOCK_S = 5.0  # longer than the camera's jitter remembers, shorter than a filling
FOLDS = 6
DEGREES = (1, 2, 3)
UNIT_PA = 5e4  # keeps the powers of the pressures near 1


def folds(time_s: Array, block_s: float = BLOCK_S) -> NDArray[np.intp]:
    """Return (t,) number of the fold: blocks of the run are assigned in turn."""
    return np.asarray(np.floor(time_s / block_s).astype(np.intp) % FOLDS)


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
        return f"degree {self.degree} in {'p₁ and p₂' if self.apart else 'p₁ − p₂'}"

    def predict(self, p1: Array, p2: Array) -> Array:
        """Return (t,) predicted angle, rad."""
        return np.asarray(_columns(p1, p2, self.degree, self.apart) @ self.weights, float)


def static_laws(p1: Array, p2: Array, angle: Array, time_s: Array) -> list[StaticLaw]:
    """Fit laws of all degrees, chambers together and apart."""
    number = folds(time_s)
    laws = []
    for apart in (False, True):
        for degree in DEGREES:
            columns = _columns(p1, p2, degree, apart)
            left = np.empty_like(angle)
            for fold in np.unique(number):
                out = number == fold
                left[out] = angle[out] - columns[out] @ _fit(columns[~out], angle[~out])
            weights = _fit(columns, angle)
            laws.append(StaticLaw(degree, apart, weights, rms(angle - columns @ weights), rms(left)))
    return laws


def chosen(laws: list[StaticLaw]) -> StaticLaw:
    """Return the law in p₁ − p₂ with the smallest error on left-out blocks."""
    return min((law for law in laws if not law.apart), key=lambda law: law.blocked)


def _fit(columns: Array, angle: Array) -> Array:
    return np.asarray(np.linalg.lstsq(columns, angle, rcond=None)[0], float)


def _columns(p1: Array, p2: Array, degree: int, apart: bool) -> Array:
    a, b = p1 / UNIT_PA, p2 / UNIT_PA
    if not apart:
        return np.stack([(a - b) ** k for k in range(degree + 1)], axis=1)
    powers = [(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]
    return np.stack([a**i * b**j for i, j in powers], axis=1)
