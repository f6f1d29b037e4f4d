"""Mean dilatation per cell: what keeps nearly incompressible quadratic cells from locking.

The volume ratio J = det F of a cell's points is replaced by its projection Ĵ on linear functions of X
(weighted by volume), and the energy is that of F̂ = (Ĵ/J)^⅓ F:

    U = ∫ W(F̂) dV,    Ĵ = Σ_k φ_k ∫ φ_k J dV,    φ_k orthonormal on the cell

the stable Q2/P1-discontinuous element in its displacement form, for any law W.
Source: Simo, Taylor, Pister, Comput. Methods Appl. Mech. Eng. 51 (1985) 177–208; de Souza Neto et al.,
Int. J. Solids Struct. 33 (1996) 3277–3296 (F̂ for general laws).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.interfaces.material import Material
from pliant.records.design import Array


@dataclass(frozen=True, eq=False)
class Dilatation:
    """Energy at quadrature points (m, q) as a function of F, the cell's Ĵ eliminated.

    `stress` (m, q, 9) and `tangent` (m, q, 9, 9) hold what is local; the dependence through Ĵ is
    completed, cell by cell, by `volume` = ∂J/∂F, `coupling` = ∂²W/∂F∂Ĵ, both (m, q, 9), and
    `curvature` = ∂²W/∂Ĵ² (m, q).
    """

    energy: Array
    stress: Array
    tangent: Array
    volume: Array
    coupling: Array
    curvature: Array


def cell_modes(points: Array, weight: Array) -> Array:
    """Functions {1, X, Y, Z} made orthonormal on each cell: points (m, q, 3), weight (m, q) → (m, q, 4)."""
    centre = np.einsum("mq,mqi->mi", weight, points) / weight.sum(axis=1, keepdims=True)
    linear = points - centre[:, None]
    linear = linear / np.abs(linear).max(axis=(1, 2), keepdims=True)
    modes = np.concatenate([np.ones((*weight.shape, 1)), linear], axis=-1)
    root = np.sqrt(weight)[..., None]
    return np.linalg.qr(root * modes)[0] / root


def averaged(material: Material, F: Array, modes: Array, weight: Array) -> Dilatation | None:
    """W(F̂) and its derivatives at F (m, q, 3, 3); `None` where J or Ĵ is not positive.

    With G = F⁻ᵀ, ρ = (Ĵ/J)^⅓, P̂ and Â the law at F̂ = ρF, m = ρ P̂:F / 3 and π the projection of ∂W/∂Ĵ = m/Ĵ:
    ∂W/∂F = ρ P̂ − m G, completed by π J G, the work of Ĵ.
    """
    J = np.linalg.det(F)
    if not np.all(J > 0):  # a NaN is not > 0
        return None
    Jh = _project(J, modes, weight)
    if not np.all(Jh > 0):
        return None
    rho = np.cbrt(Jh / J)[..., None]
    law = material.evaluate(rho[..., None] * F)
    shape = (*J.shape, 9)
    f, G = F.reshape(shape), np.swapaxes(np.linalg.inv(F), -1, -2).reshape(shape)
    P = rho * law.stress.reshape(shape)
    A = rho[..., None] ** 2 * law.tangent.reshape(*shape, 9)
    AF = (A @ f[..., None])[..., 0]
    m = np.sum(P * f, axis=-1) / 3
    twice = np.sum(AF * f, axis=-1)
    work = _project(m / Jh, modes, weight) * J  # π J

    # A + sym(G ⊗ (γ/2 G − (AF + P)/3)) + (m − πJ) G_il G_kj, γ = F:A:F/9 + m/3 + πJ
    gamma = (twice / 9 + m / 3 + work)[..., None]
    half = G[..., :, None] * (gamma / 2 * G - (AF + P) / 3)[..., None, :]
    crossed = ((m - work)[..., None] * G)[..., :, None] * G[..., None, :]
    crossed = np.swapaxes(crossed.reshape(*J.shape, 3, 3, 3, 3), -1, -3).reshape(*shape, 9)
    local = P - m[..., None] * G
    return Dilatation(
        energy=law.energy,
        stress=local + work[..., None] * G,
        tangent=A + half + np.swapaxes(half, -1, -2) + crossed,
        volume=J[..., None] * G,
        coupling=(AF - (twice / 3)[..., None] * G + local) / (3 * Jh[..., None]),
        curvature=(twice / 9 - 2 / 3 * m) / Jh**2,
    )


def pointwise(material: Material, F: Array) -> Dilatation | None:
    """W(F) itself, Ĵ = J: what a plain displacement cell integrates."""
    if not np.all(np.linalg.det(F) > 0):
        return None
    law, none = material.evaluate(F), np.zeros((*F.shape[:-2], 9))
    shape = none.shape
    return Dilatation(
        law.energy, law.stress.reshape(shape), law.tangent.reshape(*shape, 9), none, none, none[..., 0]
    )


def _project(values: Array, modes: Array, weight: Array) -> Array:
    """Projection of values (m, q) on the cells' modes."""
    moments = np.einsum("mqk,mq->mk", modes, weight * values)
    return np.einsum("mqk,mk->mq", modes, moments)
