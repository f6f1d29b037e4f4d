"""Potentials other than the solid's: of pressure, of a tendon's force, of ribbons.

The cavity's volume as the potential of pressure: Π = U − p V.

In section coordinates a volume element is λ ds dy dz, λ = 1 + k_y ρ_z − k_z ρ_y. The field (0, ρ_y h, 0) with
h = 1 + k_y ρ_z − ½ k_z ρ_y has the divergence λ, and the end planes and the mirror plane y = 0 add nothing, so

    V = −∫ ρ_y h n_y dA     over the wetted faces, n dA = ∂s/∂a × ∂s/∂b da db pointing into the cavity

of half and of full sections. The thrust on the end sections is thereby exact, the stiffness of pressure
symmetric. At a point V's density depends on (s_a, s_b | ρ_y | z_a, z_b, ρ_z | k, e), with s_a = ∂(X + v_x)/∂a;
the axial strain adds e ∂X/∂a.

The tendon's path as the potential of its force: Π = U − T W.

The hole is x_m beyond the end section at height z_m and moves with it. With A(Θ) = ∫₀¹ exp(t [Θ]×) dt and
R = exp([Θ]×) its x in the start section's frame is

    B = e₁·((1 + e) L A e₁ + R (x_m, 0, h)),   h = z_m + c − z₀
      = (1 + e) L (1 − q f₂) + x_m (1 − q f₁) + h (f₀ Θ_y + f₁ Θ_x Θ_z),   q = Θ_y² + Θ_z²

f₀ = sin φ/φ, f₁ = (1 − cos φ)/φ², f₂ = (φ − sin φ)/φ³ of φ = |Θ|, and c the end section's own rise where it is
tied as one. For a bend alone B = (1 + e) L sin θ/θ + h sin θ + x_m cos θ. The tendon crosses the mirror plane
x = 0 at a right angle, so that W = B(rest) − B is the length that this piece draws out. It is exact for motions that
keep the mirror symmetry: bending about y and z.

Ribbons at the height of the reference line store energies of the rod's globals alone."""

from __future__ import annotations

from math import factorial

import numpy as np
from numpy.polynomial import Polynomial

from pliant.records.design import Array
from pliant.records.fem import Ribbon, Tendon
from pliant_plugins.fem.skfem.kinematics import Pointwise
from pliant_plugins.fem.skfem.unknowns import STRAIN, Globals

SA, SB, Y, ZA, ZB, Z, FRAME = range(7)


def volume(active: Globals, slopes: Array, rho: Array, X: Array, k: Array, strain: float) -> Pointwise:
    """Return density −ρ_y h n_y per da db.

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
    """Return f = ρ_y h and its first and second derivatives."""
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
    """Return n_y = z_a s_b − s_a z_b and its first and second derivatives."""
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


# Series in s = φ² of f₀, f₁, f₂ with two derivatives; exact to rounding for any angle that occurs.
TERMS = 18
SERIES = tuple(
    tuple(Polynomial([(-1) ** n / factorial(2 * n + first) for n in range(TERMS)]).deriv(d) for d in range(3))
    for first in (1, 2, 3)
)


def drawn(
    tendon: Tendon, span_m: float, reference_z_m: float, turn: Array, strain: float, rise: float
) -> tuple[float, Array, Array]:
    """Return W (m) with its gradient (5,) and Hessian (5, 5) in (Θ_x, Θ_y, Θ_z, e, c)."""
    h = tendon.z_m - reference_z_m + rise
    length, x = (1 + strain) * span_m, tendon.x_m
    f0, f1, f2 = (_function(k, turn) for k in range(3))
    q = _square(turn, (1, 2))
    across = _sum(_product(f0, _linear(turn, 1)), _product(f1, _product(_linear(turn, 0), _linear(turn, 2))))
    shortened, tilted = _product(q, f2), _product(q, f1)
    # everything but h and e is a function of Θ
    value = length * shortened[0] + x * tilted[0] - h * across[0] - span_m * strain
    gradient, hessian = np.zeros(5), np.zeros((5, 5))
    gradient[:3] = length * shortened[1] + x * tilted[1] - h * across[1]
    gradient[3], gradient[4] = span_m * (shortened[0] - 1), -across[0]
    hessian[:3, :3] = length * shortened[2] + x * tilted[2] - h * across[2]
    hessian[:3, 3] = hessian[3, :3] = span_m * shortened[1]
    hessian[:3, 4] = hessian[4, :3] = -across[1]
    return float(value), gradient, hessian


Jet = tuple[float, Array, Array]  # value, gradient (3,), Hessian (3, 3) in Θ


def _function(k: int, turn: Array) -> Jet:
    """Return the series f_k(Θ·Θ) with its gradient and Hessian by Θ."""
    s = float(turn @ turn)
    f, df, ddf = (float(p(s)) for p in SERIES[k])
    return f, 2 * df * turn, 2 * df * np.eye(3) + 4 * ddf * np.outer(turn, turn)


def _linear(turn: Array, i: int) -> Jet:
    return float(turn[i]), np.eye(3)[i], np.zeros((3, 3))


def _square(turn: Array, components: tuple[int, ...]) -> Jet:
    chosen = np.isin(np.arange(3), components).astype(float)
    return float(chosen @ turn**2), 2 * chosen * turn, 2 * np.diag(chosen)


def _product(a: Jet, b: Jet) -> Jet:
    cross = np.outer(a[1], b[1])
    return a[0] * b[0], a[0] * b[1] + b[0] * a[1], a[0] * b[2] + b[0] * a[2] + cross + cross.T


def _sum(a: Jet, b: Jet) -> Jet:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def ribbon_energy(ribbon: Ribbon, span_m: float, turn: Array, strain: float) -> tuple[float, Array, Array]:
    """Return ½ EA L ⟨ε²⟩ with its gradient (4,) and Hessian (4, 4) in (Θ_x, Θ_y, Θ_z, e).

    A fibre at y has the strain ε = e − a y + b y², a = Θ_z / L, b = Θ_x² / (2 L²); with the width's moments
    m₂ = w²/12 and m₄ = w⁴/80, ⟨ε²⟩ = e² + a² m₂ + b² m₄ + 2 e b m₂.
    """
    second, fourth = ribbon.width_m**2 / 12, ribbon.width_m**4 / 80
    a, b = turn[2] / span_m, turn[0] ** 2 / (2 * span_m**2)
    da, db, ddb = 1 / span_m, turn[0] / span_m**2, 1 / span_m**2
    mean = strain**2 + a**2 * second + b**2 * fourth + 2 * strain * b * second
    by_b = 2 * (b * fourth + strain * second)
    gradient, hessian = np.zeros(4), np.zeros((4, 4))
    gradient[0], gradient[2] = by_b * db, 2 * a * da * second
    gradient[STRAIN] = 2 * (strain + b * second)
    hessian[0, 0] = 2 * fourth * db**2 + by_b * ddb
    hessian[0, STRAIN] = hessian[STRAIN, 0] = 2 * second * db
    hessian[2, 2], hessian[STRAIN, STRAIN] = 2 * da**2 * second, 2.0
    half = 0.5 * ribbon.stiffness_n * span_m
    return half * mean, half * gradient, half * hessian
