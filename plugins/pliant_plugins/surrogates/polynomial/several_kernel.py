"""The compiled form of `several_law`: effort and slopes of a polynomial energy of m actuations and k deformations.

Parameters: m, k, P, U, D_a, D_u; centre and half-width of each coordinate (m + k, 2); exponents (P, m) of the monomials
in a; then of each of U monomials in u a row: how many monomials in a it has, its exponents (k,), coefficients (P,).
"""

from __future__ import annotations

import numpy as np

from pliant.records.design import Array

HEADER = 6
# Sums that are made at once: so many do not wait for each other.
LANES = 4


def several_effort(
    actuation: Array, deformation: Array, c: Array, tau: Array, dtau_dp: Array, dtau_du: Array
) -> None:
    """Fills tau (k,), dtau_dp (k·m,) with ∂τ_i/∂a_j at i·m + j, and dtau_du (k, k)."""
    m, k, n_a, n_u = int(c[0]), int(c[1]), int(c[2]), int(c[3])
    deep_a, deep_u = int(c[4]) + 1, int(c[5]) + 1
    maps = HEADER
    of_a = maps + 2 * (m + k)
    rows = of_a + n_a * m
    # powers and slopes in a; powers and two slopes in u; monomials in a and their slopes, in whole blocks of `LANES`;
    # sums of a row; value and two slopes of each power of a row, and which of them are there
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


def shared(parameters: Array, share: float) -> Array:
    """The parameters of the law τ(s a, u)."""
    found = parameters.copy()
    found[HEADER : HEADER + 2 * int(parameters[0])] /= share  # centres and half-widths of the actuations
    return found


def _sum_row(c: Array, first: int, count: int, lanes: int, work: Array, mono: int, sums: int) -> None:
    """Fills value and slopes by each actuation of a row of coefficients, `LANES` side by side."""
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
    """Fills powers and their first slopes, and with `bent` the second ones, of one coordinate."""
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
    """The slope of a row's monomial by its i-th deformation, and by the j-th where that is not −1."""
    value = 1.0
    for b in range(count):
        value *= work[parts + 3 * b + (1 if b == i else 0) + (1 if b == j else 0)]
    return value
