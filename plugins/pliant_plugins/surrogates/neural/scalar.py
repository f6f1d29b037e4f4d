"""The neural law as one plain function, for engines that compile it.

`NeuralLaw.evaluate` is the same in numpy, and `NetworkContinuation` has the formulas. Nothing here allocates.
"""

from __future__ import annotations

import math

import numpy as np

from pliant.records.design import Array

# Parameters: number of units; coordinates, axes, then b, c and w of each unit.
# Each coordinate's block: box low, box high, reach. Each axis's: rest, stiffness below and above, guard below and
# above, gain below and above, then effort, gain and the row of the stiffness of the network's quadratic form.
COORDINATE = 3
AXIS = 9


def network_effort(
    actuation: float, deformation: Array, parameters: Array, tau: Array, dtau_dp: Array, dtau_du: Array
) -> None:
    """Fill tau (k,), dtau_dp (k,) and dtau_du (k, k); `parameters` as `NeuralLaw.scalar` makes them."""
    k = len(tau)
    p, rate_p = _bent(actuation, parameters, 1)
    for i in range(k):
        tau[i] = 0.0
        dtau_dp[i] = 0.0
        for j in range(k):
            dtau_du[i, j] = 0.0
    first = 1 + COORDINATE * (1 + k) + (AXIS + k) * k
    for unit in range(int(parameters[0] + 0.5)):
        at = first + unit * (3 + k)
        z = parameters[at] + parameters[at + 2] * p
        for i in range(k):
            z += parameters[at + 3 + i] * _bent(deformation[i], parameters, 1 + COORDINATE * (1 + i))[0]
        bell = 1.0 / math.sqrt(1.0 + z * z)
        slope = parameters[at + 1] * z * bell
        curvature = parameters[at + 1] * bell * bell * bell
        for i in range(k):
            w = parameters[at + 3 + i]
            tau[i] -= slope * w
            dtau_dp[i] -= curvature * w * parameters[at + 2]
            for j in range(i, k):
                dtau_du[i, j] -= curvature * w * parameters[at + 3 + j]
    for i in range(k):
        axis = 1 + COORDINATE * (1 + k) + (AXIS + k) * i
        tau[i] += parameters[axis + 7] + p * parameters[axis + 8]
        dtau_dp[i] += parameters[axis + 8]
        for j in range(k):
            u = _bent(deformation[j], parameters, 1 + COORDINATE * (1 + j))[0]
            tau[i] -= parameters[axis + 9 + j] * u
            if j >= i:
                dtau_du[i, j] -= parameters[axis + 9 + j]
    for i in range(k):
        rate = _bent(deformation[i], parameters, 1 + COORDINATE * (1 + i))[1]
        for j in range(i, k):
            dtau_du[i, j] *= rate * _bent(deformation[j], parameters, 1 + COORDINATE * (1 + j))[1]
        _outside(i, k, p, deformation[i], parameters, tau, dtau_dp, dtau_du)
        axis = 1 + COORDINATE * (1 + k) + (AXIS + k) * i
        side = 1 if actuation > p else 0
        tau[i] += (actuation - p) * parameters[axis + 5 + side]
        dtau_dp[i] = rate_p * dtau_dp[i] + (1.0 - rate_p) * parameters[axis + 5 + side]
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
    i: int, k: int, p: float, u: float, parameters: Array, tau: Array, dtau_dp: Array, dtau_du: Array
) -> None:
    """Add what axis i has outside its box to its effort and slopes."""
    at = 1 + COORDINATE * (1 + i)
    low, high, reach = parameters[at], parameters[at + 1], parameters[at + 2]
    if low <= u <= high:
        return
    side = 1 if u > high else 0
    border = high if u > high else low
    sign = 1.0 if u > high else -1.0
    axis = 1 + COORDINATE * (1 + k) + (AXIS + k) * i
    stiffness, guard = parameters[axis + 1 + side], parameters[axis + 3 + side]
    effort, gain = _border(i, k, p, border, parameters)
    excess = u - border
    t = math.tanh(abs(excess) / reach)
    rate = 1.0 - t * t
    bending = -2.0 * t * rate / reach
    dtau_du[i, i] += (tau[i] - effort) * sign * bending - stiffness * (1.0 - rate * rate) + guard * bending
    tau[i] = tau[i] * rate + effort * (1.0 - rate) - guard * sign * (1.0 - rate)
    tau[i] -= stiffness * (excess - sign * reach * (t - t * t * t / 3.0))
    dtau_dp[i] = dtau_dp[i] * rate + gain * (1.0 - rate)


def _border(i: int, k: int, p: float, border: float, parameters: Array) -> tuple[float, float]:
    """The network's τ_i and ∂τ_i/∂p where axis i is at its border and the others at rest."""
    axes = 1 + COORDINATE * (1 + k)
    own = axes + (AXIS + k) * i
    effort, gain = parameters[own + 7] + p * parameters[own + 8], parameters[own + 8]
    for j in range(k):
        u = border if j == i else parameters[axes + (AXIS + k) * j]
        effort -= parameters[own + 9 + j] * u
    first = axes + (AXIS + k) * k
    for unit in range(int(parameters[0] + 0.5)):
        at = first + unit * (3 + k)
        z = parameters[at] + parameters[at + 2] * p
        for j in range(k):
            u = border if j == i else parameters[axes + (AXIS + k) * j]
            z += parameters[at + 3 + j] * u
        bell = 1.0 / math.sqrt(1.0 + z * z)
        pull = parameters[at + 1] * parameters[at + 3 + i] * bell
        effort -= pull * z
        gain -= pull * bell * bell * parameters[at + 2]
    return effort, gain


def shared(parameters: Array, share: float, axes: int) -> Array:
    """Parameters of the law of so many axes whose actuation is `share` times what it is told."""
    told = np.array(parameters, float)
    told[1 : 1 + COORDINATE] /= share
    first = 1 + COORDINATE * (1 + axes)
    by_axis = told[first : first + (AXIS + axes) * axes].reshape(axes, AXIS + axes)
    by_axis[:, [5, 6, 8]] *= share
    told[first + (AXIS + axes) * axes :].reshape(-1, 3 + axes)[:, 2] *= share
    return told
