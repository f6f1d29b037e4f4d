"""The law of a polynomial energy: one joint as a plain function for engines that compile it, many joints at once.

`EnergyPolynomialLaw`'s docstring has the formulas. The plain functions allocate nothing; laws of fewer than three
axes are filled up with axes that no term contains. Of many points those in the box go through the terms side by side,
the terms outside the loop over points, others one by one. Nothing of other files is called here: numba's cache on
disk looks only at the file of a function. No operation is reordered or fused.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
from numba import njit
from numba.extending import register_jitable
from numpy.typing import NDArray

from pliant.records.design import Array

# Parameters: number of monomials in u, of powers of x; p₀, p₁, p low, p high, reaches below and above; six numbers of
# each of three axes: u₀, u₁, u low, u high, reach, bowl; reference gains below (3) and above (3); then the monomials:
# whether it couples axes, its three powers, and its coefficients of x⁰, x¹ …
AXES = 8
GAINS = AXES + 18
HEADER = GAINS + 6
# Represents "without limit", so that parameters are finite numbers.
UNBOUNDED = 1e300


def energy_effort(
    actuation: float, deformation: Array, parameters: Array, tau: Array, dtau_dp: Array, dtau_du: Array
) -> None:
    """Fill tau (a,), dtau_dp (a,) and the symmetric dtau_du (a, a) of one to three coupled axes."""
    n = len(tau)
    x, y, z = deformation[0], 0.0, 0.0
    if n > 1:
        y = deformation[1]
    if n > 2:
        z = deformation[2]
    _, tx, ty, tz, gx, gy, gz, xx, xy, xz, yy, yz, zz = energy_and_slopes(actuation, x, y, z, parameters)
    tau[0], dtau_dp[0], dtau_du[0, 0] = tx, gx, xx
    if n > 1:
        tau[1], dtau_dp[1], dtau_du[1, 1] = ty, gy, yy
        dtau_du[0, 1], dtau_du[1, 0] = xy, xy
    if n > 2:
        tau[2], dtau_dp[2], dtau_du[2, 2] = tz, gz, zz
        dtau_du[0, 2], dtau_du[2, 0] = xz, xz
        dtau_du[1, 2], dtau_du[2, 1] = yz, yz


def energy_and_slopes(
    actuation: float, u_x: float, u_y: float, u_z: float, parameters: Array
) -> tuple[
    float, float, float, float, float, float, float, float, float, float, float, float, float
]:  # fmt: skip
    """Return Π up to a function of p, then τ, ∂τ/∂p, and ∂τ/∂u as xx, xy, xz, yy, yz, zz."""
    monomials, columns = int(parameters[0] + 0.5), int(parameters[1] + 0.5)
    p = min(max(actuation, parameters[4]), parameters[5])
    over = actuation - p
    reach, rate = over, 1.0
    side = 7 if over > 0.0 else 6
    if over != 0.0 and parameters[side] < UNBOUNDED:
        bent = math.tanh(over / parameters[side])
        reach, rate = parameters[side] * bent, 1.0 - bent * bent
    x = (p - parameters[2]) / parameters[3]
    reach_x, rate_x = reach / parameters[3], rate / parameters[3]
    vx, dx, sx, rx, bx, ex, fx, hx = _axis(u_x, AXES, parameters)
    vy, dy, sy, ry, by, ey, fy, hy = _axis(u_y, AXES + 6, parameters)
    vz, dz, sz, rz, bz, ez, fz, hz = _axis(u_z, AXES + 12, parameters)
    start = GAINS + (3 if over > 0.0 else 0)
    gx, gy, gz = parameters[start], parameters[start + 1], parameters[start + 2]
    push = over - reach
    energy = ex + ey + ez - push * (gx * u_x + gy * u_y + gz * u_z)
    tx, ty, tz = push * gx - fx, push * gy - fy, push * gz - fz
    gx, gy, gz = (1.0 - rate) * gx, (1.0 - rate) * gy, (1.0 - rate) * gz
    xx, yy, zz = -hx, -hy, -hz
    xy, xz, yz = 0.0, 0.0, 0.0
    place = HEADER
    for _ in range(monomials):
        value, slope = 0.0, 0.0
        for i in range(place + 3 + columns, place + 3, -1):
            slope = slope * x + value
            value = value * x + parameters[i]
        value += slope * reach_x
        slope *= rate_x
        if parameters[place] > 0.5:
            px, px1, px2 = _bent_power(sx, rx, bx, parameters[place + 1])
            py, py1, py2 = _bent_power(sy, ry, by, parameters[place + 2])
            pz, pz1, pz2 = _bent_power(sz, rz, bz, parameters[place + 3])
            q, q1, q2, q3 = py * pz, px * pz, px * py, value * px
            energy += value * px * q
            tx -= value * px1 * q
            ty -= value * py1 * q1
            tz -= value * pz1 * q2
            gx -= slope * px1 * q
            gy -= slope * py1 * q1
            gz -= slope * pz1 * q2
            xx -= value * px2 * q
            yy -= value * py2 * q1
            zz -= value * pz2 * q2
            xy -= value * px1 * py1 * pz
            xz -= value * px1 * pz1 * py
            yz -= q3 * py1 * pz1
        elif parameters[place + 1] > 0.5:
            w, w1, w2 = _straight_power(vx, dx, parameters[AXES + 1], parameters[place + 1])
            energy += value * w
            tx -= value * w1
            gx -= slope * w1
            xx -= value * w2
        elif parameters[place + 2] > 0.5:
            w, w1, w2 = _straight_power(vy, dy, parameters[AXES + 7], parameters[place + 2])
            energy += value * w
            ty -= value * w1
            gy -= slope * w1
            yy -= value * w2
        else:
            w, w1, w2 = _straight_power(vz, dz, parameters[AXES + 13], parameters[place + 3])
            energy += value * w
            tz -= value * w1
            gz -= slope * w1
            zz -= value * w2
        place += 4 + columns
    return energy, tx, ty, tz, gx, gy, gz, xx, xy, xz, yy, yz, zz


def _axis(
    u: float, start: int, parameters: Array
) -> tuple[float, float, float, float, float, float, float, float]:
    """Return v at the border, the excess in v; bounded v, its derivatives by u; the bowl and its derivatives."""
    inside = min(max(u, parameters[start + 2]), parameters[start + 3])
    scale, limit = parameters[start + 1], parameters[start + 4]
    v, over = (inside - parameters[start]) / scale, u - inside
    if over == 0.0:
        return v, 0.0, v, 1.0 / scale, 0.0, 0.0, 0.0, 0.0
    bent = math.tanh(over / limit)
    rate = 1.0 - bent * bent
    a, sign = abs(over) / limit, (1.0 if over > 0.0 else -1.0)
    bowl = parameters[start + 5]
    log = math.log(1.0 + a)
    return (
        v,
        over / scale,
        v + limit * bent / scale,
        rate / scale,
        -2.0 * bent * rate / (limit * scale),
        bowl * limit * limit * (a * a / 2.0 + a - (1.0 + a) * log),
        bowl * sign * limit * (a - log),
        bowl * a / (1.0 + a),
    )


def _bent_power(s: float, rate: float, bend: float, power: float) -> tuple[float, float, float]:
    """Return s^j and its first two derivatives by u, where s(u) has the derivatives `rate` and `bend`."""
    if power < 0.5:
        return 1.0, 0.0, 0.0
    if power < 1.5:
        return s, rate, bend
    low = 1.0
    for _ in range(int(power + 0.5) - 2):
        low *= s
    first = power * low * s
    return low * s * s, first * rate, power * (power - 1.0) * low * rate * rate + first * bend


def _straight_power(v: float, over: float, scale: float, power: float) -> tuple[float, float, float]:
    """Return v^j, continued from the border by its second-order Taylor polynomial, and its derivatives by u."""
    if power < 1.5:
        return v + over, 1.0 / scale, 0.0
    low = 1.0
    for _ in range(int(power + 0.5) - 2):
        low *= v
    first, second = power * low * v, power * (power - 1.0) * low
    value = low * v * v + (first + second * over / 2.0) * over
    return value, (first + second * over) / scale, second / (scale * scale)


def one_by_one(at: Array, parameters: Array, out: Array) -> None:
    """Fill out (n, 13) with `energy_and_slopes` at p and u in rows (n, 4)."""
    for n in range(len(at)):
        found = energy_and_slopes(at[n, 0], at[n, 1], at[n, 2], at[n, 3], parameters)
        for k in range(len(found)):
            out[n, k] = found[k]


def shared(parameters: Array, share: float) -> Array:
    """Return the parameters of the law whose actuation is `share` times the given one."""
    told = np.array(parameters, float)
    acting = told[2:AXES]  # p₀, p₁, the box and the reaches in p
    told[2:AXES] = np.where(np.abs(acting) >= UNBOUNDED, acting, acting / share)
    told[GAINS:HEADER] *= share
    return told


# Points that go through the terms together: their powers stay in the first-level cache.
BLOCK = 64
COLUMNS = 13  # Π, τ (3), ∂τ/∂p (3), ∂τ/∂u as xx, xy, xz, yy, yz, zz


@njit(cache=True, nogil=True, error_model="numpy")
def inside(at: Array, maps: Array, powers: NDArray[np.int64], table: Array, out: Array) -> None:
    """Fill out (n, 13).

    Args:
        at: (n, 4) p and u, all in the box.
        maps: (4, 2) centres and scales of p and u.
        powers: (m, 3) of each monomial in u.
        table: (m, columns) its coefficients of x⁰, x¹ …
    """
    columns = table.shape[1]
    most = powers.max() if len(powers) else 0
    x = np.empty(BLOCK)
    value, slope = np.empty(BLOCK), np.empty(BLOCK)
    # v^j of each axis; the places before the first are zero, for derivatives of low powers
    v = np.zeros((3, most + 3, BLOCK))
    found = np.empty((COLUMNS, BLOCK))
    sx, sy, sz = maps[1, 1], maps[2, 1], maps[3, 1]
    for start in range(0, len(at), BLOCK):
        n = min(BLOCK, len(at) - start)
        for k in range(n):
            x[k] = (at[start + k, 0] - maps[0, 0]) / maps[0, 1]
        for a in range(3):
            for k in range(n):
                v[a, 2, k] = 1.0
            for k in range(n):
                first = (at[start + k, 1 + a] - maps[1 + a, 0]) / maps[1 + a, 1]
                for j in range(3, most + 3):
                    v[a, j, k] = v[a, j - 1, k] * first
        found[:] = 0.0
        for m in range(len(powers)):
            a, b, c = powers[m, 0], powers[m, 1], powers[m, 2]
            a1, b1, c1 = a / sx, b / sy, c / sz
            a2, b2, c2 = a1 * (a - 1) / sx, b1 * (b - 1) / sy, c1 * (c - 1) / sz
            for k in range(n):
                value[k] = table[m, columns - 1]
                slope[k] = 0.0
            for i in range(columns - 2, -1, -1):
                c_i = table[m, i]
                for k in range(n):
                    slope[k] = slope[k] * x[k] + value[k]
                    value[k] = value[k] * x[k] + c_i
            X, X1, X2 = v[0, a + 2], v[0, a + 1], v[0, a]
            Y, Y1, Y2 = v[1, b + 2], v[1, b + 1], v[1, b]
            Z, Z1, Z2 = v[2, c + 2], v[2, c + 1], v[2, c]
            for k in range(n):
                px, py, pz = a1 * X1[k], b1 * Y1[k], c1 * Z1[k]
                yz, xz, xy = Y[k] * Z[k], X[k] * Z[k], X[k] * Y[k]
                w = value[k]
                gx, gy, gz = px * yz, py * xz, pz * xy
                found[0, k] += w * X[k] * yz
                found[1, k] -= w * gx
                found[2, k] -= w * gy
                found[3, k] -= w * gz
                found[4, k] -= slope[k] * gx
                found[5, k] -= slope[k] * gy
                found[6, k] -= slope[k] * gz
                found[7, k] -= w * a2 * X2[k] * yz
                found[8, k] -= w * px * py * Z[k]
                found[9, k] -= w * px * pz * Y[k]
                found[10, k] -= w * b2 * Y2[k] * xz
                found[11, k] -= w * py * pz * X[k]
                found[12, k] -= w * c2 * Z2[k] * xy
        for k in range(n):
            rate = 1.0 / maps[0, 1]
            for i in range(4, 7):
                found[i, k] *= rate
            for i in range(COLUMNS):
                out[start + k, i] = found[i, k]


def evaluate(actuation: Array, deformation: Array, parameters: Array) -> Array:
    """Return (n, 13) the results of `energy_and_slopes` for p (n,) and u (n, k), up to rounding."""
    n = len(actuation)
    at = np.zeros((n, 4))
    at[:, 0], at[:, 1 : 1 + deformation.shape[1]] = actuation, deformation
    axes = parameters[AXES:GAINS].reshape(3, 6)
    maps = np.vstack([parameters[2:4], axes[:, :2]])
    low, high = np.vstack([parameters[4:6], axes[:, 2:4]]).T
    columns = int(parameters[1])
    rows = parameters[HEADER:].reshape(-1, 4 + columns)
    table = np.ascontiguousarray(rows[:, 4:])
    powers = np.round(rows[:, 1:4]).astype(np.int64)
    out = np.empty((n, COLUMNS))
    outside = ~np.all((at >= low) & (at <= high), axis=1)  # also NaN
    if not outside.any():
        inside(at, maps, powers, table, out)
        return out
    part = np.empty((n - int(outside.sum()), COLUMNS))
    inside(at[~outside], maps, powers, table, part)
    beyond = np.empty((n - len(part), COLUMNS))
    _one_by_one()(at[outside], np.array(parameters), beyond)
    out[~outside], out[outside] = part, beyond
    return out


@cache
def _one_by_one() -> Any:
    """Loop over points, compiled: its disk cache depends on this file, which has all that it calls."""
    for helper in (_axis, _bent_power, _straight_power, energy_and_slopes):
        register_jitable(helper)
    return njit(cache=True, error_model="numpy")(one_by_one)
