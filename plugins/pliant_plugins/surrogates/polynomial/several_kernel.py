"""The compiled form of `several_law`: effort and slopes of a polynomial energy of m actuations and k deformations.

Parameters: m, k, P, U, D_a, D_u; centre and half-width of each coordinate (m + k, 2); exponents (P, m) of the monomials
in a; then of each of U monomials in u a row: how many monomials in a it has, its exponents (k,), coefficients (P,).
"""

from __future__ import annotations

import numpy as np

from pliant.records.design import Array

HEADER = 6


def several_effort(
    actuation: Array, deformation: Array, c: Array, tau: Array, dtau_dp: Array, dtau_du: Array
) -> None:
    """Fills tau (k,), dtau_dp (k·m,) with ∂τ_i/∂a_j at i·m + j, and dtau_du (k, k)."""
    m, k, n_a, n_u = int(c[0]), int(c[1]), int(c[2]), int(c[3])
    deep_a, deep_u = int(c[4]) + 1, int(c[5]) + 1
    maps = HEADER
    of_a = maps + 2 * (m + k)
    rows = of_a + n_a * m
    # powers and slopes in a; powers and two slopes in u; monomials in a and their slopes; sums of a row
    at_u = 2 * m * deep_a
    mono = at_u + 3 * k * deep_u
    sums = mono + n_a * (1 + m)
    work = np.empty(sums + 1 + m)
    for j in range(m):
        _powers(actuation[j], c, maps + 2 * j, deep_a, False, work, 2 * j * deep_a)
    for i in range(k):
        _powers(deformation[i], c, maps + 2 * (m + i), deep_u, True, work, at_u + 3 * i * deep_u)
    for p in range(n_a):
        for s in range(1 + m):  # the value, then the slope by each
            value = 1.0
            for j in range(m):
                value *= work[(2 * j + (1 if s == j + 1 else 0)) * deep_a + int(c[of_a + p * m + j])]
            work[mono + s * n_a + p] = value
    for i in range(k):
        tau[i] = 0.0
        for j in range(m):
            dtau_dp[i * m + j] = 0.0
        for j in range(k):
            dtau_du[i, j] = 0.0
    width = 1 + k + n_a
    for t in range(n_u):
        row = rows + t * width
        for s in range(1 + m):
            total = 0.0
            for p in range(int(c[row])):
                total += c[row + 1 + k + p] * work[mono + s * n_a + p]
            work[sums + s] = total
        for i in range(k):
            slope = _slope(c, row, work, at_u, deep_u, k, i, -1)
            tau[i] -= work[sums] * slope
            for j in range(m):
                dtau_dp[i * m + j] -= work[sums + 1 + j] * slope
            for j in range(i, k):
                dtau_du[i, j] -= work[sums] * _slope(c, row, work, at_u, deep_u, k, i, j)
    for i in range(k):
        for j in range(i):
            dtau_du[i, j] = dtau_du[j, i]


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


def _slope(c: Array, row: int, work: Array, at_u: int, deep: int, k: int, i: int, j: int) -> float:
    """∂/∂u_i of a monomial in u, and ∂²/∂u_i∂u_j where j is not −1."""
    value = 1.0
    for b in range(k):
        order = (1 if b == i else 0) + (1 if b == j else 0)
        value *= work[at_u + (3 * b + order) * deep + int(c[row + 1 + b])]
    return value
