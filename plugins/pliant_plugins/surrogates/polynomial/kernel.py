"""The polynomial law: one or three independent axes as a plain function for engines, one axis at many points at once.

Formulas: `PolynomialLaw` and `ContinuedLaw`. The plain function allocates no memory. It calls no functions of other
files: numba's cache on disk checks only the file of a function, so its machine code is never older than its source. No
operation is reordered or fused: the result at a point does not depend on the other points, bit for bit.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from pliant.records.design import Array

# Numbers before the coefficients in an axis's block of parameters: rows, columns, p₀, p₁, u₀, u₁, the box as
# p low, p high, u low, u high, the reaches L and the reference gains on both sides in p, and c_odd.
HEADER = 15
# Represents "without limit", so that parameters are finite numbers.
UNBOUNDED = 1e300


def axes_effort(
    actuation: float, deformation: Array, parameters: Array, tau: Array, dtau_dp: Array, dtau_du: Array
) -> None:
    """Fill tau (a,), dtau_dp (a,) and the diagonal dtau_du (a, a) of `a` independent polynomial axes.

    `parameters` has one block for each axis, as `block` writes it.
    """
    start = 0
    for k in range(len(tau)):
        rows, columns = int(parameters[start] + 0.5), int(parameters[start + 1] + 0.5)
        table = start + HEADER
        p = min(max(actuation, parameters[start + 6]), parameters[start + 7])
        u = min(max(deformation[k], parameters[start + 8]), parameters[start + 9])
        x = (p - parameters[start + 2]) / parameters[start + 3]
        v = (u - parameters[start + 4]) / parameters[start + 5]
        value, in_x, in_v, in_both = 0.0, 0.0, 0.0, 0.0
        for i in range(rows - 1, -1, -1):
            row, row_in_v = 0.0, 0.0
            for j in range(columns - 1, -1, -1):
                row_in_v = row_in_v * v + row
                row = row * v + parameters[table + i * columns + j]
            in_x = in_x * x + value
            value = value * x + row
            in_both = in_both * x + in_v
            in_v = in_v * x + row_in_v
        odd = parameters[start + 14]
        value += odd * u * abs(u)
        gain = in_x / parameters[start + 3]
        slope = in_v / parameters[start + 5] + 2.0 * odd * abs(u)
        cross = in_both / (parameters[start + 3] * parameters[start + 5])
        dp, du = actuation - p, deformation[k] - u
        if dp != 0.0:
            side = 1 if dp > 0.0 else 0
            limit, reference = parameters[start + 10 + side], parameters[start + 12 + side]
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


# Places in a block of what has the unit of the actuation (p₀, p₁, the box and the reaches in p) and of its inverse.
ACTING, GAINS = (2, 3, 6, 7, 10, 11), slice(12, 14)


def block(
    coefficients: Array,
    maps: tuple[Array, Array],
    box: Array,
    reach: Array,
    reference_gain: Array,
    odd: float,
) -> Array:
    """Return (HEADER + I·J,) parameters of one axis: coefficients (I, J), maps of p and u, box (2, 2) of p and u."""
    packed = np.empty(HEADER + coefficients.size)
    packed[0:2] = coefficients.shape
    packed[2:4], packed[4:6] = maps
    packed[6:10], packed[10:12] = box.ravel(), reach
    np.minimum(np.maximum(packed[6:12], -UNBOUNDED), UNBOUNDED, out=packed[6:12])
    packed[12:14], packed[14] = reference_gain, odd
    packed[HEADER:] = coefficients.ravel()
    return packed


# Points that go through the coefficients together: their partial sums stay in the first-level cache.
BLOCK = 256


@njit(cache=True, nogil=True, error_model="numpy")
def effort(p: Array, u: Array, coefficients: Array, widths: Array, numbers: Array, out: Array) -> None:
    """Fill out (3, n) with τ, ∂τ/∂p and ∂τ/∂u at p (n,) and u (n,).

    Args:
        coefficients: (I, J) of x^i v^j.
        widths: (I,) how many of each row are not zero.
        numbers: p₀, p₁, u₀, u₁, the box as p low, p high, u low, u high, the reaches below and above in p, the
            reference gains there, c_odd.
    """
    rows = len(coefficients)
    x, v = np.empty(BLOCK), np.empty(BLOCK)
    row, row_v = np.empty(BLOCK), np.empty(BLOCK)
    value, by_x, by_v, by_both = np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK)
    p_low, p_high, u_low, u_high = numbers[4], numbers[5], numbers[6], numbers[7]
    odd = numbers[12]
    for start in range(0, len(p), BLOCK):
        n = min(BLOCK, len(p) - start)
        part_p, part_u = p[start : start + n], u[start : start + n]
        for k in range(n):
            held_p = p_low if part_p[k] < p_low else part_p[k]
            held_p = p_high if held_p > p_high else held_p
            held_u = u_low if part_u[k] < u_low else part_u[k]
            held_u = u_high if held_u > u_high else held_u
            x[k] = (held_p - numbers[0]) / numbers[1]
            v[k] = (held_u - numbers[2]) / numbers[3]
            value[k] = 0.0
            by_x[k] = 0.0
            by_v[k] = 0.0
            by_both[k] = 0.0
        for i in range(rows - 1, -1, -1):
            width = widths[i]
            if width % 2 == 1:
                first = coefficients[i, width - 1]
                for k in range(n):
                    row[k] = first
                    row_v[k] = 0.0
            elif width > 0:
                first, second = coefficients[i, width - 1], coefficients[i, width - 2]
                for k in range(n):
                    row[k] = first * v[k] + second
                    row_v[k] = first
            else:
                for k in range(n):
                    row[k] = 0.0
                    row_v[k] = 0.0
            for j in range(width - 2 - (width % 2 == 0), 0, -2):
                upper, lower = coefficients[i, j], coefficients[i, j - 1]
                for k in range(n):
                    between = row[k] * v[k] + upper
                    row_v[k] = (row_v[k] * v[k] + row[k]) * v[k] + between
                    row[k] = between * v[k] + lower
            for k in range(n):
                by_x[k] = by_x[k] * x[k] + value[k]
                value[k] = value[k] * x[k] + row[k]
                by_both[k] = by_both[k] * x[k] + by_v[k]
                by_v[k] = by_v[k] * x[k] + row_v[k]
        for k in range(n):
            held_u = u_low if part_u[k] < u_low else part_u[k]
            held_u = u_high if held_u > u_high else held_u
            size = abs(held_u)
            value[k] += odd * held_u * size
            by_x[k] /= numbers[1]
            by_v[k] = by_v[k] / numbers[3] + 2.0 * odd * size
            by_both[k] /= numbers[1] * numbers[3]
        outside = False
        for k in range(n):
            outside |= (part_p[k] < p_low) | (part_p[k] > p_high)
        if outside:
            _continue(part_p, numbers, value, by_x, by_v, by_both)
        for k in range(n):
            held_u = u_low if part_u[k] < u_low else part_u[k]
            held_u = u_high if held_u > u_high else held_u
            excess = part_u[k] - held_u
            out[0, start + k] = value[k] + by_v[k] * excess
            out[1, start + k] = by_x[k] + by_both[k] * excess
            out[2, start + k] = by_v[k]


@njit(cache=True, nogil=True, error_model="numpy")
def _continue(p: Array, numbers: Array, value: Array, by_p: Array, by_u: Array, by_both: Array) -> None:
    """Apply the step in p at points that are outside, in place."""
    for k in range(len(p)):
        side = 1 if p[k] > numbers[5] else 0
        if side == 0 and not p[k] < numbers[4]:
            continue
        excess = p[k] - numbers[4 + side]
        limit, reference = numbers[8 + side], numbers[10 + side]
        reach, rate = excess, 1.0
        if not math.isinf(limit):
            bent = math.tanh(excess / limit)
            reach, rate = limit * bent, 1.0 - bent * bent
        value[k] += reach * by_p[k] + (excess - reach) * reference
        by_u[k] += reach * by_both[k]
        by_p[k] = rate * by_p[k] + (1.0 - rate) * reference
        by_both[k] *= rate


SEVERAL_HEADER = 6
# Number of independent sums that are computed at once.
LANES = 4


def several_effort(
    actuation: Array, deformation: Array, c: Array, tau: Array, dtau_dp: Array, dtau_du: Array
) -> None:
    """Fill the effort of a polynomial energy of m actuations and k deformations (`several_law`), for engines.

    Fills tau (k,), dtau_dp (k·m,) with ∂τ_i/∂a_j at i·m + j, and dtau_du (k, k).

    c: m, k, P, U, D_a, D_u; centre and half-width of each coordinate (m + k, 2); exponents (P, m) of the monomials in
    a; then of each of U monomials in u a row: how many monomials in a it has, its exponents (k,), coefficients (P,).
    """
    m, k, n_a, n_u = int(c[0]), int(c[1]), int(c[2]), int(c[3])
    deep_a, deep_u = int(c[4]) + 1, int(c[5]) + 1
    maps = SEVERAL_HEADER
    of_a = maps + 2 * (m + k)
    rows = of_a + n_a * m
    # powers and slopes in a; powers and two slopes in u; monomials in a and their slopes, in whole blocks of `LANES`;
    # sums of a row; value and two slopes of each power of a row, and which of them exist
    lanes = LANES * ((m + LANES) // LANES)
    at_u = 2 * m * deep_a
    mono = at_u + 3 * k * deep_u
    sums = mono + n_a * lanes
    parts = sums + lanes
    work = np.empty(parts + 4 * k)
    there = parts + 3 * k
    for j in range(m):
        _powers(actuation[j], c, maps + 2 * j, deep_a, False, work, 2 * j * deep_a)
    for i in range(k):
        _powers(deformation[i], c, maps + 2 * (m + i), deep_u, True, work, at_u + 3 * i * deep_u)
    for p in range(n_a):
        for s in range(lanes):  # the value, then the slope by each
            value = 1.0 if s <= m else 0.0
            for j in range(m):
                value *= work[(2 * j + (1 if s == j + 1 else 0)) * deep_a + int(c[of_a + p * m + j])]
            work[mono + p * lanes + s] = value
    for i in range(k):
        tau[i] = 0.0
        for j in range(m):
            dtau_dp[i * m + j] = 0.0
        for j in range(k):
            dtau_du[i, j] = 0.0
    width = 1 + k + n_a
    for t in range(n_u):
        row = rows + t * width
        _sum_row(c, row + 1 + k, int(c[row]), lanes, work, mono, sums)
        count = 0  # of the deformations that the monomial has; slopes by others are 0
        for b in range(k):
            power = int(c[row + 1 + b])
            if power:
                for order in range(3):
                    work[parts + 3 * count + order] = work[at_u + (3 * b + order) * deep_u + power]
                work[there + count] = b
                count += 1
        total = work[sums]
        for e in range(count):
            i = int(work[there + e])
            slope = _slope(work, parts, count, e, -1)
            tau[i] -= total * slope
            for j in range(m):
                dtau_dp[i * m + j] -= work[sums + 1 + j] * slope
            for f in range(e, count):
                dtau_du[i, int(work[there + f])] -= total * _slope(work, parts, count, e, f)
    for i in range(k):
        for j in range(i):
            dtau_du[i, j] = dtau_du[j, i]


def several_shared(parameters: Array, share: float) -> Array:
    """Return the parameters of the law τ(s a, u)."""
    found = parameters.copy()
    # centres and half-widths of the actuations
    found[SEVERAL_HEADER : SEVERAL_HEADER + 2 * int(parameters[0])] /= share
    return found


def _sum_row(c: Array, first: int, count: int, lanes: int, work: Array, mono: int, sums: int) -> None:
    """Fill value and slopes by each actuation of a row of coefficients, `LANES` in parallel."""
    for lane in range(0, lanes, LANES):
        a, b, d, e = 0.0, 0.0, 0.0, 0.0
        for p in range(count):
            one, at = c[first + p], mono + p * lanes + lane
            a += one * work[at]
            b += one * work[at + 1]
            d += one * work[at + 2]
            e += one * work[at + 3]
        work[sums + lane], work[sums + lane + 1] = a, b
        work[sums + lane + 2], work[sums + lane + 3] = d, e


def _powers(value: float, c: Array, maps: int, deep: int, bent: bool, work: Array, at: int) -> None:
    """Fill powers and their first slopes, and with `bent` the second ones, of one coordinate."""
    half = c[maps + 1]
    x = (value - c[maps]) / half
    inside = min(max(x, -1.0), 1.0)
    beyond = x - inside
    power, below, lowest = 1.0, 0.0, 0.0  # x^e, x^(e−1), x^(e−2)
    for e in range(deep):
        one, two = e * below, e * (e - 1.0) * lowest
        if bent:
            work[at + e] = power + beyond * (one + 0.5 * beyond * two)
            work[at + deep + e] = (one + beyond * two) / half
            work[at + 2 * deep + e] = two / (half * half)
        else:
            work[at + e] = power + beyond * one
            work[at + deep + e] = one / half
        lowest = below
        below = power
        power *= inside


def _slope(work: Array, parts: int, count: int, i: int, j: int) -> float:
    """Return the slope of a row's monomial by its i-th deformation, and by the j-th where that is not −1."""
    value = 1.0
    for b in range(count):
        value *= work[parts + 3 * b + (1 if b == i else 0) + (1 if b == j else 0)]
    return value
