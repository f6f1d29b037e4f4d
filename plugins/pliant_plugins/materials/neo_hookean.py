"""Compressible neo-Hookean solid.

    W(F) = μ/2 (J^(−2/3) I₁ − 3) + K/2 (J − 1)²,   I₁ = F : F,   J = det F

    P = μ J^(−2/3) (F − I₁/3 F⁻ᵀ) + K (J − 1) J F⁻ᵀ

with K = 2μ (1 + ν) / (3 (1 − 2ν)) from Poisson's ratio at small strain.
Source: Holzapfel, Nonlinear Solid Mechanics (2000), §6.4 and §6.5 (isochoric part and penalty (J − 1)²).
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from pliant.interfaces.material import Hyperelastic
from pliant.records.design import Array
from pliant.units import Pressure
from pliant_plugins.materials.rubber import Rubber, RubberConfig


class NeoHookeanConfig(RubberConfig):
    """Shear modulus μ and Poisson's ratio ν; 0.49 stands for nearly incompressible rubber."""

    kind: Literal["neo_hookean"] = "neo_hookean"
    shear_modulus_pa: Pressure = Field(gt=0, description="μ at small strain")


class NeoHookean(Rubber):
    """W(F) = μ/2 (J^(−2/3) I₁ − 3) + K/2 (J − 1)²."""

    config: NeoHookeanConfig

    @property
    def shear_modulus_pa(self) -> float:
        return self.config.shear_modulus_pa

    def energy(self, F: Array) -> Array:
        """W in J/m³, shape (...,), of F (..., 3, 3) with det F > 0."""
        mu, K = self.shear_modulus_pa, self.bulk_modulus_pa
        J = np.linalg.det(F)
        I1 = np.einsum("...ij,...ij->...", F, F)
        return np.asarray(mu / 2 * (J ** (-2 / 3) * I1 - 3) + K / 2 * (J - 1) ** 2)

    def evaluate(self, F: Array) -> Hyperelastic:
        """W, P = ∂W/∂F and A = ∂P/∂F of F (..., 3, 3) with det F > 0.

        With G = F⁻ᵀ, ∂J/∂F = J G and ∂G_ij/∂F_kl = −G_il G_kj:
        A = μ̄ (δ_ik δ_jl − 2/3 (F_ij G_kl + G_ij F_kl) + 2/9 I₁ G_ij G_kl + I₁/3 G_il G_kj)
            + K J ((2J − 1) G_ij G_kl − (J − 1) G_il G_kj),   μ̄ = μ J^(−2/3).
        """
        mu, K = self.shear_modulus_pa, self.bulk_modulus_pa
        J, G = np.linalg.det(F), np.swapaxes(np.linalg.inv(F), -1, -2)
        I1 = np.einsum("...ij,...ij->...", F, F)
        mu_bar = mu * J ** (-2 / 3)
        energy = mu / 2 * (J ** (-2 / 3) * I1 - 3) + K / 2 * (J - 1) ** 2
        pressure = K * (J - 1) * J
        stress = mu_bar[..., None, None] * F + (pressure - mu_bar * I1 / 3)[..., None, None] * G

        # A = sym(G ⊗ (c₁ G − ⅔ μ̄ F)) + c₂ G_il G_kj + μ̄ δ δ, in 9 × 9 form
        f, g = F.reshape(*J.shape, 9), G.reshape(*J.shape, 9)
        c1 = 2 / 9 * mu_bar * I1 + K * J * (2 * J - 1)
        c2 = mu_bar * I1 / 3 - pressure
        half = g[..., :, None] * (c1[..., None] / 2 * g - 2 / 3 * mu_bar[..., None] * f)[..., None, :]
        tangent = half + np.swapaxes(half, -1, -2)
        crossed = (c2[..., None] * g)[..., :, None] * g[..., None, :]
        # (ij)(kl) of G_il G_kj is (il)(kj) of G ⊗ G
        crossed = np.swapaxes(crossed.reshape(*J.shape, 3, 3, 3, 3), -1, -3)
        tangent = tangent.reshape(*J.shape, 3, 3, 3, 3) + crossed
        diagonal = tangent.reshape(*J.shape, 81)[..., ::10]
        diagonal += mu_bar[..., None]
        return Hyperelastic(energy, stress, tangent)
