"""The bend frame: how a piece between two plane cross-sections bends by θ.

    s = (1 + e) X + v_x,  y = Y + v_y,  ζ = Z + v_z − z₀      section coordinates of a material point
    κ = θ / ((1 + e) L),  λ = 1 + κ ζ                          curvature of the line ζ = 0, stretch of a fibre
    F = diag(λ, 1, 1) (S + e e₁⊗e₁),  S = I + ∇v               deformation gradient, less the rotation

With v_x = 0 on both end planes they stay plane, and the end section is turned by exactly θ; θ and e are two
unknowns beside v. The section's rotation drops out of any objective energy.

At a point everything depends on twelve variables g = (S₁₁ … S₃₃, ζ, θ, e): this module gives a density's
value, gradient and Hessian in them; `assembly` carries those to the nodes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.interfaces.material import Material
from pliant.records.design import Array
from pliant_plugins.fem.skfem.basis import CellData
from pliant_plugins.fem.skfem.dilatation import averaged, pointwise

ZETA, STRAIN = 9, 11  # places of ζ and e in g; θ lies between


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


@dataclass(frozen=True, eq=False)
class SolidDensity(Pointwise):
    """Strain energy density, with what completes its Hessian through the cell's dilatation Ĵ.

    `volume` = ∂J/∂g and `coupling` = ∂²W/∂g∂Ĵ (m, q, 12), `curvature` = ∂²W/∂Ĵ² (m, q); see `dilatation`.
    """

    volume: Array
    coupling: Array
    curvature: Array


def strain_energy(
    frame: BendFrame,
    material: Material,
    cells: CellData,
    S: Array,
    zeta: Array,
    theta: float,
    strain: float,
) -> SolidDensity | None:
    """Strain energy density W(F(g)) at points S (m, q, 3, 3), ζ (m, q); `None` where a cell is inverted."""
    stretch, d_stretch, dd_stretch = frame.stretch(zeta, theta, strain)
    first_row = S[..., 0, :] + strain * np.array([1.0, 0.0, 0.0])
    F = S.copy()
    F[..., 0, :] = stretch[..., None] * first_row
    law = pointwise(material, F) if cells.modes is None else averaged(material, F, cells.modes, cells.weight)
    if law is None:
        return None

    # ∂F/∂g (9 × 12): only the first row of F depends on more than S
    dF = np.zeros((*zeta.shape, 9, 12))
    row, other = np.arange(3), np.arange(3, 9)
    dF[..., row, row] = stretch[..., None]
    dF[..., other, other] = 1.0
    dF[..., :3, ZETA:] = first_row[..., :, None] * d_stretch[..., None, :]
    dF[..., 0, STRAIN] += stretch

    pulled = np.stack([law.stress, law.volume, law.coupling], axis=-2) @ dF
    hessian = np.swapaxes(dF, -1, -2) @ (law.tangent @ dF)
    # P : ∂²F/∂g²
    P0 = law.stress[..., :3]
    coupling = P0[..., :, None] * d_stretch[..., None, :]
    hessian[..., :3, ZETA:] += coupling
    hessian[..., ZETA:, :3] += np.swapaxes(coupling, -1, -2)
    work = np.einsum("...j,...j->...", P0, first_row)
    hessian[..., ZETA:, ZETA:] += work[..., None, None] * dd_stretch
    hessian[..., ZETA:, STRAIN] += P0[..., :1] * d_stretch
    hessian[..., STRAIN, ZETA:] += P0[..., :1] * d_stretch
    return SolidDensity(
        law.energy, pulled[..., 0, :], hessian, pulled[..., 1, :], pulled[..., 2, :], law.curvature
    )
