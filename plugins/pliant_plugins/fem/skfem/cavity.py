"""The cavity's volume as the potential of pressure: Π = U − p V.

In section coordinates a volume element is λ ds dy dz. The field (0, y λ, 0) has divergence λ, and the end
planes and the mirror plane y = 0 add nothing, so

    V = −∫ y λ n_y dA     over the wetted faces, n dA = ∂s/∂a × ∂s/∂b da db pointing into the cavity.

The thrust on the end sections is thereby exact and the stiffness of pressure symmetric.
At a point V's density depends on g = (s_a, s_b, y, ζ, z_a, z_b, θ, e), with s_a = ∂(X + v_x)/∂a; the axial
strain adds e ∂X/∂a.
"""

from __future__ import annotations

import numpy as np

from pliant.records.design import Array
from pliant_plugins.fem.skfem.kinematics import BendFrame, Pointwise

Y = 2
LAMBDA = (3, 6, 7)  # places of ζ, θ, e in g
NORMAL = (0, 1, 4, 5, 7)  # places of s_a, s_b, z_a, z_b, e


def volume(
    frame: BendFrame, s: Array, y: Array, zeta: Array, z: Array, X: Array, theta: float, strain: float
) -> Pointwise:
    """Density −y λ n_y per da db. Shapes: y and ζ (f, q); s, z, X (f, q, 2), slopes along a and b."""
    stretch, d_stretch, dd_stretch = frame.stretch(zeta, theta, strain)
    sa, sb = s[..., 0] + strain * X[..., 0], s[..., 1] + strain * X[..., 1]
    za, zb = z[..., 0], z[..., 1]
    n = za * sb - sa * zb

    shape = (*y.shape, 8)
    dn, ds = np.zeros(shape), np.zeros(shape)
    dn[..., NORMAL] = np.stack([-zb, za, sb, -sa, za * X[..., 1] - zb * X[..., 0]], axis=-1)
    ds[..., LAMBDA] = d_stretch
    ddn, dds = np.zeros((*shape, 8)), np.zeros((*shape, 8))
    for i, j, value in ((0, 5, -1.0), (1, 4, 1.0), (4, 7, X[..., 1]), (5, 7, -X[..., 0])):
        ddn[..., i, j] = ddn[..., j, i] = value
    dds[..., np.array(LAMBDA)[:, None], np.array(LAMBDA)] = dd_stretch

    # product rule for y λ n
    dy = np.zeros(8)
    dy[Y] = 1.0
    gradient = (stretch * n)[..., None] * dy + (y * n)[..., None] * ds + (y * stretch)[..., None] * dn
    pairs = n[..., None, None] * _outer(dy, ds) + stretch[..., None, None] * _outer(dy, dn)
    pairs += y[..., None, None] * _outer(ds, dn)
    hessian = pairs + (y * n)[..., None, None] * dds + (y * stretch)[..., None, None] * ddn
    return Pointwise(-y * stretch * n, -gradient, -hessian)


def _outer(a: Array, b: Array) -> Array:
    """a ⊗ b + b ⊗ a."""
    product = a[..., :, None] * b[..., None, :]
    return product + np.swapaxes(product, -1, -2)
