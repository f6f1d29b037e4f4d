"""What a joint of the truth does: functional forms unlike those of the candidates, as compiled scalar code.

The candidates (plugins/pliant_plugins/effects) have another form for every one of these kinds:

| kind | the truth's form |
|---|---|
| stiffness | the quadratic part of E changes by another share than the linear part |
| actuation_gain | a gain that fades with pressure |
| pressure_offset | an offset that fades with pressure |
| dead_zone | softplus |
| supply_lag | through an orifice: dp/dt as the root of the difference, venting through a smaller one; then a hose |
| viscous_damping | shear thinning, |rate|^n with n < 1 (MuJoCo: its own joint damping) |
| viscoelastic | three Maxwell branches over a decade, exponential steps |
| friction_hysteresis | Bouc-Wen or three Prandtl-Ishlinskii stops (MuJoCo: its own frictionloss) |
| mullins | exponential in the distance from the largest past angle |
| permanent_set | a power between 1.5 and 2 of the largest past angles |
| self_contact | softplus, or quadratic beyond contact |
| thermal_softening | with curvature in temperature |
| wall_thickness | two powers, of the linear and the quadratic part of E; the gain's fades with pressure |
| leak | through an orifice: dp/dt in proportion to p^n, n < 1 (calibration: n > 1) |
| tendon_friction | capstan over the wraps that the joints before it really have; the direction turns over by Bouc-Wen |
| bimodulus | tanh of the angle, wide (calibration: a jump); the quadratic part takes another share |
| gravity_scale | a fitting elsewhere on the pieces (`skeleton.Body`) |
| inertia | balanced bars on the pieces of a dynamic engine, or Newmark's rule in fine steps (`skeleton.Body`) |
| base_misalignment, cross_axis | a third angle; turns that differ along the chain (`skeleton.Body`) |
| inter_module_compliance | real hinges between the modules, springs with a cubic part (`skeleton.Body`) |
| sensor_bias | with a small scale (`sensors.Sensor`) |
| sensor_scale, sensor_lag, backlash | curved; two stages; three plays of other widths (`sensors.Sensor`) |

Nothing is cached on disk: numba's cache of one file does not see that another file has changed.
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
# side, the tendon's direction.
MAXWELL, FRICTION, LARGEST, LEAST, TENDON, N_MEMORY = 0, 3, 6, 7, 8, 9
ZERO = 1e-300  # strengths below this are none


class Drive(NamedTuple):
    """What acts on a joint at one instant.

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
    """The drive of a joint further along the tendon."""
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
    # the kinds
    stiffness: float = 0.0
    stiffness_quadratic: float = 1.0
    gain: float = 0.0
    gain_fading: float = 0.0
    offset_pa: float = 0.0
    offset_fading: float = 0.0
    dead_pa: float = 0.0
    dead_width: float = 0.25
    lag_s: float = 0.0
    lag_vent: float = 1.5
    lag_linear: float = 0.04
    lag_second: float = 0.15
    viscous: float = 0.0
    viscous_power: float = 1.0
    branch_1: float = 0.0
    branch_2: float = 0.0
    branch_3: float = 0.0
    time_1_s: float = 1.0
    time_2_s: float = 1.0
    time_3_s: float = 1.0
    friction: float = 0.0
    friction_width: float = 0.1
    friction_stops: float = 0.0
    mullins: float = 0.0
    mullins_scale: float = 0.1
    set_share: float = 0.0
    set_power: float = 2.0
    contact: float = 0.0
    contact_at: float = 0.3
    contact_width: float = 0.03
    contact_quadratic: float = 0.0
    thermal: float = 0.0
    thermal_curvature: float = 0.0
    wall: float = 1.0
    wall_linear: float = 2.6
    wall_quadratic: float = 1.8
    wall_gain: float = 0.3
    leak_1_s: float = 0.0
    leak_power: float = 1.0
    leak_filling_s: float = 0.15
    tendon: float = 0.0
    tendon_width: float = 0.01
    tendon_rest_rad: float = 0.1
    bimodulus: float = 0.0
    bimodulus_width: float = 0.06
    bimodulus_quadratic: float = 1.0
    # what no plugin has
    bump: float = 0.0
    bump_at: float = 0.6
    bump_width: float = 0.1
    ripple: float = 0.0
    ripple_period_s: float = 37.0
    ripple_phase: float = 0.0
    ageing: float = 0.0
    filling: float = 0.0
    warm_stick: float = 0.0
    drift_1_s: float = 0.0
    buckling: float = 0.0
    buckling_at: float = 0.5


@njit(cache=True)
def softplus(x: float) -> float:
    """log(1 + e^x) without overflow."""
    return x if x > 30.0 else math.log1p(math.exp(x))


@njit(cache=True)
def arriving(supply: Array, middle: float, end: float, valve: float, dt: float, f: Forms) -> float:
    """The pressure in the chamber after dt; `supply` (2,), both stages, is advanced.

    `middle` and `end` are the commanded pressure half way and at the end of the step. A closed valve keeps what there
    is, but for the leak. The first stage is filled through an orifice and vented through a smaller one, the second
    is a hose, linear and short.
    """
    if valve < 0.5:
        supply[0] = supply[1] = max(0.0, supply[1] - dt * outflow(supply[1], f))
        return supply[1]
    if f.lag_s <= 0.0:
        supply[0] = supply[1] = end
    else:
        time = f.lag_s * (f.lag_vent if middle < supply[0] else 1.0)
        supply[0] = middle + through_orifice(supply[0] - middle, dt, time, f.lag_linear * PRESSURE_MAX_PA)
        supply[1] = supply[0] + (supply[1] - supply[0]) * math.exp(-dt / (f.lag_second * f.lag_s))
    return supply[1] - f.leak_filling_s * outflow(supply[1], f)


@njit(cache=True)
def through_orifice(gap: float, dt: float, time: float, linear: float) -> float:
    """What is left after dt of a difference of pressures, Pa: the exact solution of

    d(gap)/dt = −sign(gap) √(|gap| p_s) / time,     below `linear` −gap √(p_s / linear) / time,

    turbulent through a hole and laminar where little flows. Without the laminar range p_s is gone after 2 time.
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
    """What a chamber loses, Pa/s."""
    if f.leak_1_s <= 0.0 or pressure <= 0.0:
        return 0.0
    return f.leak_1_s * PRESSURE_MAX_PA * (pressure / PRESSURE_MAX_PA) ** f.leak_power


@njit(cache=True)
def acting(pressure: float, f: Forms) -> float:
    """The pressure that acts, of the pressure in the tube."""
    p = pressure + f.offset_pa * (1.0 - f.offset_fading * pressure / PRESSURE_MAX_PA)
    if f.dead_pa > 0.0:
        w = f.dead_width * f.dead_pa
        p = w * (softplus((p - f.dead_pa) / w) - softplus(-f.dead_pa / w))
    return p


@njit(cache=True)
def relaxed(q: float, step: float, dt: float, time: float) -> float:
    """A Maxwell branch's stretch after a straight step: the exact solution of q' = u' − q/T."""
    x = dt / time
    return q * math.exp(-x) - step * math.expm1(-x) / x


@njit(cache=True)
def bouc_wen(z: float, step: float) -> float:
    """The hysteretic variable in [−1, 1] after a step of widths: dz/du = 1 − z² while loading, 1 while unloading."""
    way = 1.0 if step >= 0.0 else -1.0
    z, step = way * z, way * step
    if z < 0.0:
        along = min(step, -z)
        z, step = z + along, step - along
    if step > 0.0:
        z = math.tanh(math.atanh(min(z, 1.0 - 1e-12)) + step)
    return way * z


@njit(cache=True)
def rubbing(old: Array, new: Array, step: float, f: Forms) -> float:
    """Friction in shares of its limit; writes the elements' memory."""
    width = f.friction_width
    if f.friction_stops < 0.5:
        new[FRICTION] = bouc_wen(old[FRICTION], step / width)
        return new[FRICTION]
    total = 0.0
    for k in range(3):
        limit = width * (0.4, 1.0, 2.2)[k]
        new[FRICTION + k] = max(-limit, min(limit, old[FRICTION + k] + step))
        total += (0.4, 0.35, 0.25)[k] * new[FRICTION + k] / limit
    return total


@njit(cache=True)
def wraps(angles: Array, module: Array, f: Forms) -> Array:
    """(n,) how far the tendon has turned up to the middle of each joint."""
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
    """Effort of one joint at angle u, reached from u − step in dt; writes the memory `new` (N_MEMORY,) of `old`."""
    p, warm = acting(drive.pressure_pa, f), drive.temperature_c - ROOM_C
    share = p / PRESSURE_MAX_PA
    new[LARGEST], new[LEAST] = max(old[LARGEST], u), min(old[LEAST], u)
    top = max(new[LARGEST], -new[LEAST])

    v = u
    if f.set_share > 0.0:
        stretched = (new[LARGEST] / TYPICAL_ANGLE_RAD) ** f.set_power
        v -= f.set_share * TYPICAL_ANGLE_RAD * (stretched - (-new[LEAST] / TYPICAL_ANGLE_RAD) ** f.set_power)
    side = math.tanh(v / f.bimodulus_width)
    linear = B_E * v * (1.0 + f.stiffness) * (1.0 + f.bimodulus * side)
    quadratic = 0.5 * M_E * v * abs(v) * (1.0 + f.stiffness * f.stiffness_quadratic)
    quadratic *= 1.0 + f.bimodulus * f.bimodulus_quadratic * side
    if f.wall != 1.0:
        linear *= f.wall**f.wall_linear
        quadratic *= f.wall**f.wall_quadratic
    factor = 1.0 + f.elastic_error * math.sin(3.0 * u / TYPICAL_ANGLE_RAD + f.elastic_phase)
    factor *= 1.0 - f.thermal * warm * (1.0 - f.thermal_curvature * warm)
    factor *= 1.0 - f.mullins * (1.0 - math.exp(-(top - abs(u)) / f.mullins_scale))
    factor *= 1.0 + f.drift_1_s * drive.clock_s
    if f.buckling != 0.0:
        factor *= 1.0 - f.buckling / (1.0 + math.exp(-(share - f.buckling_at) / 0.03))
    moment = -factor * (linear + quadratic)

    gain = 1.0 + f.actuation_error * math.sin(4.0 * share + f.actuation_phase)
    gain *= 1.0 + f.gain * (1.0 - f.gain_fading * share)
    gain *= 1.0 + f.bump * math.exp(-(((share - f.bump_at) / f.bump_width) ** 2))
    gain *= 1.0 - f.ageing * drive.cycles
    gain *= 1.0 + f.filling * math.tanh(drive.pressure_rate / 150.0) * math.sin(math.pi * share)
    if f.wall != 1.0:
        gain *= f.wall ** (f.wall_gain * (1.0 - 0.5 * share))
    if f.tendon > 0.0:
        new[TENDON] = bouc_wen(old[TENDON], step / f.tendon_width)
        gain *= math.exp(-f.tendon * drive.wrap_rad * new[TENDON])
    moment += gain * p * (K_N + M_A * u)

    if f.viscous > 0.0:
        rate = step / dt
        moment -= f.viscous * rate * (rate * rate + 1e-8) ** (0.5 * (f.viscous_power - 1.0))
    if f.branch_1 > 0.0:
        new[MAXWELL] = relaxed(old[MAXWELL], step, dt, f.time_1_s)
        new[MAXWELL + 1] = relaxed(old[MAXWELL + 1], step, dt, f.time_2_s)
        new[MAXWELL + 2] = relaxed(old[MAXWELL + 2], step, dt, f.time_3_s)
        moment -= f.branch_1 * new[MAXWELL] + f.branch_2 * new[MAXWELL + 1] + f.branch_3 * new[MAXWELL + 2]
    friction = f.friction + f.warm_stick * max(warm, 0.0)
    if friction > ZERO:
        moment -= friction * rubbing(old, new, step, f)
    if f.contact > 0.0:
        depth = u - f.contact_at
        if f.contact_quadratic > 0.5:
            moment -= f.contact * max(depth, 0.0) ** 2 / f.contact_width
        else:
            moment -= f.contact * f.contact_width * softplus(depth / f.contact_width)
    if f.ripple != 0.0:
        moment += f.ripple * math.sin(2.0 * math.pi * drive.time_s / f.ripple_period_s + f.ripple_phase)
    return moment


@njit(cache=True)
def healed(memory: Array) -> None:
    """What heals in time has healed: relaxed branches; friction and damage stay, in place, (n, N_MEMORY)."""
    memory[:, MAXWELL:FRICTION] = 0.0


def virgin(modules: int) -> Array:
    """(n, N_MEMORY) memory of a new specimen."""
    return np.zeros((modules, N_MEMORY))


# Machine code of the truths holds forms and constants of other files, whose changes numba does not see.
discard_stale(Path(effort.stats.cache_path), tuple(Path(__file__).parent.glob("*.py")))
