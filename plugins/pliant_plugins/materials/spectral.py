"""From a law in principal stretches to P and A, exact where stretches coincide.

F = Σ_a λ_a n_a ⊗ N_a. With Kirchhoff stresses τ_a = ∂W/∂ln λ_a, P = Σ_a P_a n_a ⊗ N_a, P_a = τ_a/λ_a, and in the basis
n_a ⊗ N_b the tangent has a block of the diagonal components and one 2 × 2 block for each pair a ≠ b:

    A_aabb = ∂P_a/∂λ_b = (∂τ_a/∂ln λ_b − τ_a δ_ab)/(λ_a λ_b)
    A_abab = (q + s)/2,  A_abba = (q − s)/2,  q = (P_a − P_b)/(λ_a − λ_b),  s = (P_a + P_b)/(λ_a + λ_b)

q is a difference quotient: with Q = (τ_a − τ_b)/(ln λ_a − ln λ_b), which a law gives without cancellation, and
h = ln(λ_a/λ_b)/2, (λ_a − λ_b)/(ln λ_a − ln λ_b) = √(λ_a λ_b) sinh(h)/h, so that

    q = ½ (1/λ_a + 1/λ_b) Q h/(√(λ_a λ_b) sinh h) − ½ (τ_a + τ_b)/(λ_a λ_b)

has no 0/0 but h/sinh h. Eigenvectors of equal stretches are arbitrary, and the result does not depend on them.
Source: Ogden, Non-linear Elastic Deformations (1984), §6.1.4; Holzapfel, Nonlinear Solid Mechanics (2000), §6.6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pliant.interfaces.material import Hyperelastic
from pliant.records.design import Array


@dataclass(frozen=True, eq=False)
class Spectrum:
    """F = Σ λ_a n_a ⊗ N_a at points (...,).

    Attributes:
        stretches: (..., 3) λ_a > 0.
        left, right: (..., 3, 3) with n_a and N_a as columns.
        J: (...,) det F.
    """

    PAIRS: ClassVar[tuple[tuple[int, int], ...]] = ((0, 1), (0, 2), (1, 2))
    stretches: Array
    left: Array
    right: Array
    J: Array

    @staticmethod
    def of(F: Array) -> Spectrum:
        """The spectrum of F (..., 3, 3) with det F > 0."""
        left, stretches, right = np.linalg.svd(F)
        return Spectrum(stretches, left, np.swapaxes(right, -1, -2), np.prod(stretches, axis=-1))


@dataclass(frozen=True, eq=False)
class Principal:
    """A law at a spectrum.

    Attributes:
        energy: (...,) W in J/m³.
        tau: (..., 3) Kirchhoff stresses τ_a = ∂W/∂ln λ_a.
        slope: (..., 3, 3) ∂τ_a/∂ln λ_b.
        quotient: (..., 3) (τ_a − τ_b)/(ln λ_a − ln λ_b) of `Spectrum.PAIRS`.
    """

    energy: Array
    tau: Array
    slope: Array
    quotient: Array


def response(at: Spectrum, law: Principal) -> Hyperelastic:
    """W, P and A at a spectrum."""
    stretch, points = at.stretches, at.J.shape
    nominal = law.tau / stretch
    local = np.zeros((*points, 9, 9))
    local[..., ::4, ::4] = law.slope / (stretch[..., :, None] * stretch[..., None, :])
    for a in range(3):
        local[..., 4 * a, 4 * a] -= law.tau[..., a] / stretch[..., a] ** 2
    for pair, (a, b) in enumerate(at.PAIRS):
        la, lb = stretch[..., a], stretch[..., b]
        q = (1 / la + 1 / lb) / 2 * law.quotient[..., pair] / _log_mean(la, lb)
        q -= (law.tau[..., a] + law.tau[..., b]) / (2 * la * lb)
        s = (nominal[..., a] + nominal[..., b]) / (la + lb)
        ab, ba = 3 * a + b, 3 * b + a
        local[..., ab, ab] = local[..., ba, ba] = (q + s) / 2
        local[..., ab, ba] = local[..., ba, ab] = (q - s) / 2
    # rows (ij), columns (ab) of n_a ⊗ N_b
    turn = (at.left[..., :, None, :, None] * at.right[..., None, :, None, :]).reshape(*points, 9, 9)
    tangent = turn @ local @ np.swapaxes(turn, -1, -2)
    stress = (at.left * nominal[..., None, :]) @ np.swapaxes(at.right, -1, -2)
    return Hyperelastic(law.energy, stress, tangent.reshape(*points, 3, 3, 3, 3))


def _log_mean(a: Array, b: Array) -> Array:
    """(a − b)/(ln a − ln b), a where they are equal."""
    half = np.log(a / b) / 2
    equal = half == 0
    return np.asarray(np.sqrt(a * b) * np.where(equal, 1.0, np.sinh(half) / np.where(equal, 1.0, half)))
