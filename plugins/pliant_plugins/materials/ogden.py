"""Ogden solid: powers of the principal stretches, in Abaqus' convention.

    W(F) = Σ_i 2 μ_i/α_i² (λ̄₁^α_i + λ̄₂^α_i + λ̄₃^α_i − 3) + K/2 (J − 1)²,   λ̄_a = J^(−1/3) λ_a,   μ₀ = Σ_i μ_i

This is Abaqus' `*HYPERELASTIC, OGDEN` (D1 = 2/K, further D_i zero). Ogden (1972) and Holzapfel write Σ μ'_p/α_p (…)
with μ'_p = 2 μ_p/α_p; ANSYS and COMSOL follow them: convert before copying constants. One term with α = 2 is the
neo-Hookean law, two with α = 2 and −2 are Mooney–Rivlin with μ = 2 C10 and 2 C01.
Source: Ogden, Proc. R. Soc. A 326 (1972) 565; Holzapfel, Nonlinear Solid Mechanics (2000), §6.5.

From a law in principal stretches to P and A, exact where stretches coincide.

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
from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from pliant.interfaces.material import Hyperelastic
from pliant.records.design import Array
from pliant.units import Pressure, Ratio
from pliant_plugins.materials.rubber import Rubber, RubberConfig, check_stiff


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
    def from_gradient(F: Array) -> Spectrum:
        """Return the spectrum of F (..., 3, 3) with det F > 0."""
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
    """Return W, P and A at a spectrum."""
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
    """Return (a − b)/(ln a − ln b), a where they are equal."""
    half = np.log(a / b) / 2
    equal = half == 0
    return np.asarray(np.sqrt(a * b) * np.where(equal, 1.0, np.sinh(half) / np.where(equal, 1.0, half)))


MOST_TERMS = 6


class OgdenConfig(RubberConfig):
    """Lists of μ_i and α_i, one pair for each of up to six terms."""

    kind: Literal["ogden"] = "ogden"
    mu_pa: tuple[Pressure, ...] = Field(
        min_length=1, max_length=MOST_TERMS, description="μ_i, as Abaqus writes them: their sum is μ₀"
    )
    alpha: tuple[Ratio, ...] = Field(
        min_length=1, max_length=MOST_TERMS, description="α_i, each other than 0"
    )

    @model_validator(mode="after")
    def _pairs(self) -> Self:
        if len(self.mu_pa) != len(self.alpha):
            raise ValueError(
                f"mu has {len(self.mu_pa)} and alpha {len(self.alpha)} numbers; each term needs one of both"
            )
        if not all(self.alpha):
            raise ValueError("an alpha is 0; a term needs a power, such as 2")
        given = ", ".join(f"{mu:g}" for mu in self.mu_pa)
        check_stiff(sum(self.mu_pa), "the sum of mu", f"mu = [{given}] Pa")
        return self


class Ogden(Rubber):
    """W(F) = Σ 2 μ_i/α_i² (λ̄₁^α_i + λ̄₂^α_i + λ̄₃^α_i − 3) + K/2 (J − 1)²."""

    config: OgdenConfig

    @property
    def shear_modulus_pa(self) -> float:
        return float(sum(self.config.mu_pa))

    def energy(self, F: Array) -> Array:
        stretches: Array = np.asarray(np.linalg.svd(F, compute_uv=False), float)
        J: Array = np.asarray(np.prod(stretches, axis=-1), float)
        return np.asarray(self._isochoric(stretches, J) + self.bulk_modulus_pa / 2 * (J - 1) ** 2)

    def evaluate(self, F: Array) -> Hyperelastic:
        spectrum = Spectrum.from_gradient(F)
        return response(spectrum, self._principal(spectrum))

    def _isochoric(self, stretches: Array, J: Array) -> Array:
        energy = np.zeros(J.shape)
        logs = np.log(stretches) - np.log(J)[..., None] / 3
        for mu, alpha in zip(self.config.mu_pa, self.config.alpha, strict=True):
            energy += 2 * mu / alpha**2 * np.expm1(alpha * logs).sum(axis=-1)
        return energy

    def _principal(self, at: Spectrum) -> Principal:
        """Return Kirchhoff stresses τ_a, ∂τ_a/∂ln λ_b and (τ_a − τ_b)/(ln λ_a − ln λ_b), exact at equal stretches.

        With x = ln λ̄: τ_a = Σ 2μ/α (e^(αx_a) − mean_c e^(αx_c)) + K (J − 1) J.
        """
        K, J = self.bulk_modulus_pa, at.J
        energy = K / 2 * (J - 1) ** 2 + self._isochoric(at.stretches, J)
        tau = np.repeat((K * (J - 1) * J)[..., None], 3, axis=-1)
        slope = np.broadcast_to((K * J * (2 * J - 1))[..., None, None], (*J.shape, 3, 3)).copy()
        quotient = np.zeros((*J.shape, 3))
        logs = np.log(at.stretches) - np.log(J)[..., None] / 3
        for mu, alpha in zip(self.config.mu_pa, self.config.alpha, strict=True):
            power = np.exp(alpha * logs)
            mean = power.mean(axis=-1, keepdims=True)
            tau += 2 * mu / alpha * (power - mean)
            slope += 2 * mu * (mean[..., None] / 3 - (power[..., :, None] + power[..., None, :]) / 3)
            slope.reshape(*J.shape, 9)[..., ::4] += 2 * mu * power
            # (e^(αx) − e^(αy))/(x − y) = α e^(α(x+y)/2) sinh(h)/h,  h = α (x − y)/2
            for pair, (a, b) in enumerate(at.PAIRS):
                middle = np.exp(alpha * (logs[..., a] + logs[..., b]) / 2)
                quotient[..., pair] += 2 * mu * middle * _sinhc(alpha * (logs[..., a] - logs[..., b]) / 2)
        return Principal(energy, tau, slope, quotient)


def _sinhc(h: Array) -> Array:
    """Return sinh(h)/h, 1 at 0."""
    at_zero = h == 0
    return np.asarray(np.where(at_zero, 1.0, np.sinh(h) / np.where(at_zero, 1.0, h)))
