"""Behaviour of a joint of the truth: functional forms other than those of the candidates, as compiled scalar code.

The candidates (plugins/pliant_plugins/effects) have another form for every kind but `inertia`. Which of these forms
are in calibration sets and which in judged ones is the table of `form_table.py`; numbers named `…_shape` choose one.

There is no disk cache: numba's cache of one file does not detect changes of other files.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from benchmarks.evidence.robots import B_E, K_N, M_A, M_E, PRESSURE_MAX_PA, Array
from numba import njit

from pliant_plugins.physics.compiled import discard_stale

TYPICAL_ANGLE_RAD = 0.36
ROOM_C = 22.0
# Memory of one joint: three Maxwell branches, three friction elements, the largest past angles on either
# side, the tendon's direction, the permanent set so far.
MAXWELL, FRICTION, LARGEST, LEAST, TENDON, SET, N_MEMORY = 0, 3, 6, 7, 8, 9, 10
ZERO = 1e-300  # strengths below this count as zero
# How something changes along 0 to 1: evenly, from half way on, with the square, or soon and then no more.
LINEAR, KINK, SQUARE, SATURATING = 0.0, 1.0, 2.0, 3.0
SOFTPLUS, ROOT, PARABOLA = 0.0, 1.0, 2.0
ORIFICE, SECOND_ORDER, DEAD_TIME = 0.0, 1.0, 2.0
BOUC_WEN, STOPS, DAHL = 0.0, 1.0, 2.0
EXPONENTIAL, TANH, RATIO = 0.0, 1.0, 2.0
ONE_STOP = 3.0
# The grid on which the error of a law is tabulated: shares of the largest pressure, and angles over the typical one.
LOWEST_SHARE, NODE_SHARE, SHARE_NODES = -0.4, 0.06, 31
LOWEST_BEND, NODE_BEND, BEND_NODES = -2.4, 0.1, 69
# Of damping with a quadratic part, of friction that falls with speed; rad/s.
TYPICAL_RATE, STRIBECK_RATE, LEAST_RATE = 0.3, 0.03, 1e-3


class Drive(NamedTuple):
    """The drive of a joint at one instant.

    `pressure_pa` in the chamber, `time_s` since the run began, `clock_s` since the session did, `cycles` done by the
    specimen so far, `wrap_rad` of the tendon up to the joint.
    """

    pressure_pa: float
    pressure_rate: float
    temperature_c: float
    moment_n_m: float
    time_s: float
    clock_s: float
    cycles: float
    wrap_rad: float


@njit(cache=True)
def with_wrap(d: Drive, wrap: float) -> Drive:
    """Return the drive of a joint further along the tendon."""
    return Drive(
        d.pressure_pa, d.pressure_rate, d.temperature_c, d.moment_n_m, d.time_s, d.clock_s, d.cycles, wrap
    )


class Forms(NamedTuple):
    """Numbers of every form, SI; the defaults are a joint without any effect."""

    # error of the model's law: relative, smooth
    actuation_error: float = 0.0
    actuation_phase: float = 0.0
    elastic_error: float = 0.0
    elastic_phase: float = 0.0
    # the same, any shape: spline coefficients on the grid, N·m; no rows for no error
    law: Array = np.zeros((0, 0))
    # the kinds
    stiffness: float = 0.0
    stiffness_quadratic: float = 1.0
    stiffness_fading: float = 0.0
    stiffness_shape: float = LINEAR
    gain: float = 0.0
    gain_fading: float = 0.0
    gain_shape: float = LINEAR
    offset_pa: float = 0.0
    offset_fading: float = 0.0
    offset_shape: float = LINEAR
    dead_pa: float = 0.0
    dead_width: float = 0.25
    dead_shape: float = SOFTPLUS
    lag_s: float = 0.0
    lag_vent: float = 1.5
    lag_linear: float = 0.04
    lag_second: float = 0.15
    lag_shape: float = ORIFICE
    viscous: float = 0.0
    viscous_power: float = 1.0
    viscous_quadratic: float = 0.0
    branch_1: float = 0.0
    branch_2: float = 0.0
    branch_3: float = 0.0
    time_1_s: float = 1.0
    time_2_s: float = 1.0
    time_3_s: float = 1.0
    eyring_rad: float = 0.0
    friction: float = 0.0
    friction_width: float = 0.1
    friction_shape: float = BOUC_WEN
    friction_stribeck: float = 0.0
    mullins: float = 0.0
    mullins_scale: float = 0.1
    mullins_shape: float = EXPONENTIAL
    set_share: float = 0.0
    set_power: float = 2.0
    set_limit: float = 0.0
    set_delay_s: float = 0.0
    contact: float = 0.0
    contact_at: float = 0.3
    contact_width: float = 0.03
    contact_power: float = 0.0
    thermal: float = 0.0
    thermal_curvature: float = 0.0
    thermal_quadratic: float = 1.0
    wall: float = 1.0
    wall_linear: float = 2.6
    wall_quadratic: float = 1.8
    wall_gain: float = 0.3
    wall_fading: float = 0.5
    leak_1_s: float = 0.0
    leak_power: float = 1.0
    leak_filling_s: float = 0.15
    leak_crack: float = 0.0
    leak_crack_at: float = 0.5
    tendon: float = 0.0
    tendon_width: float = 0.01
    tendon_rest_rad: float = 0.1
    tendon_shape: float = BOUC_WEN
    bimodulus: float = 0.0
    bimodulus_width: float = 0.06
    bimodulus_quadratic: float = 1.0
    bimodulus_jump: float = 0.0
    end_base: float = 0.0
    end_cap: float = 0.0
    end_cubic: float = 0.0
    end_giving: float = 0.0
    # what no plugin has
    bump: float = 0.0
    bump_at: float = 0.6
    bump_width: float = 0.1
    bump_turns: float = 0.0
    ripple: float = 0.0
    ripple_period_s: float = 37.0
    ripple_phase: float = 0.0
    ripple_saw: float = 0.0
    ageing: float = 0.0
    ageing_power: float = 1.0
    filling: float = 0.0
    filling_power: float = 0.0
    warm_stick: float = 0.0
    drift_1_s: float = 0.0
    drift_settles_s: float = 0.0
    buckling: float = 0.0
    buckling_at: float = 0.5
    buckling_until: float = 0.0
    beat: float = 0.0
    beat_period_s: float = 5.0
    beat_steps: float = 0.0
    detent: float = 0.0
    detent_period_rad: float = 0.2
    detent_at_rad: float = 0.0
    load_coupling: float = 0.0
    load_bending: float = 0.0


@njit(cache=True)
def softplus(x: float) -> float:
    """Return log(1 + e^x) without overflow."""
    return x if x > 30.0 else math.log1p(math.exp(x))


@njit(cache=True)
def along(shape: float, x: float) -> float:
    """Return the progress of a change at x of 0 to 1."""
    if shape == KINK:
        return max(0.0, 2.0 * x - 1.0)
    if shape == SQUARE:
        return x * x
    return 1.0 - math.exp(-3.0 * x) if shape == SATURATING else x


@njit(cache=True)
def arriving(supply: Array, middle: float, end: float, valve: float, dt: float, f: Forms) -> float:
    """Return the pressure in the chamber after dt; advance `supply` (3,), both stages and a rate.

    `middle` and `end` are the commanded pressure half way and at the end of the step. A closed valve keeps what there
    is, but for the leak. The first stage is filled through an orifice and vented through a smaller one, the second
    is a hose, linear and short.
    """
    if valve < 0.5:
        supply[2] = 0.0
        supply[0] = supply[1] = max(0.0, supply[1] - dt * outflow(supply[1], f))
        return supply[1]
    if f.lag_s <= 0.0:
        supply[0] = supply[1] = end
    elif f.lag_shape != ORIFICE:
        time = f.lag_s * (f.lag_vent if middle < supply[1] else 1.0)
        if f.lag_shape == DEAD_TIME:
            supply[1] = middle + (supply[1] - middle) * math.exp(-dt / time)
        else:
            oscillating(supply, middle, dt, time, f.lag_second)
        supply[0] = supply[1]
    else:
        time = f.lag_s * (f.lag_vent if middle < supply[0] else 1.0)
        supply[0] = middle + through_orifice(supply[0] - middle, dt, time, f.lag_linear * PRESSURE_MAX_PA)
        supply[1] = supply[0] + (supply[1] - supply[0]) * math.exp(-dt / (f.lag_second * f.lag_s))
    return supply[1] - f.leak_filling_s * outflow(supply[1], f)


@njit(cache=True)
def oscillating(supply: Array, level: float, dt: float, time: float, damping: float) -> None:
    """Advance pressure and its rate by dt: exactly p''/ω² + time p' + p = level, with damping ζ < 1, ω = 2 ζ / time."""
    omega = 2.0 * damping / time
    decay, ringing = damping * omega, omega * math.sqrt(1.0 - damping * damping)
    gap, rate = supply[1] - level, supply[2]
    c, s, e = math.cos(ringing * dt), math.sin(ringing * dt), math.exp(-decay * dt)
    other = (rate + decay * gap) / ringing
    supply[1] = level + e * (gap * c + other * s)
    supply[2] = e * (rate * c - (decay * other + ringing * gap) * s)


@njit(cache=True)
def through_orifice(gap: float, dt: float, time: float, linear: float) -> float:
    """Return a difference of pressures after dt, Pa: the exact solution of

    d(gap)/dt = −sign(gap) √(|gap| p_s) / time,     below `linear` −gap √(p_s / linear) / time,

    turbulent through a hole and laminar at low flow. Without the laminar range p_s vanishes after 2 time.
    """
    left, rate = abs(gap), math.sqrt(PRESSURE_MAX_PA) / time
    if left > linear:
        until = 2.0 * (math.sqrt(left) - math.sqrt(linear)) / rate
        if dt <= until:
            return math.copysign((math.sqrt(left) - 0.5 * rate * dt) ** 2, gap)
        left, dt = linear, dt - until
    return math.copysign(left * math.exp(-dt * rate / math.sqrt(linear)), gap)


@njit(cache=True)
def outflow(pressure: float, f: Forms) -> float:
    """Return the leakage of a chamber, Pa/s."""
    if f.leak_1_s <= 0.0 or pressure <= 0.0:
        return 0.0
    share = pressure / PRESSURE_MAX_PA
    opened = f.leak_crack * max(0.0, share - f.leak_crack_at)
    return f.leak_1_s * PRESSURE_MAX_PA * (share**f.leak_power + opened)


@njit(cache=True)
def acting(pressure: float, f: Forms) -> float:
    """Return the acting pressure from the pressure in the tube."""
    p = pressure + f.offset_pa * (1.0 - f.offset_fading * along(f.offset_shape, pressure / PRESSURE_MAX_PA))
    if f.dead_pa > 0.0:
        p = beyond(p - f.dead_pa, f) - beyond(-f.dead_pa, f)
    return p


@njit(cache=True)
def beyond(excess: float, f: Forms) -> float:
    """Return the acting part of a pressure beyond its dead zone, with a rounded corner."""
    w = f.dead_width * f.dead_pa
    if f.dead_shape == ROOT:
        return 0.5 * (excess + math.sqrt(excess * excess + w * w))
    if f.dead_shape == PARABOLA:
        return (excess + w) ** 2 / (4.0 * w) if abs(excess) < w else max(excess, 0.0)
    return w * softplus(excess / w)


@njit(cache=True)
def relaxed(q: float, step: float, dt: float, time: float) -> float:
    """Return a Maxwell branch's stretch after a straight step: the exact solution of q' = u' − q/T."""
    x = dt / time
    return q * math.exp(-x) - step * math.expm1(-x) / x


@njit(cache=True)
def bouc_wen(z: float, step: float) -> float:
    """Return hysteretic variable in [−1, 1] after a step of widths: dz/du = 1 − z² while loading, 1 while unloading."""
    way = 1.0 if step >= 0.0 else -1.0
    z, step = way * z, way * step
    if z < 0.0:
        along = min(step, -z)
        z, step = z + along, step - along
    if step > 0.0:
        z = math.tanh(math.atanh(min(z, 1.0 - 1e-12)) + step)
    return way * z


@njit(cache=True)
def dahl(z: float, step: float) -> float:
    """Return the bristles in [−1, 1] after a step of widths: dz/du = 1 − z sign(du) (Dahl 1968), exactly."""
    way = 1.0 if step >= 0.0 else -1.0
    return way - (way - z) * math.exp(-abs(step))


@njit(cache=True)
def rubbing(old: Array, new: Array, step: float, dt: float, f: Forms) -> float:
    """Return the friction in shares of its limit; write the elements' memory."""
    width = f.friction_width
    if f.friction_shape == BOUC_WEN:
        new[FRICTION] = bouc_wen(old[FRICTION], step / width)
        return new[FRICTION]
    if (
        f.friction_shape == DAHL
    ):  # as in LuGre's model the limit falls with speed (Canudas de Wit et al. 1995)
        new[FRICTION] = dahl(old[FRICTION], step / width)
        return new[FRICTION] * (1.0 + f.friction_stribeck * math.exp(-((step / dt / STRIBECK_RATE) ** 2)))
    if f.friction_shape == ONE_STOP:
        new[FRICTION] = max(-1.0, min(1.0, old[FRICTION] + step / width))
        return new[FRICTION]
    total = 0.0
    for k in range(3):
        limit = width * (0.4, 1.0, 2.2)[k]
        new[FRICTION + k] = max(-limit, min(limit, old[FRICTION + k] + step))
        total += (0.4, 0.35, 0.25)[k] * new[FRICTION + k] / limit
    return total


@njit(cache=True)
def viscous_torque(rate: float, f: Forms) -> float:
    """Return viscous torque over rate, N·m·s."""
    if f.viscous <= 0.0:
        return 0.0
    speed = math.sqrt(rate * rate + LEAST_RATE**2)
    return f.viscous * (speed ** (f.viscous_power - 1.0) + f.viscous_quadratic * speed / TYPICAL_RATE)


@njit(cache=True)
def lost(below: float, top: float, f: Forms) -> float:
    """Return the share of the Mullins damage at an angle below the largest one."""
    x = below / f.mullins_scale
    if f.mullins_shape == TANH:
        return math.tanh(x)
    if f.mullins_shape == RATIO:
        return below / (top + f.mullins_scale)
    return 1.0 - math.exp(-x)


@njit(cache=True)
def stretched(largest: float, f: Forms) -> float:
    """Return the set due to a largest past angle, in shares of the typical angle."""
    x = largest / TYPICAL_ANGLE_RAD
    if f.set_limit > 0.0:
        return f.set_limit**2 * (1.0 - math.exp(-((x / f.set_limit) ** 2)))
    return x**f.set_power


@njit(cache=True)
def law_error(share: float, u: float, table: Array) -> float:
    """Return the error of the law, N·m: a bicubic B-spline over the grid, constant beyond it."""
    x = min(max((share - LOWEST_SHARE) / NODE_SHARE, 1.0), SHARE_NODES - 2.001)
    y = min(max((u / TYPICAL_ANGLE_RAD - LOWEST_BEND) / NODE_BEND, 1.0), BEND_NODES - 2.001)
    i, j = int(x), int(y)
    along, across = cubic(x - i), cubic(y - j)
    total = 0.0
    for k in range(4):
        for m in range(4):
            total += along[k] * across[m] * table[i - 1 + k, j - 1 + m]
    return total


@njit(cache=True)
def cubic(t: float) -> tuple[float, float, float, float]:
    """Return the four cubic B-splines at t of 0 to 1 between two nodes."""
    s = 1.0 - t
    first, last = s * s * s / 6.0, t * t * t / 6.0
    return first, 2.0 / 3.0 - t * t * (1.0 - 0.5 * t), 2.0 / 3.0 - s * s * (1.0 - 0.5 * s), last


@njit(cache=True)
def wraps(angles: Array, module: Array, f: Forms) -> Array:
    """Return (n,) the turn of the tendon up to the middle of each joint."""
    turned, out = 0.0, np.zeros(len(angles))
    for j in range(len(angles)):
        if module[j] >= 0:
            turned += f.tendon_rest_rad + 0.5 * abs(angles[j])
            out[j] = turned
            turned += 0.5 * abs(angles[j])
    return out


@njit(cache=True)
def effort(
    u: float,
    step: float,
    dt: float,
    drive: Drive,
    old: Array,
    new: Array,
    f: Forms,
) -> float:
    """Return the effort of a joint at u, reached from u − step in dt; write the memory `new` (N_MEMORY,) of `old`."""
    p, warm = acting(drive.pressure_pa, f), drive.temperature_c - ROOM_C
    share = p / PRESSURE_MAX_PA
    new[LARGEST], new[LEAST] = max(old[LARGEST], u), min(old[LEAST], u)
    top = max(new[LARGEST], -new[LEAST])

    v = u
    if f.set_share > 0.0:
        left = f.set_share * TYPICAL_ANGLE_RAD * (stretched(new[LARGEST], f) - stretched(-new[LEAST], f))
        if f.set_delay_s > 0.0:
            left += (old[SET] - left) * math.exp(-dt / f.set_delay_s)
        new[SET] = left
        v -= left
    side = v / f.bimodulus_width
    side = max(-1.0, min(1.0, side)) if f.bimodulus_jump > 0.5 else math.tanh(side)
    stiffer = f.stiffness * (
        1.0 + f.stiffness_fading * along(f.stiffness_shape, 0.5 * abs(u) / TYPICAL_ANGLE_RAD)
    )
    softer = f.thermal * warm * (1.0 - f.thermal_curvature * warm)
    linear = B_E * v * (1.0 + stiffer) * (1.0 + f.bimodulus * side) * (1.0 - softer)
    quadratic = 0.5 * M_E * v * abs(v) * (1.0 + stiffer * f.stiffness_quadratic)
    quadratic *= (1.0 + f.bimodulus * f.bimodulus_quadratic * side) * (1.0 - softer * f.thermal_quadratic)
    if f.wall != 1.0:
        linear *= f.wall**f.wall_linear
        quadratic *= f.wall**f.wall_quadratic
    factor = 1.0 + f.elastic_error * math.sin(3.0 * u / TYPICAL_ANGLE_RAD + f.elastic_phase)
    factor *= 1.0 - f.mullins * lost(top - abs(u), top, f)
    if f.drift_settles_s > 0.0:
        factor *= 1.0 + f.drift_1_s * f.drift_settles_s * (1.0 - math.exp(-drive.clock_s / f.drift_settles_s))
    else:
        factor *= 1.0 + f.drift_1_s * drive.clock_s
    if f.buckling != 0.0:
        buckled = 1.0 / (1.0 + math.exp(-(share - f.buckling_at) / 0.03))
        if f.buckling_until > 0.0:  # and it springs back
            buckled -= 1.0 / (1.0 + math.exp(-(share - f.buckling_at - f.buckling_until) / 0.03))
        factor *= 1.0 - f.buckling * buckled
    moment = -factor * (linear + quadratic)

    gain = 1.0 + f.actuation_error * math.sin(4.0 * share + f.actuation_phase)
    gain *= 1.0 + f.gain * (1.0 - f.gain_fading * along(f.gain_shape, share))
    if f.bump != 0.0:
        x = (share - f.bump_at) / f.bump_width
        gain *= 1.0 + f.bump * math.exp(-x * x) * (2.0 * x if f.bump_turns > 0.5 else 1.0)
    gain *= 1.0 - f.ageing * drive.cycles**f.ageing_power
    if f.filling != 0.0:
        gain *= 1.0 + f.filling * filling(drive.pressure_rate, share, f)
    if f.beat != 0.0:
        wave = math.sin(2.0 * math.pi * drive.time_s / f.beat_period_s)
        gain *= 1.0 + f.beat * (math.copysign(1.0, wave) if f.beat_steps > 0.5 else wave)
    if f.wall != 1.0:
        gain *= f.wall ** (f.wall_gain * (1.0 - f.wall_fading * share))
    if f.tendon > 0.0:
        along_wrap = step / f.tendon_width
        turning = (
            dahl(old[TENDON], along_wrap) if f.tendon_shape == DAHL else bouc_wen(old[TENDON], along_wrap)
        )
        new[TENDON] = turning
        gain *= math.exp(-f.tendon * drive.wrap_rad * turning)
    moment += gain * p * (K_N + M_A * u)
    if f.law.shape[0] > 0:
        moment += law_error(share, u, f.law)

    if f.viscous > 0.0:
        moment -= viscous_torque(step / dt, f) * step / dt
    if f.branch_1 > 0.0:
        for k in range(3):
            time = (f.time_1_s, f.time_2_s, f.time_3_s)[k]
            if f.eyring_rad > 0.0:  # strained more, it flows sooner (Eyring 1936)
                time /= 1.0 + abs(old[MAXWELL + k]) / f.eyring_rad
            new[MAXWELL + k] = relaxed(old[MAXWELL + k], step, dt, time)
        moment -= f.branch_1 * new[MAXWELL] + f.branch_2 * new[MAXWELL + 1] + f.branch_3 * new[MAXWELL + 2]
    friction = f.friction + f.warm_stick * max(warm, 0.0)
    if friction > ZERO:
        moment -= friction * rubbing(old, new, step, dt, f)
    if f.contact > 0.0:
        depth = (u - f.contact_at) / f.contact_width
        if f.contact_power > 0.0:
            moment -= f.contact * f.contact_width * max(depth, 0.0) ** f.contact_power
        else:
            moment -= f.contact * f.contact_width * softplus(depth)
    if f.ripple != 0.0:
        turns = drive.time_s / f.ripple_period_s + f.ripple_phase / (2.0 * math.pi)
        saw = 2.0 * (turns - math.floor(turns)) - 1.0
        moment += f.ripple * (saw if f.ripple_saw > 0.5 else math.sin(2.0 * math.pi * turns))
    if f.detent != 0.0:
        away = (u - f.detent_at_rad) / f.detent_period_rad
        if f.detent_at_rad > 0.0:  # one catch
            moment -= f.detent * away * math.exp(0.5 - 0.5 * away * away)
        else:
            moment -= f.detent * math.sin(2.0 * math.pi * away)
    if f.load_coupling != 0.0:
        load = drive.moment_n_m
        moment -= f.load_coupling * load * (share if f.load_bending < 0.5 else abs(u) / TYPICAL_ANGLE_RAD)
    return moment


@njit(cache=True)
def filling(rate: float, share: float, f: Forms) -> float:
    """Return the excess of a filling chamber over a venting one."""
    way = math.tanh(rate / 150.0)
    if f.filling_power > 0.0:
        return way * max(share, 0.0) ** f.filling_power
    return way * math.sin(math.pi * share)


@njit(cache=True)
def healed(memory: Array) -> None:
    """Reset the branches that relax with time, in place, (n, N_MEMORY); friction and damage stay."""
    memory[:, MAXWELL:FRICTION] = 0.0


def virgin(modules: int) -> Array:
    """Return (n, N_MEMORY) memory of a new specimen."""
    return np.zeros((modules, N_MEMORY))


# Machine code of the truths contains forms and constants of other files, whose changes numba does not detect.
discard_stale(Path(effort.stats.cache_path), tuple(Path(__file__).parent.glob("*.py")))
