"""The tendon's path as the potential of its force: Π = U − T W.

The hole stands x_m beyond the end section at height z_m and moves with it. With A(Θ) = ∫₀¹ exp(t [Θ]×) dt and
R = exp([Θ]×) its x in the start section's frame is

    B = e₁·((1 + e) L A e₁ + R (x_m, 0, h)),   h = z_m + c − z₀
      = (1 + e) L (1 − q f₂) + x_m (1 − q f₁) + h (f₀ Θ_y + f₁ Θ_x Θ_z),   q = Θ_y² + Θ_z²

f₀ = sin φ/φ, f₁ = (1 − cos φ)/φ², f₂ = (φ − sin φ)/φ³ of φ = |Θ|, and c the end section's own rise where it is
tied as one. For a bend alone B = (1 + e) L sin θ/θ + h sin θ + x_m cos θ. The tendon crosses the mirror plane
x = 0 at a right angle, so that W = B(rest) − B is what this piece draws out. It is exact for motions that keep
the mirror symmetry: bending about y and z.
"""

from __future__ import annotations

from math import factorial

import numpy as np
from numpy.polynomial import Polynomial

from pliant.records.design import Array
from pliant.records.fem import Tendon

# Series in s = φ² of f₀, f₁, f₂ with two derivatives; exact to rounding for any angle that occurs.
TERMS = 18
SERIES = tuple(
    tuple(Polynomial([(-1) ** n / factorial(2 * n + first) for n in range(TERMS)]).deriv(d) for d in range(3))
    for first in (1, 2, 3)
)


def drawn(
    tendon: Tendon, span_m: float, reference_z_m: float, turn: Array, strain: float, rise: float
) -> tuple[float, Array, Array]:
    """W (m) with its gradient (5,) and Hessian (5, 5) in (Θ_x, Θ_y, Θ_z, e, c)."""
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
    """f_k(Θ·Θ)."""
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
