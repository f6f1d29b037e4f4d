"""The polynomial law of one or three independent axes as one plain function, for engines that compile it.

`PolynomialLaw.evaluate` is the same in numpy, and its docstring has the formulas. Nothing here allocates.
"""

from __future__ import annotations

import math

import numpy as np

from pliant.records.design import Array

# Numbers before the coefficients in an axis's block of parameters: rows, columns, p₀, p₁, u₀, u₁, the box as
# p low, p high, u low, u high, the reaches L and the reference gains on both sides in p, and c_odd.
HEADER = 15
# Stands for "without limit", so that parameters are finite numbers.
UNBOUNDED = 1e300


def axes_effort(
    actuation: float, deformation: Array, parameters: Array, tau: Array, dtau_dp: Array, dtau_du: Array
) -> None:
    """Fill tau (a,), dtau_dp (a,) and the diagonal dtau_du (a, a) of `a` independent polynomial axes.

    `parameters` holds one block for each axis, as `block` writes it.
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


def shared(parameters: Array, share: float) -> Array:
    """Parameters of the law whose actuation is `share` times what it is told."""
    told, start = np.array(parameters, float), 0
    while start < len(told):
        for place in (2, 3, 6, 7, 10, 11):  # p₀, p₁, the box and the reaches in p
            if abs(told[start + place]) < UNBOUNDED:
                told[start + place] /= share
        told[start + 12 : start + 14] *= share
        start += HEADER + round(told[start]) * round(told[start + 1])
    return told


def block(
    coefficients: Array,
    maps: tuple[Array, Array],
    box: Array,
    reach: Array,
    reference_gain: Array,
    odd: float,
) -> Array:
    """(HEADER + I·J,) parameters of one axis: coefficients (I, J), maps of p and u, box (2, 2) of p and u."""
    limits = np.clip(np.concatenate([box.ravel(), reach]), -UNBOUNDED, UNBOUNDED)
    header = np.concatenate([coefficients.shape, *maps, limits, reference_gain, [odd]])
    return np.concatenate([header, coefficients.ravel()])
