"""The neural law as one plain function, for engines that compile it.

`NeuralLaw.evaluate` is the same in numpy, and `NetworkContinuation` has the formulas. Nothing here allocates.
"""

from __future__ import annotations

import math

import numpy as np

from pliant.records.design import Array

# Parameters: numbers of units and of actuations m; coordinates, axes, then b, c and w of each unit.
# Each coordinate's block: box low, box high, reach. Each axis's: rest, stiffness below and above, guard below and
# above, gain below and above of each actuation, then effort, gains and the row of the stiffness of the quadratic form.
HEADER = 2
COORDINATE = 3


def network_effort(
    actuation: float, deformation: Array, parameters: Array, tau: Array, dtau_dp: Array, dtau_du: Array
) -> None:
    """Fill tau (k,), dtau_dp (k,) and dtau_du (k, k); `parameters` as `NeuralLaw.scalar` makes them."""
    one = np.empty(1)
    one[0] = actuation
    several_network_effort(one, deformation, parameters, tau, dtau_dp, dtau_du)


def several_network_effort(
    actuation: Array, deformation: Array, parameters: Array, tau: Array, dtau_dp: Array, dtau_du: Array
) -> None:
    """The same of m actuations; dtau_dp (k·m,) has ∂τ_i/∂a_j at i·m + j."""
    k = len(tau)
    m = int(parameters[1] + 0.5)
    for i in range(k):
        tau[i] = 0.0
        for j in range(m):
            dtau_dp[i * m + j] = 0.0
        for j in range(k):
            dtau_du[i, j] = 0.0
    axes = HEADER + COORDINATE * (m + k)
    width = 6 + 3 * m + k
    first = axes + width * k
    for unit in range(int(parameters[0] + 0.5)):
        at = first + unit * (2 + m + k)
        z = parameters[at]
        for j in range(m):
            z += parameters[at + 2 + j] * _bent(actuation[j], parameters, HEADER + COORDINATE * j)[0]
        for i in range(k):
            z += (
                parameters[at + 2 + m + i]
                * _bent(deformation[i], parameters, HEADER + COORDINATE * (m + i))[0]
            )
        bell = 1.0 / math.sqrt(1.0 + z * z)
        slope = parameters[at + 1] * z * bell
        curvature = parameters[at + 1] * bell * bell * bell
        for i in range(k):
            w = parameters[at + 2 + m + i]
            tau[i] -= slope * w
            for j in range(m):
                dtau_dp[i * m + j] -= curvature * w * parameters[at + 2 + j]
            for j in range(i, k):
                dtau_du[i, j] -= curvature * w * parameters[at + 2 + m + j]
    for i in range(k):
        axis = axes + width * i
        plain = parameters[axis + 5 + 2 * m]
        for j in range(m):
            gain = parameters[axis + 6 + 2 * m + j]
            plain += _bent(actuation[j], parameters, HEADER + COORDINATE * j)[0] * gain
            dtau_dp[i * m + j] += gain
        tau[i] += plain
        for j in range(k):
            u = _bent(deformation[j], parameters, HEADER + COORDINATE * (m + j))[0]
            tau[i] -= parameters[axis + 6 + 3 * m + j] * u
            if j >= i:
                dtau_du[i, j] -= parameters[axis + 6 + 3 * m + j]
    for i in range(k):
        rate = _bent(deformation[i], parameters, HEADER + COORDINATE * (m + i))[1]
        for j in range(i, k):
            dtau_du[i, j] *= rate * _bent(deformation[j], parameters, HEADER + COORDINATE * (m + j))[1]
        _outside(i, actuation, deformation[i], parameters, tau, dtau_dp, dtau_du)
        for j in range(m):
            p, rate_p = _bent(actuation[j], parameters, HEADER + COORDINATE * j)
            side = 1 if actuation[j] > p else 0
            outer = parameters[axes + width * i + 5 + 2 * j + side]
            tau[i] += (actuation[j] - p) * outer
            dtau_dp[i * m + j] = rate_p * dtau_dp[i * m + j] + (1.0 - rate_p) * outer
    for i in range(k):
        for j in range(i):
            dtau_du[i, j] = dtau_du[j, i]


def _bent(value: float, parameters: Array, at: int) -> tuple[float, float]:
    """x̃ and how fast it follows x."""
    low, high = parameters[at], parameters[at + 1]
    if low <= value <= high:
        return value, 1.0
    border = low if value < low else high
    bent = math.tanh((value - border) / parameters[at + 2])
    return border + parameters[at + 2] * bent, 1.0 - bent * bent


def _outside(
    i: int,
    actuation: Array,
    u: float,
    parameters: Array,
    tau: Array,
    dtau_dp: Array,
    dtau_du: Array,
) -> None:
    """Add what axis i has outside its box to its effort and slopes."""
    k = len(tau)
    m = int(parameters[1] + 0.5)
    at = HEADER + COORDINATE * (m + i)
    low, high, reach = parameters[at], parameters[at + 1], parameters[at + 2]
    if low <= u <= high:
        return
    side = 1 if u > high else 0
    border = high if u > high else low
    sign = 1.0 if u > high else -1.0
    axis = HEADER + COORDINATE * (m + k) + (6 + 3 * m + k) * i
    stiffness, guard = parameters[axis + 1 + side], parameters[axis + 3 + side]
    effort = _border(i, k, actuation, border, parameters, -1)
    excess = u - border
    t = math.tanh(abs(excess) / reach)
    rate = 1.0 - t * t
    bending = -2.0 * t * rate / reach
    dtau_du[i, i] += (tau[i] - effort) * sign * bending - stiffness * (1.0 - rate * rate) + guard * bending
    tau[i] = tau[i] * rate + effort * (1.0 - rate) - guard * sign * (1.0 - rate)
    tau[i] -= stiffness * (excess - sign * reach * (t - t * t * t / 3.0))
    for j in range(m):
        gain = _border(i, k, actuation, border, parameters, j)
        dtau_dp[i * m + j] = dtau_dp[i * m + j] * rate + gain * (1.0 - rate)


def _border(i: int, k: int, actuation: Array, border: float, parameters: Array, by: int) -> float:
    """The network's τ_i where axis i is at its border and the others at rest; its slope by input `by` unless −1."""
    m = int(parameters[1] + 0.5)
    axes = HEADER + COORDINATE * (m + k)
    width = 6 + 3 * m + k
    own = axes + width * i
    effort = parameters[own + 5 + 2 * m]
    for j in range(m):
        effort += (
            _bent(actuation[j], parameters, HEADER + COORDINATE * j)[0] * parameters[own + 6 + 2 * m + j]
        )
    gain = parameters[own + 6 + 2 * m + max(by, 0)]
    for j in range(k):
        u = border if j == i else parameters[axes + width * j]
        effort -= parameters[own + 6 + 3 * m + j] * u
    first = axes + width * k
    for unit in range(int(parameters[0] + 0.5)):
        at = first + unit * (2 + m + k)
        z = parameters[at]
        for j in range(m):
            z += parameters[at + 2 + j] * _bent(actuation[j], parameters, HEADER + COORDINATE * j)[0]
        for j in range(k):
            u = border if j == i else parameters[axes + width * j]
            z += parameters[at + 2 + m + j] * u
        bell = 1.0 / math.sqrt(1.0 + z * z)
        pull = parameters[at + 1] * parameters[at + 2 + m + i] * bell
        effort -= pull * z
        gain -= pull * bell * bell * parameters[at + 2 + max(by, 0)]
    return effort if by < 0 else gain


def shared(parameters: Array, share: float, axes: int) -> Array:
    """Parameters of the law of so many axes whose only actuation is `share` times what it is told."""
    told = np.array(parameters, float)
    told[HEADER : HEADER + COORDINATE] /= share
    first, width = HEADER + COORDINATE * (1 + axes), 9 + axes
    by_axis = told[first : first + width * axes].reshape(axes, width)
    by_axis[:, [5, 6, 8]] *= share
    told[first + width * axes :].reshape(-1, 3 + axes)[:, 2] *= share
    return told
