"""Dilatation: what keeps nearly incompressible quadratic cells from locking.

The volume ratio becomes an unknown ϑ of its own, a function that the displacements can follow, and its multiplier
q the pressure. With F̂ = (ϑ/J)^⅓ F the density is that of Hu and Washizu, for any law W:

    W(F̂) + q (J − ϑ)

*cell*: ϑ and q linear in X on each cell, Q2/P1 discontinuous, the mean-dilatation element; *continuous*: trilinear
between the cells' corners, Q2/Q1, Taylor–Hood. As unknowns they cost little in the sparse matrix, and Newton's
method takes half the steps that it needs when they are eliminated cell by cell.
Sources: Simo, Taylor, Pister, Comput. Methods Appl. Mech. Eng. 51 (1985) 177–208 (ϑ, q); de Souza Neto et al., Int.
J. Solids Struct. 33 (1996) 3277–3296 (F̂ for general laws); Taylor, Hood, Comput. Fluids 1 (1973) 73–100.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.interfaces.material import Material
from pliant.records.design import Array


@dataclass(frozen=True, eq=False)
class Dilatation:
    """Energy at quadrature points (m, q) with stress (…, n) and tangent (…, n, n) in F, or in (F, ϑ, q/K)."""

    energy: Array
    stress: Array
    tangent: Array


def cell_modes(points: Array, weight: Array) -> Array:
    """Functions {1, X, Y, Z} made orthogonal on each cell: points (m, q, 3), weight (m, q) → (m, q, 4), of size 1."""
    volume = weight.sum(axis=1)[:, None, None]
    centre = np.einsum("mq,mqi->mi", weight, points)[:, None] / volume
    linear = points - centre
    linear = linear / np.abs(linear).max(axis=(1, 2), keepdims=True)
    modes = np.concatenate([np.ones((*weight.shape, 1)), linear], axis=-1)
    root = np.sqrt(weight)[..., None]
    return np.linalg.qr(root * modes)[0] / root * np.sqrt(volume)


def mixed(material: Material, F: Array, growth: Array, pressure: Array) -> Dilatation | None:
    """W(F̂) + q (J − ϑ) at F (m, q, 3, 3), ϑ − 1 and q/K (m, q); `None` where J or ϑ is not positive.

    With G = F⁻ᵀ, ρ = (ϑ/J)^⅓, P̂ and Â the law at F̂ = ρF, m = ρ P̂:F / 3:
    ∂W/∂F = ρ P̂ − m G, ∂W/∂ϑ = m/ϑ.
    """
    J, K, theta = np.linalg.det(F), material.bulk_modulus_pa, 1 + growth
    if not (np.all(J > 0) and np.all(theta > 0)):  # a NaN is not > 0
        return None
    rho = np.cbrt(theta / J)[..., None]
    law = material.evaluate(rho[..., None] * F)
    shape = (*J.shape, 9)
    f, G = F.reshape(shape), np.swapaxes(np.linalg.inv(F), -1, -2).reshape(shape)
    P = rho * law.stress.reshape(shape)
    A = rho[..., None] ** 2 * law.tangent.reshape(*shape, 9)
    AF = (A @ f[..., None])[..., 0]
    m, twice = np.sum(P * f, axis=-1) / 3, np.sum(AF * f, axis=-1)
    work = K * pressure * J

    # A + sym(G ⊗ (γ/2 G − (AF + P)/3)) + (m − qJ) G_il G_kj, γ = F:A:F/9 + m/3 + qJ
    gamma = (twice / 9 + m / 3 + work)[..., None]
    half = G[..., :, None] * (gamma / 2 * G - (AF + P) / 3)[..., None, :]
    crossed = ((m - work)[..., None] * G)[..., :, None] * G[..., None, :]
    crossed = np.swapaxes(crossed.reshape(*J.shape, 3, 3, 3, 3), -1, -3).reshape(*shape, 9)
    local = P - m[..., None] * G
    stress, tangent = np.empty((*J.shape, 11)), np.zeros((*J.shape, 11, 11))
    stress[..., :9] = local + work[..., None] * G
    stress[..., 9], stress[..., 10] = m / theta - K * pressure, K * (J - theta)
    tangent[..., :9, :9] = A + half + np.swapaxes(half, -1, -2) + crossed
    by_growth = (AF - (twice / 3)[..., None] * G + local) / (3 * theta[..., None])
    tangent[..., :9, 9] = tangent[..., 9, :9] = by_growth
    tangent[..., 9, 9] = (twice / 9 - 2 / 3 * m) / theta**2
    tangent[..., :9, 10] = tangent[..., 10, :9] = (K * J)[..., None] * G
    tangent[..., 9, 10] = tangent[..., 10, 9] = -K
    return Dilatation(law.energy + K * pressure * (J - theta), stress, tangent)


def pointwise(material: Material, F: Array) -> Dilatation | None:
    """W(F) itself: what a plain displacement cell integrates; `None` where J is not positive."""
    if not np.all(np.linalg.det(F) > 0):
        return None
    law, shape = material.evaluate(F), (*F.shape[:-2], 9)
    return Dilatation(law.energy, law.stress.reshape(shape), law.tangent.reshape(*shape, 9))
