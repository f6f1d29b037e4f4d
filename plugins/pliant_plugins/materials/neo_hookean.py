"""Compressible neo-Hookean solid.

    W(F) = μ/2 (J^(−2/3) I₁ − 3) + K/2 (J − 1)²,   I₁ = F : F,   J = det F

    P = μ J^(−2/3) (F − I₁/3 F⁻ᵀ) + K (J − 1) J F⁻ᵀ

with K = 2μ (1 + ν) / (3 (1 − 2ν)) from Poisson's ratio at small strain.
Source: Holzapfel, Nonlinear Solid Mechanics (2000), §6.4 and §6.5 (isochoric part and penalty (J − 1)²).
"""

from __future__ import annotations

from functools import cached_property
from typing import Literal

import numpy as np
from pydantic import Field

from pliant.interfaces.material import Hyperelastic
from pliant.records.design import Array
from pliant.units import Pressure
from pliant_plugins.materials.rubber import Rubber, RubberConfig


class NeoHookeanConfig(RubberConfig):
    """Shear modulus μ and Poisson's ratio ν; 0.49, the default, is softer in volume than rubber, 0.4995 the largest."""

    kind: Literal["neo_hookean"] = "neo_hookean"
    shear_modulus_pa: Pressure = Field(gt=0, description="μ at small strain")


class NeoHookean(Rubber):
    """W(F) = μ/2 (J^(−2/3) I₁ − 3) + K/2 (J − 1)²."""

    config: NeoHookeanConfig

    @cached_property
    def shear_modulus_pa(self) -> float:
        return self.config.shear_modulus_pa

    def energy(self, F: Array) -> Array:
        """Return W in J/m³, shape (...,), of F (..., 3, 3) with det F > 0."""
        mu, K = self.shear_modulus_pa, self.bulk_modulus_pa
        J = np.linalg.det(F)
        I1 = np.einsum("...ij,...ij->...", F, F)
        return np.asarray(mu / 2 * (J ** (-2 / 3) * I1 - 3) + K / 2 * (J - 1) ** 2)

    def evaluate(self, F: Array) -> Hyperelastic:
        """Return W, P = ∂W/∂F and A = ∂P/∂F of F (..., 3, 3) with det F > 0.

        With G = F⁻ᵀ, ∂J/∂F = J G and ∂G_ij/∂F_kl = −G_il G_kj:
        A = μ̄ (δ_ik δ_jl − 2/3 (F_ij G_kl + G_ij F_kl) + 2/9 I₁ G_ij G_kl + I₁/3 G_il G_kj)
            + K J ((2J − 1) G_ij G_kl − (J − 1) G_il G_kj),   μ̄ = μ J^(−2/3).
        """
        from pliant_plugins.materials.compiled import cofactors, neo_hookean

        points = F.shape[:-2]
        f = np.ascontiguousarray(F, dtype=float).reshape(-1, 9)
        J, energy, stress = np.empty(len(f)), np.empty(len(f)), np.empty(f.shape)
        G, tangent = np.empty(f.shape), np.empty((*f.shape, 9))
        cofactors(f, J, G)
        neo_hookean(f, J, G, self.shear_modulus_pa, self.bulk_modulus_pa, energy, stress, tangent)
        shape = (*points, 3, 3)
        return Hyperelastic(energy.reshape(points), stress.reshape(shape), tangent.reshape(*shape, 3, 3))
