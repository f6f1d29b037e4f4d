"""Dilatation unknowns that prevent locking of nearly incompressible quadratic cells.

The volume ratio becomes a separate unknown ϑ, in a space that the displacements can represent, and its multiplier q is
the pressure. With F̂ = (ϑ/J)^⅓ F the density is that of Hu and Washizu, for any law W:

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
from pliant_plugins.fem.skfem.kernel import mixed_law
from pliant_plugins.materials.compiled import cofactors


@dataclass(frozen=True, eq=False)
class Dilatation:
    """Energy at quadrature points (m, q) with stress (…, n) and tangent (…, n, n) in F, or in (F, ϑ, q/K)."""

    energy: Array
    stress: Array
    tangent: Array


def cell_modes(points: Array, weight: Array) -> Array:
    """Orthonormalise {1, X, Y, Z} on each cell: points (m, q, 3), weight (m, q) → (m, q, 4)."""
    volume = weight.sum(axis=1)[:, None, None]
    centre = np.einsum("mq,mqi->mi", weight, points)[:, None] / volume
    linear = points - centre
    linear = linear / np.abs(linear).max(axis=(1, 2), keepdims=True)
    modes = np.concatenate([np.ones((*weight.shape, 1)), linear], axis=-1)
    root = np.sqrt(weight)[..., None]
    return np.linalg.qr(root * modes)[0] / root * np.sqrt(volume)


def mixed(
    material: Material, F: Array, growth: Array, pressure: Array, second: bool = True
) -> Dilatation | None:
    """Return W(F̂) + q (J − ϑ) at F (m, q, 3, 3), ϑ − 1 and q/K (m, q); `None` where J or ϑ is not positive.

    With G = F⁻ᵀ, ρ = (ϑ/J)^⅓, P = ρ P̂ and A = ρ² Â of the law at F̂ = ρF, m = P:F / 3, γ = F:A:F/9 + m/3 + qJ:
    ∂W/∂F = P − m G + q J G, ∂W/∂ϑ = m/ϑ − q,
    ∂²W/∂F² = A + sym(G ⊗ (γ G − ⅔ (A:F + P))) + (m − qJ) G_il G_kj. Without `second` there is no tangent, of no cells.
    """
    shape, theta = growth.shape, 1 + growth
    K = np.broadcast_to(material.bulk_modulus_pa, shape)
    f, J, G = F.reshape(-1, 9), np.empty(growth.size), np.empty((growth.size, 9))
    cofactors(f, J, G)
    if not (np.all(J > 0) and np.all(theta > 0)):  # a NaN is not > 0
        return None
    rho = np.cbrt(theta.ravel() / J)
    law = material.evaluate(rho.reshape(*shape, 1, 1) * F)
    stress, tangent = np.empty((J.size, 11)), np.empty((J.size if second else 0, 11, 11))
    P, A = law.stress.reshape(-1, 9), law.tangent.reshape(-1, 9, 9)
    mixed_law(f, G, J, theta.ravel(), rho, pressure.ravel(), K.ravel(), P, A, stress, tangent)
    energy = law.energy + K * pressure * (J.reshape(shape) - theta)
    return Dilatation(energy, stress.reshape(*shape, 11), tangent.reshape(-1, *shape[1:], 11, 11))


def pointwise(material: Material, F: Array) -> Dilatation | None:
    """Return W(F) itself, for plain displacement cells; `None` if J is not positive."""
    if not np.all(np.linalg.det(F) > 0):
        return None
    law, shape = material.evaluate(F), (*F.shape[:-2], 9)
    return Dilatation(law.energy, law.stress.reshape(shape), law.tangent.reshape(*shape, 9))
