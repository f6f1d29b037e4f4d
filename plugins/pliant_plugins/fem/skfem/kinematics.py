"""The bend frame: how a piece between two plane cross-sections bends by θ.

    s = (1 + e) X + v_x,  y = Y + v_y,  ζ = Z + v_z − z₀      section coordinates of a material point
    κ = θ / ((1 + e) L),  λ = 1 + κ ζ                          curvature of the line ζ = 0, stretch of a fibre
    F = diag(λ, 1, 1) (S + e e₁⊗e₁),  S = I + ∇v               deformation gradient, up to the section's rotation

With v_x = 0 on both end planes they stay plane, and the end section is turned by exactly θ; θ and e are two
unknowns beside v. The section's rotation drops out of any objective energy. (design.md, section 3.)

At a point everything depends on twelve variables g = (S₁₁ … S₃₃, ζ, θ, e): this module gives a density's value,
gradient and Hessian in them; `assembly` carries those to the nodes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.interfaces.material import Material
from pliant.records.design import Array

ZETA, THETA, STRAIN = 9, 10, 11  # places of ζ, θ, e in g


@dataclass(frozen=True, eq=False)
class Pointwise:
    """A density at quadrature points (m, q): value (m, q), gradient (m, q, n), Hessian (m, q, n, n)."""

    value: Array
    gradient: Array
    hessian: Array


@dataclass(frozen=True)
class BendFrame:
    """Length L of the undeformed piece and height z₀ of the line whose strain is e."""

    span_m: float
    reference_z_m: float

    def curvature(self, theta: float, strain: float) -> float:
        """κ = θ / ((1 + e) L)."""
        return theta / ((1 + strain) * self.span_m)

    def stretch(self, zeta: Array, theta: float, strain: float) -> tuple[Array, Array, Array]:
        """λ and its derivatives in (ζ, θ, e): (...,), (..., 3), (..., 3, 3)."""
        kappa = self.curvature(theta, strain)
        by_theta, by_strain = 1 / ((1 + strain) * self.span_m), -kappa / (1 + strain)
        mixed, twice = -by_theta / (1 + strain), 2 * kappa / (1 + strain) ** 2
        first = np.stack([np.full_like(zeta, kappa), by_theta * zeta, by_strain * zeta], axis=-1)
        second = np.zeros((*zeta.shape, 3, 3))
        second[..., 0, 1] = second[..., 1, 0] = by_theta
        second[..., 0, 2] = second[..., 2, 0] = by_strain
        second[..., 1, 2] = second[..., 2, 1] = mixed * zeta
        second[..., 2, 2] = twice * zeta
        return 1 + kappa * zeta, first, second

    def place(self, section: Array, theta: float, strain: float) -> Array:
        """Positions (n, 3) in space of section coordinates (s, y, z) (n, 3); the section s = 0 stays at rest.

        The line ζ = 0 is an arc of curvature κ that turns toward −z.
        """
        s, y, zeta = section[:, 0], section[:, 1], section[:, 2] - self.reference_z_m
        kappa = self.curvature(theta, strain)
        turn = kappa * s
        # sinc keeps the straight piece regular
        along, drop = s * np.sinc(turn / np.pi), -s * np.sinc(turn / (2 * np.pi)) * np.sin(turn / 2)
        x = along + zeta * np.sin(turn)
        return np.stack([x, y, self.reference_z_m + drop + zeta * np.cos(turn)], axis=-1)


def strain_energy(
    frame: BendFrame, material: Material, S: Array, zeta: Array, theta: float, strain: float
) -> Pointwise | None:
    """Strain energy density W(F(g)) at points S (m, q, 3, 3), ζ (m, q); `None` where a cell is inverted."""
    stretch, d_stretch, dd_stretch = frame.stretch(zeta, theta, strain)
    first_row = S[..., 0, :] + strain * np.array([1.0, 0.0, 0.0])
    F = S.copy()
    F[..., 0, :] = stretch[..., None] * first_row
    if not _positive(F):
        return None
    law = material.evaluate(F)
    P0 = law.stress[..., 0, :]

    # ∂F/∂g (9 × 12): only the first row of F depends on more than S
    dF = np.zeros((*zeta.shape, 9, 12))
    row = np.arange(3)
    dF[..., row, row] = stretch[..., None]
    dF[..., np.arange(3, 9), np.arange(3, 9)] = 1.0
    dF[..., :3, ZETA:] = first_row[..., :, None] * d_stretch[..., None, :]
    dF[..., 0, STRAIN] += stretch

    gradient = (law.stress.reshape(*zeta.shape, 1, 9) @ dF)[..., 0, :]
    hessian = np.swapaxes(dF, -1, -2) @ (law.tangent.reshape(*zeta.shape, 9, 9) @ dF)
    # P : ∂²F/∂g²
    coupling = P0[..., :, None] * d_stretch[..., None, :]
    hessian[..., :3, ZETA:] += coupling
    hessian[..., ZETA:, :3] += np.swapaxes(coupling, -1, -2)
    work = np.einsum("...j,...j->...", P0, first_row)
    hessian[..., ZETA:, ZETA:] += work[..., None, None] * dd_stretch
    hessian[..., ZETA:, STRAIN] += P0[..., :1] * d_stretch
    hessian[..., STRAIN, ZETA:] += P0[..., :1] * d_stretch
    return Pointwise(law.energy, gradient, hessian)


def _positive(F: Array) -> bool:
    """Whether all F are finite with det F > 0."""
    det = np.einsum("...i,...i->...", F[..., 0, :], np.cross(F[..., 1, :], F[..., 2, :]))
    return bool(np.all(det > 0))  # a NaN is not > 0
