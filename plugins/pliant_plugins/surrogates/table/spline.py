"""Uniform cubic B-splines on [0, 1]: cell and weights of points, slopes, antiderivative; the table laws for engines.

On cell k of n, at t ∈ [0, 1], a spline is Σ_{m=0..3} w_m(t) c_{k+m}; it has n + 3 coefficients and is C²
(de Boor, A Practical Guide to Splines, 1978).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array

ORDER = 4  # weights per point and coordinate
Cells = NDArray[np.int64]


def place(x: Array, cells: int) -> tuple[Cells, Array]:
    """Return (n,) cell and (n,) place in it of points x in [0, 1]."""
    scaled = x * cells
    cell = np.clip(np.floor(scaled), 0, cells - 1).astype(np.int64)
    return cell, scaled - cell


def weights(t: Array) -> Array:
    """Return (n, 4) weights of the values."""
    s = 1 - t
    outer = (s**3 / 6, t**3 / 6)
    inner = ((4 - 6 * t**2 + 3 * t**3) / 6, (4 - 6 * s**2 + 3 * s**3) / 6)
    return np.stack([outer[0], inner[0], inner[1], outer[1]], axis=-1)


def slope_weights(t: Array) -> Array:
    """Return (n, 4) weights of the derivative by t; times the number of cells, by x."""
    s = 1 - t
    return np.stack([-(s**2) / 2, -2 * t + 1.5 * t**2, 2 * s - 1.5 * s**2, t**2 / 2], axis=-1)


def area_weights(t: Array) -> Array:
    """Return (n, 5) weights of the quartic spline, for the antiderivative's coefficients."""
    s = 1 - t
    ends = (s**4 / 24, t**4 / 24)
    beside = (
        (1 + 4 * s + 6 * s**2 + 4 * s**3 - 4 * s**4) / 24,
        (1 + 4 * t + 6 * t**2 + 4 * t**3 - 4 * t**4) / 24,
    )
    middle = 1 - ends[0] - ends[1] - beside[0] - beside[1]
    return np.stack([ends[0], beside[0], middle, beside[1], ends[1]], axis=-1)


def antiderivative(coefficients: Array) -> Array:
    """Return (r, n + 4) coefficients of quartic splines whose derivatives by x are the cubic ones, (r, n + 3)."""
    cells = coefficients.shape[1] - (ORDER - 1)
    return np.pad(np.cumsum(coefficients, axis=1), ((0, 0), (1, 0))) / cells


def rows(x: Array, cells: int, slopes: bool = False) -> Array:
    """Return the (n, cells + 3) matrix that turns coefficients into values, or into derivatives by x."""
    cell, t = place(x, cells)
    matrix = np.zeros((len(x), cells + ORDER - 1))
    each = slope_weights(t) * cells if slopes else weights(t)
    matrix[np.arange(len(x))[:, None], cell[:, None] + np.arange(ORDER)] = each
    return matrix


# Numbers before the coefficients in an axis's block of parameters: rows, columns, the box as p low, p high, u low,
# u high, the reaches L and the reference gains on both sides in p.
HEADER = 10
# Represents "without limit", so that parameters are finite numbers.
UNBOUNDED = 1e300


def weight(m: int, t: float) -> float:
    """Return weight m of a uniform cubic B-spline."""
    s = 1.0 - t
    if m == 0:
        return s * s * s / 6.0
    if m == 1:
        return (4.0 - 6.0 * t * t + 3.0 * t * t * t) / 6.0
    if m == 2:
        return (4.0 - 6.0 * s * s + 3.0 * s * s * s) / 6.0
    return t * t * t / 6.0


def slope_weight(m: int, t: float) -> float:
    """Return the derivative of `weight` by t."""
    s = 1.0 - t
    if m == 0:
        return -s * s / 2.0
    if m == 1:
        return -2.0 * t + 1.5 * t * t
    if m == 2:
        return 2.0 * s - 1.5 * s * s
    return t * t / 2.0


def axes_effort(
    actuation: float, deformation: Array, parameters: Array, tau: Array, dtau_dp: Array, dtau_du: Array
) -> None:
    """Fill tau (a,), dtau_dp (a,) and the diagonal dtau_du (a, a) of `a` independent axes.

    `parameters` has one block for each axis, as `block` writes it.
    """
    start = 0
    for k in range(len(tau)):
        rows, columns = int(parameters[start] + 0.5), int(parameters[start + 1] + 0.5)
        table = start + HEADER
        p_low, p_high = parameters[start + 2], parameters[start + 3]
        u_low, u_high = parameters[start + 4], parameters[start + 5]
        p = min(max(actuation, p_low), p_high)
        u = min(max(deformation[k], u_low), u_high)
        x = (p - p_low) / (p_high - p_low) * (rows - 3)
        v = (u - u_low) / (u_high - u_low) * (columns - 3)
        i, j = min(int(x), rows - 4), min(int(v), columns - 4)
        value, gain, slope, cross = 0.0, 0.0, 0.0, 0.0
        for m in range(4):
            row, row_slope = 0.0, 0.0
            for n in range(4):
                c = parameters[table + (i + m) * columns + j + n]
                row += weight(n, v - j) * c
                row_slope += slope_weight(n, v - j) * c
            in_x, in_x_slope = weight(m, x - i), slope_weight(m, x - i)
            value += in_x * row
            gain += in_x_slope * row
            slope += in_x * row_slope
            cross += in_x_slope * row_slope
        by_p, by_u = (rows - 3) / (p_high - p_low), (columns - 3) / (u_high - u_low)
        gain, slope, cross = gain * by_p, slope * by_u, cross * by_p * by_u
        dp, du = actuation - p, deformation[k] - u
        if dp != 0.0:
            side = 1 if dp > 0.0 else 0
            limit, reference = parameters[start + 6 + side], parameters[start + 8 + side]
            reach, rate = dp, 1.0
            if limit < UNBOUNDED:
                bent = math.tanh(dp / limit)
                reach, rate = limit * bent, 1.0 - bent * bent
            value += reach * gain + (dp - reach) * reference
            gain = rate * gain + (1.0 - rate) * reference
            slope += reach * cross
            cross *= rate
        tau[k] = value + slope * du
        dtau_dp[k] = gain + cross * du
        for other in range(len(tau)):
            dtau_du[k, other] = 0.0
        dtau_du[k, k] = slope
        start = table + rows * columns


# Places in a block of what has the unit of the actuation (the box and the reaches in p) and of its inverse.
ACTING, GAINS = (2, 3, 6, 7), slice(8, 10)


def block(coefficients: Array, box: Array, reach: Array, reference_gain: Array) -> Array:
    """Return (HEADER + I·J,) parameters of one axis: coefficients (I, J), box (2, 2) of p and u."""
    limits = np.minimum(reach, UNBOUNDED)
    return np.concatenate([coefficients.shape, box.ravel(), limits, reference_gain, coefficients.ravel()])


def several_table_effort(
    actuation: Array, deformation: Array, c: Array, tau: Array, dtau_dp: Array, dtau_du: Array
) -> None:
    """Fill tau (1,), dtau_dp (m,), dtau_du (1, 1) of m actuations and one axis (`SeveralTableLaw`).

    c: m; sizes of the table (m + 1,); box (m + 1, 2); reaches (m,); gains below and above (m, 2); the table.
    """
    m = int(c[0] + 0.5)
    box = 2 + m
    reaches = box + 2 * (m + 1)
    gains = reaches + m
    table = gains + 2 * m
    # four weights and four slopes of each coordinate, then the first cell of each
    work = np.empty(9 * (m + 1))
    pushed = 0.0
    for d in range(m):
        low, high = c[box + 2 * d], c[box + 2 * d + 1]
        excess = actuation[d] - min(max(actuation[d], low), high)
        bent = math.tanh(excess / c[reaches + d])
        outer = c[gains + 2 * d + (1 if excess > 0.0 else 0)]
        away = c[reaches + d] * bent
        _fill(actuation[d] - excess, away, low, high, int(c[1 + d] + 0.5) - 3, work, d, m)
        pushed += (excess - away) * outer
        rate = 1.0 - bent * bent
        for w in range(4):  # by a, not by the bent a
            work[8 * d + 4 + w] *= rate
        dtau_dp[d] = (1.0 - rate) * outer
    low, high = c[box + 2 * m], c[box + 2 * m + 1]
    inside = min(max(deformation[0], low), high)
    _fill(inside, deformation[0] - inside, low, high, int(c[1 + m] + 0.5) - 3, work, m, m)
    tau[0] = pushed
    dtau_du[0, 0] = 0.0
    corners = 1
    for _ in range(m):
        corners *= 4
    for corner in range(corners):
        place, left = 0, corner
        for d in range(m):
            place = place * int(c[1 + d] + 0.5) + int(work[8 * (m + 1) + d]) + left % 4
            left = left // 4
        row = table + place * int(c[1 + m] + 0.5) + int(work[8 * (m + 1) + m])
        value, steep = 0.0, 0.0
        for w in range(4):
            value += c[row + w] * work[8 * m + w]
            steep += c[row + w] * work[8 * m + 4 + w]
        for along in range(-1, m):
            share, left = 1.0, corner
            for d in range(m):
                share *= work[8 * d + (4 if d == along else 0) + left % 4]
                left = left // 4
            if along < 0:
                tau[0] += share * value
                dtau_du[0, 0] += share * steep
            else:
                dtau_dp[along] += share * value


def _fill(
    inside: float, away: float, low: float, high: float, cells: int, work: Array, d: int, m: int
) -> None:
    """Fill the four weights of coordinate d, `away` from the box, their slopes, and the first cell."""
    x = (inside - low) / (high - low) * cells
    cell = min(int(x), cells - 1)
    scale = cells / (high - low)
    for w in range(4):
        slope = slope_weight(w, x - cell) * scale
        work[8 * d + 4 + w] = slope
        work[8 * d + w] = weight(w, x - cell) + away * slope
    work[8 * (m + 1) + d] = 1.0 * cell
