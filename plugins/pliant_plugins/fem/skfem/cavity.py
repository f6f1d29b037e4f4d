"""The cavity's volume as the potential of pressure: Π = U − p V.

In section coordinates a volume element is λ ds dy dz, λ = 1 + k_y ρ_z − k_z ρ_y. The field (0, ρ_y h, 0) with
h = 1 + k_y ρ_z − ½ k_z ρ_y has the divergence λ, and the end planes and the mirror plane y = 0 add nothing, so

    V = −∫ ρ_y h n_y dA     over the wetted faces, n dA = ∂s/∂a × ∂s/∂b da db pointing into the cavity

of half and of full sections. The thrust on the end sections is thereby exact, the stiffness of pressure
symmetric. At a point V's density depends on (s_a, s_b | ρ_y | z_a, z_b, ρ_z | k, e), with s_a = ∂(X + v_x)/∂a;
the axial strain adds e ∂X/∂a.
"""

from __future__ import annotations

import numpy as np

from pliant.records.design import Array
from pliant_plugins.fem.skfem.kinematics import Pointwise
from pliant_plugins.fem.skfem.unknowns import Globals

SA, SB, Y, ZA, ZB, Z, FRAME = range(7)


def volume(active: Globals, slopes: Array, rho: Array, X: Array, k: Array, strain: float) -> Pointwise:
    """Density −ρ_y h n_y per da db.

    Shapes: slopes (f, q, 3, 2) of (s, y, z) along a and b, without e; ρ (f, q, 2); X (f, q, 2) slopes of X.
    """
    flux, df, ddf = _potential(active, rho, k)
    normal, dn, ddn = _normal(active, slopes, X, strain)
    product = df[..., :, None] * dn[..., None, :]
    hessian = product + np.swapaxes(product, -1, -2)
    hessian += flux[..., None, None] * ddn + normal[..., None, None] * ddf
    gradient = flux[..., None] * dn + normal[..., None] * df
    return Pointwise(-flux * normal, -gradient, -hessian)


def _potential(active: Globals, rho: Array, k: Array) -> tuple[Array, Array, Array]:
    """f = ρ_y h and its first and second derivatives."""
    y, z = rho[..., 0], rho[..., 1]
    n = FRAME + active.count
    first, second = np.zeros((*y.shape, n)), np.zeros((*y.shape, n, n))
    first[..., Y], first[..., Z] = 1 + k[1] * z - k[2] * y, k[1] * y
    second[..., Y, Y] = -k[2]
    second[..., Y, Z] = second[..., Z, Y] = k[1]
    for place, turn in enumerate(active.turns, FRAME):
        if turn == 1:
            first[..., place] = y * z
            second[..., place, Y] = second[..., Y, place] = z
            second[..., place, Z] = second[..., Z, place] = y
        if turn == 2:
            first[..., place] = -0.5 * y**2
            second[..., place, Y] = second[..., Y, place] = -y
    return y * (1 + k[1] * z - 0.5 * k[2] * y), first, second


def _normal(active: Globals, slopes: Array, X: Array, strain: float) -> tuple[Array, Array, Array]:
    """n_y = z_a s_b − s_a z_b and its first and second derivatives."""
    za, zb = slopes[..., 2, :].transpose(2, 0, 1)
    Xa, Xb = X.transpose(2, 0, 1)
    sa, sb = slopes[..., 0, 0] + strain * Xa, slopes[..., 0, 1] + strain * Xb
    n = FRAME + active.count
    first, second = np.zeros((*za.shape, n)), np.zeros((*za.shape, n, n))
    for place, value in ((SA, -zb), (SB, za), (ZA, sb), (ZB, -sa)):
        first[..., place] = value
    pairs = [(SA, ZB, -1.0), (SB, ZA, 1.0)]
    if active.stretches:
        first[..., -1] = za * Xb - zb * Xa
        pairs += [(ZA, n - 1, Xb), (ZB, n - 1, -Xa)]
    for i, j, value in pairs:
        second[..., i, j] = second[..., j, i] = value
    return za * sb - sa * zb, first, second
