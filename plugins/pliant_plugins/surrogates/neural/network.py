"""A network of an energy: one hidden layer of smooth ridges plus a quadratic form; the neural law for engines.

`NeuralLaw.evaluate` is the same as the plain functions here, in numpy, and `NetworkContinuation` has the formulas.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pliant.records.design import Array

# Rows that are evaluated together: their hidden layer stays in the cache.
BLOCK = 512


@dataclass(frozen=True, eq=False)
class Network:
    """Π(p, u) = Σ_j c_j √(1 + z_j²) − (t + g p)·u + ½ uᵀ S u with z_j = w_j·(p, u) + b_j, p of one input or of several.

    The ridge √(1 + z²) has the slopes z/√(1 + z²) and (1 + z²)^{−3/2}: a sigmoid and its bell that cost a root and a
    division (Carlile et al., arXiv:1710.09967, as an activation). Its sums need no layer by layer derivatives.

    Attributes:
        weights: (units, m + k) w_j of m actuations and k deformations, in 1/Pa (1/N) and 1/rad (1/m).
        offsets: (units,) b_j.
        factors: (units,) c_j in J.
        effort: (k,) t in N·m.
        gain: (k,) g; (k, m) of several actuations.
        stiffness: (k, k) S, symmetric.
    """

    weights: Array
    offsets: Array
    factors: Array
    effort: Array
    gain: Array
    stiffness: Array

    @property
    def n_axes(self) -> int:
        """Number k of the joint's axes."""
        return len(self.effort)

    @property
    def n_inputs(self) -> int:
        """Number m of actuations."""
        return self.weights.shape[1] - self.n_axes

    @property
    def gains(self) -> Array:
        """(k, m) g."""
        return self.gain.reshape(self.n_axes, self.n_inputs)

    @property
    def n_parameters(self) -> int:
        """Numbers that were fitted."""
        k = self.n_axes
        return self.weights.size + 2 * len(self.offsets) + k + self.gain.size + k * (k + 1) // 2

    def energy(self, points: Array) -> Array:
        """Return (n,) Π at points (n, m + k) of actuations and deformations."""
        p, u = np.split(points, [self.n_inputs], axis=1)
        z = points @ self.weights.T + self.offsets
        quadratic = np.sum(u * (u @ self.stiffness) / 2 - u * (self.effort + p @ self.gains.T), axis=1)
        return np.sqrt(1 + z * z) @ self.factors + quadratic

    def efforts(self, points: Array) -> tuple[Array, Array, Array]:
        """Return τ = −∂Π/∂u (n, k), ∂τ/∂p (n, k, m) and the symmetric ∂τ/∂u (n, k, k) at points (n, m + k)."""
        n, k, m = len(points), self.n_axes, self.n_inputs
        of_u = self.weights[:, m:] * self.factors[:, None]
        across = self.weights[:, :, None] * of_u[:, None, :]
        second = across.reshape(len(of_u), -1)
        tau, slopes = np.empty((n, k)), np.empty((n, (m + k) * k))
        for start in range(0, n, BLOCK):
            rows = slice(start, start + BLOCK)
            z = points[rows] @ self.weights.T
            z += self.offsets
            bell = z * z
            bell += 1.0
            np.sqrt(bell, out=bell)
            np.divide(1.0, bell, out=bell)
            z *= bell
            tau[rows] = z @ of_u
            bell *= bell * bell
            slopes[rows] = bell @ second
        p, u = np.split(points, [m], axis=1)
        tau = self.effort + p @ self.gains.T - u @ self.stiffness - tau
        by_p, by_u = np.split(slopes, [m * k], axis=1)
        gain = self.gains - np.swapaxes(by_p.reshape(n, m, k), 1, 2)
        return tau, gain, -self.stiffness - by_u.reshape(n, k, k)

    def arrays(self) -> dict[str, Array]:
        """Return the network as arrays for a `LawRecord`."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}


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
    """Fill the effort of m actuations; dtau_dp (k·m,) has ∂τ_i/∂a_j at i·m + j."""
    k = len(tau)
    m = int(parameters[1] + 0.5)
    axes = HEADER + COORDINATE * (m + k)
    width = 6 + 3 * m + k
    at, rate = np.empty(m + k), np.empty(m + k)
    for d in range(m + k):
        value = actuation[d] if d < m else deformation[d - m]
        at[d], rate[d] = _bent(value, parameters, HEADER + COORDINATE * d)
    _inside(at, parameters, tau, dtau_dp, dtau_du)
    for i in range(k):
        for j in range(i, k):
            dtau_du[i, j] *= rate[m + i] * rate[m + j]
        _outside(i, at, deformation[i], parameters, tau, dtau_dp, dtau_du)
        for j in range(m):
            side = 1 if actuation[j] > at[j] else 0
            outer = parameters[axes + width * i + 5 + 2 * j + side]
            tau[i] += (actuation[j] - at[j]) * outer
            dtau_dp[i * m + j] = rate[j] * dtau_dp[i * m + j] + (1.0 - rate[j]) * outer
    for i in range(k):
        for j in range(i):
            dtau_du[i, j] = dtau_du[j, i]


def _bent(value: float, parameters: Array, at: int) -> tuple[float, float]:
    """Return x̃ and its derivative by x."""
    low, high = parameters[at], parameters[at + 1]
    if low <= value <= high:
        return value, 1.0
    border = low if value < low else high
    bent = math.tanh((value - border) / parameters[at + 2])
    return border + parameters[at + 2] * bent, 1.0 - bent * bent


def _inside(at: Array, parameters: Array, tau: Array, dtau_dp: Array, dtau_du: Array) -> None:
    """Fill what `Network.efforts` has at a point (m + k,), of ∂τ/∂u the upper triangle."""
    k = len(tau)
    m = int(parameters[1] + 0.5)
    axes = HEADER + COORDINATE * (m + k)
    width = 6 + 3 * m + k
    for i in range(k):
        own = axes + width * i + 5 + 2 * m
        tau[i] = parameters[own]
        for j in range(m):
            tau[i] += at[j] * parameters[own + 1 + j]
            dtau_dp[i * m + j] = parameters[own + 1 + j]
        for j in range(k):
            tau[i] -= parameters[own + 1 + m + j] * at[m + j]
            dtau_du[i, j] = -parameters[own + 1 + m + j]
    for unit in range(int(parameters[0] + 0.5)):
        first = axes + width * k + unit * (2 + m + k)
        z = parameters[first]
        for d in range(m + k):
            z += parameters[first + 2 + d] * at[d]
        bell = 1.0 / math.sqrt(1.0 + z * z)
        slope = parameters[first + 1] * z * bell
        curvature = parameters[first + 1] * bell * bell * bell
        for i in range(k):
            w = parameters[first + 2 + m + i]
            tau[i] -= slope * w
            for j in range(m):
                dtau_dp[i * m + j] -= curvature * w * parameters[first + 2 + j]
            for j in range(i, k):
                dtau_du[i, j] -= curvature * w * parameters[first + 2 + m + j]


def _outside(
    i: int, at: Array, u: float, parameters: Array, tau: Array, dtau_dp: Array, dtau_du: Array
) -> None:
    """Add what axis i has outside its box to its effort and slopes; `at` (m + k,) are the bent coordinates."""
    k = len(tau)
    m = int(parameters[1] + 0.5)
    box = HEADER + COORDINATE * (m + i)
    low, high, reach = parameters[box], parameters[box + 1], parameters[box + 2]
    if low <= u <= high:
        return
    side = 1 if u > high else 0
    sign = 1.0 if u > high else -1.0
    axes = HEADER + COORDINATE * (m + k)
    width = 6 + 3 * m + k
    stiffness, guard = parameters[axes + width * i + 1 + side], parameters[axes + width * i + 3 + side]
    # the network where axis i is at its border and the others are at rest
    border, effort, gain, slope = np.empty(m + k), np.empty(k), np.empty(k * m), np.empty((k, k))
    for j in range(m):
        border[j] = at[j]
    for j in range(k):
        border[m + j] = parameters[axes + width * j]
    border[m + i] = high if u > high else low
    _inside(border, parameters, effort, gain, slope)
    excess = u - border[m + i]
    t = math.tanh(abs(excess) / reach)
    rate = 1.0 - t * t
    bending = -2.0 * t * rate / reach
    dtau_du[i, i] += (tau[i] - effort[i]) * sign * bending - stiffness * (1.0 - rate * rate) + guard * bending
    tau[i] = tau[i] * rate + effort[i] * (1.0 - rate) - guard * sign * (1.0 - rate)
    tau[i] -= stiffness * (excess - sign * reach * (t - t * t * t / 3.0))
    for j in range(m):
        dtau_dp[i * m + j] = dtau_dp[i * m + j] * rate + gain[i * m + j] * (1.0 - rate)


def shared(parameters: Array, share: float, axes: int) -> Array:
    """Return the parameters of the law of `axes` axes whose only actuation is `share` times the given one."""
    told = np.array(parameters, float)
    told[HEADER : HEADER + COORDINATE] /= share
    first, width = HEADER + COORDINATE * (1 + axes), 9 + axes
    by_axis = told[first : first + width * axes].reshape(axes, width)
    by_axis[:, [5, 6, 8]] *= share
    told[first + width * axes :].reshape(-1, 3 + axes)[:, 2] *= share
    return told
