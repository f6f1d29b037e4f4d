"""Compiled: rotation vectors and matrices; formulas and names are those of `pliant.mechanics.rotations`."""

from __future__ import annotations

import numpy as np
from numba import njit

# Below this angle the closed forms cancel; slopes of b and c cancel three times earlier.
SMALL_ANGLE = 0.1


@njit(cache=True, nogil=True)
def coefficients(x):  # type: ignore[no-untyped-def]
    """a, b and c of R = 1 + a K + b K² and J = 1 + b K + c K² at θ² = x."""
    theta = np.sqrt(x)
    half = 0.5 * theta
    half_sinc = np.sin(half) / half if theta > 1e-12 else 1.0
    a, b = half_sinc * np.cos(half), 0.5 * half_sinc * half_sinc
    if theta < SMALL_ANGLE:
        c = 1 / 6 - x * (1 / 120 - x * (1 / 5040 - x / 362880))
    else:
        c = (1.0 - a) / x
    return a, b, c


@njit(cache=True, nogil=True)
def polynomial_of_skew(v, x, first, second, out):  # type: ignore[no-untyped-def]
    """Fills out (3, 3) with 1 + first · [v]× + second · [v]×², with x = |v|²."""
    for i in range(3):
        for j in range(3):
            out[i, j] = second * v[i] * v[j]
        out[i, i] += 1.0 - second * x
    out[0, 1] -= first * v[2]
    out[0, 2] += first * v[1]
    out[1, 0] += first * v[2]
    out[1, 2] -= first * v[0]
    out[2, 0] -= first * v[1]
    out[2, 1] += first * v[0]


@njit(cache=True, nogil=True)
def exp_map(v, out):  # type: ignore[no-untyped-def]
    """Fills out (3, 3) with the rotation of the vector v (3,)."""
    x = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    a, b, _ = coefficients(x)
    polynomial_of_skew(v, x, a, b, out)


@njit(cache=True, nogil=True)
def left_jacobian(v, out):  # type: ignore[no-untyped-def]
    """Fills out (3, 3) with J(v): angular velocity in the parent's frame per rate of v."""
    x = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    _, b, c = coefficients(x)
    polynomial_of_skew(v, x, b, c, out)


@njit(cache=True, nogil=True)
def right_jacobian_inverse(v, out):  # type: ignore[no-untyped-def]
    """Fills out (3, 3) with Jᵣ(v)⁻¹: rate of v per angular velocity in the child's frame."""
    x = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    theta = np.sqrt(x)
    if theta < SMALL_ANGLE:
        d = 1 / 12 + x * (1 / 720 + x * (1 / 30240 + x / 1209600))
    else:
        d = (1.0 - 0.5 * theta / np.tan(0.5 * theta)) / x
    polynomial_of_skew(v, x, 0.5, d, out)


@njit(cache=True, nogil=True)
def log_map(rotation, out):  # type: ignore[no-untyped-def]
    """Fills out (3,) with the vector, of length ≤ π, of a rotation (3, 3); accurate near 0 and near π."""
    trace = rotation[0, 0] + rotation[1, 1] + rotation[2, 2]
    best = 0
    for i in range(1, 3):
        if rotation[i, i] > rotation[best, best]:
            best = i
    j, k = (best + 1) % 3, (best + 2) % 3
    if trace >= rotation[best, best]:
        w = 1.0 + trace
        out[0] = rotation[2, 1] - rotation[1, 2]
        out[1] = rotation[0, 2] - rotation[2, 0]
        out[2] = rotation[1, 0] - rotation[0, 1]
    else:
        w = rotation[k, j] - rotation[j, k]
        out[best] = 1.0 + 2.0 * rotation[best, best] - trace
        out[j] = rotation[j, best] + rotation[best, j]
        out[k] = rotation[k, best] + rotation[best, k]
    length = np.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])
    # angle / length → 2 / w as the rotation vanishes.
    ratio = 2.0 * np.arctan2(length, abs(w)) / length if length > 1e-9 * abs(w) else 2.0 / abs(w)
    if w < 0.0:
        ratio = -ratio
    for i in range(3):
        out[i] *= ratio


@njit(cache=True, nogil=True)
def left_jacobian_transpose_slope(v, g, out):  # type: ignore[no-untyped-def]
    """Fills out (3, 3) with ∂(J(v)ᵀ g)/∂v at fixed g (3,): rows are components of Jᵀg."""
    x = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    theta = np.sqrt(x)
    _, b, c = coefficients(x)
    if theta < 3 * SMALL_ANGLE:
        db = -1 / 12 + x * (1 / 180 - x * (1 / 6720 - x * (1 / 453600 - x / 47900160)))
        dc = -1 / 60 + x * (1 / 1260 - x * (1 / 60480 - x * (1 / 4989600 - x / 622702080)))
    else:
        sine, cosine = np.sin(theta), np.cos(theta)
        db = (theta * sine - 2.0 * (1.0 - cosine)) / (x * x)
        dc = (theta * (1.0 - cosine) - 3.0 * (theta - sine)) / (x * x * theta)
    along = v[0] * g[0] + v[1] * g[1] + v[2] * g[2]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        turned = v[j] * g[k] - v[k] * g[j]
        outward = v[i] * along - x * g[i]
        for m in range(3):
            out[i, m] = c * (v[i] * g[m] - 2.0 * g[i] * v[m]) + (dc * outward - db * turned) * v[m]
        out[i, i] += c * along
        out[i, j] -= b * g[k]
        out[i, k] += b * g[j]
