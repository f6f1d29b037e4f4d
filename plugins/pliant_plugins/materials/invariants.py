"""Laws of the isochoric invariants: W = w(Ī₁, Ī₂) + K/2 (J − 1)², with exact stress and tangent.

    Ī₁ = J^(−2/3) I₁,  Ī₂ = J^(−4/3) I₂,  I₁ = F : F,  I₂ = (I₁² − C : C)/2,  C = FᵀF,  G = F⁻ᵀ

    ∂Ī₁/∂F = a = 2 J^(−2/3) (F − I₁/3 G)                ∂J/∂F = J G
    ∂Ī₂/∂F = b = J^(−4/3) (D − 4/3 I₂ G)                D = ∂I₂/∂F = 2 (I₁ F − F C)

    P = w₁ a + w₂ b + K (J − 1) J G
    A = w₁₁ a⊗a + w₁ ∂²Ī₁ + w₂ ∂²Ī₂ + K J ((2J − 1) G⊗G − (J − 1) G_il G_kj)
    ∂²Ī₁ = 2 J^(−2/3) (δ_ik δ_jl − 2/3 (F⊗G + G⊗F) + 2/9 I₁ G⊗G + I₁/3 G_il G_kj)
    ∂²Ī₂ = J^(−4/3) (∂²I₂ − 4/3 (D⊗G + G⊗D) + I₂ (16/9 G⊗G + 4/3 G_il G_kj))
    ∂²I₂ = 4 F⊗F + 2 I₁ δ_ik δ_jl − 2 (δ_ik C_lj + F_il F_kj + B_ik δ_jl),  B = F Fᵀ

Source: Holzapfel, Nonlinear Solid Mechanics (2000), §6.4 and §6.5, differentiated by F.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.interfaces.material import Hyperelastic
from pliant.records.design import Array


@dataclass(frozen=True, eq=False)
class Slopes:
    """w (...,) in J/m³ and its derivatives by the invariants; w2=None for a law of Ī₁ alone, w11=None for a linear w.

    Laws whose ∂²w/∂Ī₁∂Ī₂ or ∂²w/∂Ī₂² differ from zero are not covered.
    """

    energy: Array
    w1: Array
    w11: Array | None = None
    w2: Array | None = None


def invariants(F: Array, second: bool = False) -> tuple[Array, Array, Array | None]:
    """Return J, Ī₁ and, if wanted, Ī₂ of F (..., 3, 3)."""
    J = np.linalg.det(F)
    I1 = np.einsum("...ij,...ij->...", F, F)
    if not second:
        return J, J ** (-2 / 3) * I1, None
    C = np.swapaxes(F, -1, -2) @ F
    return J, J ** (-2 / 3) * I1, J ** (-4 / 3) / 2 * (I1**2 - np.einsum("...ij,...ij->...", C, C))


def response(F: Array, J: Array, I1_bar: Array, I2_bar: Array | None, w: Slopes, K: float) -> Hyperelastic:
    """Return W, P and A of a law at F (..., 3, 3), from its invariants and slopes there and the bulk modulus K."""
    points = J.shape
    G = np.swapaxes(np.linalg.inv(F), -1, -2)
    f, g = F.reshape(*points, 9), G.reshape(*points, 9)
    shrink = J ** (-2 / 3)
    mu = 2 * w.w1 * shrink
    I1 = I1_bar / shrink
    pressure = K * (J - 1) * J

    # A = V + Vᵀ + c₂ G_il G_kj + μ δ_ik δ_jl + …, V a sum of outer products in 9 × 9 form
    c1 = mu * I1 / 9 + K / 2 * J * (2 * J - 1)
    c2 = mu * I1 / 3 - pressure
    with_g = _times(c1, g) - _times(2 / 3 * mu, f)
    stress = _times(mu, f) - _times(c2, g)
    diagonal = mu
    if w.w2 is not None and I2_bar is not None:
        C = np.swapaxes(F, -1, -2) @ F
        scale = shrink**2 * w.w2
        slope = (2 * (_times(I1, f) - (F @ C).reshape(*points, 9))) * scale[..., None]
        I2 = I2_bar * w.w2
        with_g += _times(8 / 9 * I2, g) - 4 / 3 * slope
        stress += slope - _times(4 / 3 * I2, g)
        c2 = c2 + 4 / 3 * I2
        diagonal = diagonal + 2 * scale * I1
    half = g[..., :, None] * with_g[..., None, :]
    if w.w11 is not None:
        a = _times(2 * shrink, f) - _times(2 / 3 * I1_bar, g)
        half += _times(w.w11 / 2, a)[..., :, None] * a[..., None, :]
    crossed = _times(c2, g)[..., :, None] * g[..., None, :]
    if w.w2 is not None:
        half += _times(2 * scale, f)[..., :, None] * f[..., None, :]
        crossed -= _times(2 * scale, f)[..., :, None] * f[..., None, :]
    # (ij)(kl) of G_il G_kj is (il)(kj) of G ⊗ G
    tangent = (half + np.swapaxes(half, -1, -2)).reshape(*points, 3, 3, 3, 3)
    tangent += np.swapaxes(crossed.reshape(*points, 3, 3, 3, 3), -1, -3)
    tangent.reshape(*points, 81)[..., ::10] += diagonal[..., None]
    if w.w2 is not None:
        left = (2 * scale)[..., None, None] * (F @ np.swapaxes(F, -1, -2))
        right = (2 * scale)[..., None, None] * C
        for n in range(3):
            tangent[..., n, :, n, :] -= right
            tangent[..., :, n, :, n] -= left
    energy = w.energy + K / 2 * (J - 1) ** 2
    return Hyperelastic(energy, stress.reshape(*points, 3, 3), tangent)


def _times(scalar: Array, vector: Array) -> Array:
    """Return scalars (...,) times vectors (..., 9)."""
    return np.asarray(scalar[..., None] * vector)
