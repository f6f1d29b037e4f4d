"""The compiled form of `several_law`: a spline of m actuations and u, on tangents outside its box.

Parameters: m; sizes of the table (m + 1,); box (m + 1, 2); reaches (m,); gains below and above (m, 2); the table.
"""

from __future__ import annotations

import math

import numpy as np

from pliant.records.design import Array


def several_table_effort(
    actuation: Array, deformation: Array, c: Array, tau: Array, dtau_dp: Array, dtau_du: Array
) -> None:
    """Fills tau (1,), dtau_dp (m,) and dtau_du (1, 1)."""
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
            weight, left = 1.0, corner
            for d in range(m):
                weight *= work[8 * d + (4 if d == along else 0) + left % 4]
                left = left // 4
            if along < 0:
                tau[0] += weight * value
                dtau_du[0, 0] += weight * steep
            else:
                dtau_dp[along] += weight * value


def _fill(
    inside: float, away: float, low: float, high: float, cells: int, work: Array, d: int, m: int
) -> None:
    """The four weights of coordinate d at a place `away` from the box's nearest, their slopes, and the first cell."""
    x = (inside - low) / (high - low) * cells
    cell = min(int(x), cells - 1)
    t = x - cell
    s = 1.0 - t
    scale = cells / (high - low)
    at = 8 * d
    work[at + 4] = -s * s / 2.0 * scale
    work[at + 5] = (-2.0 * t + 1.5 * t * t) * scale
    work[at + 6] = (2.0 * s - 1.5 * s * s) * scale
    work[at + 7] = t * t / 2.0 * scale
    work[at] = s * s * s / 6.0 + away * work[at + 4]
    work[at + 1] = (4.0 - 6.0 * t * t + 3.0 * t * t * t) / 6.0 + away * work[at + 5]
    work[at + 2] = (4.0 - 6.0 * s * s + 3.0 * s * s * s) / 6.0 + away * work[at + 6]
    work[at + 3] = t * t * t / 6.0 + away * work[at + 7]
    work[8 * (m + 1) + d] = 1.0 * cell
