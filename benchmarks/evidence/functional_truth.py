"""Truth engine 1: a massless chain of hinges that creeps through equilibria, five or more to a sample.

The candidates' engine takes one backward Euler step per sample; here the inputs are followed in sub-steps and
relaxation is integrated exactly. Hinges may stand any way in space: with first moments s_j = Σ_{i≥j} m_i (c_i − o_j) of
what hangs on hinge j (axis a_j, place o_j), gravity g makes the moment and its slope

    Q_j = a_j · (s_j × g),      ∂Q_j/∂u_k = a_j · ((a_k × s_k) × g)   for k ≥ j, symmetric

Where a truth has inertia, u̇ and ü follow Newmark's rule (average acceleration) at finer sub-steps.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from benchmarks.evidence.forms import (
    DEAD_TIME,
    TYPICAL_ANGLE_RAD,
    Drive,
    Forms,
    arriving,
    effort,
    healed,
    virgin,
    with_wrap,
    wraps,
)
from benchmarks.evidence.protocols import Protocol, Run
from benchmarks.evidence.robots import B_E, PRESSURE_MAX_PA, Array, Robot
from benchmarks.evidence.skeleton import Skeleton, gravity_on, skeleton
from numba import njit

# Sub-steps of creep, of lags or damping within a tenth of a second, and of swings.
LONGEST_S, LONGEST_QUICK_S, LONGEST_DYNAMIC_S = 0.08, 0.02, 0.01
# Runs start from straight along a slow ramp of all loads.
RAMP_STEPS, RAMP_S = 40, 40.0
SLOPE_STEP_RAD = 1e-6
LEAST_STIFFNESS = 1e-3
LARGEST_MOVE_RAD, TOLERANCE_RAD, ITERATIONS = 0.1, 1e-9, 100
# Newton may hop across kinks: from this iteration on it takes shorter moves.
PATIENCE, SHORTER = 20, 0.3
# Of a hinge in air, as in the other engines; it ends what inertia begins.
AIR_DAMPING = 5e-5


class Bones(NamedTuple):
    """A skeleton in numbers; `inertia` (n,) about each hinge, 0 where nothing is to swing."""

    axes: Array
    offsets: Array
    masses: Array
    centres: Array
    module: Array
    springs: Array
    load_share: Array
    inertia: Array
    damping: float


class Inputs(NamedTuple):
    """One run's inputs, (t,) each, and its conditions."""

    time: Array
    pressure: Array
    load: Array
    valve: Array
    gravity: Array
    temperature: float
    clock: float
    payload: float


def compile_bones(found: Skeleton, body: Any, swings: bool) -> Bones:
    """Return the skeleton for compiled code."""
    share = found.axes @ np.array([0.0, -1.0, 0.0])
    about = found.inertias_kg_m2 + found.masses_kg * np.sum(found.centres_m**2, axis=1)
    inertia = about if swings else np.zeros(len(share))
    linear = (found.axes, found.offsets_m, found.masses_kg, found.centres_m)
    return Bones(*linear, found.module, found.spring_n_m, share, inertia, AIR_DAMPING + body.drag)


def run_inputs(run: Run, body: Any, clock_s: float) -> Inputs:
    """Return the run's inputs; `clock_s` is the time at its start."""
    gravity = gravity_on(run.base_angles_rad, body)
    course = (run.time_s, run.pressure_pa, run.moment_n_m, run.valve)
    return Inputs(*course, gravity, run.temperature_c, clock_s, run.payload_kg)


@njit(cache=True)
def ramped(inputs: Inputs, share: float, cycles: float) -> Drive:
    """Return a share of the run's first inputs: of the ramp on which a run starts from straight."""
    pressure, load = share * inputs.pressure[0], share * inputs.load[0]
    return Drive(pressure, 0.0, inputs.temperature, load, 0.0, inputs.clock, cycles, 0.0)


@njit(cache=True)
def resting(inputs: Inputs) -> Array:
    """Return a (3,) supply in balance with the run's first pressure."""
    return np.array([inputs.pressure[0], inputs.pressure[0], 0.0])


@njit(cache=True)
def commanded(inputs: Inputs, i: int, time: float) -> float:
    """Return the pressure that was commanded at a time up to that of sample i."""
    while i > 1 and time < inputs.time[i - 1]:
        i -= 1
    span = inputs.time[i] - inputs.time[i - 1]
    share = max(0.0, (time - inputs.time[i - 1]) / span)
    return inputs.pressure[i - 1] + share * (inputs.pressure[i] - inputs.pressure[i - 1])


@njit(cache=True)
def driven(
    inputs: Inputs, i: int, share: float, lead: float, dt: float, supply: Array, cycles: float, f: Forms
) -> Drive:
    """Return the drive after a share of the way from sample i − 1 to i; the chamber is filled from `lead` before it."""
    rise = inputs.pressure[i] - inputs.pressure[i - 1]
    before, span = inputs.time[i - 1], inputs.time[i] - inputs.time[i - 1]
    dead = f.lag_second * f.lag_s if f.lag_shape == DEAD_TIME else 0.0
    middle = commanded(inputs, i, before + (share - lead) * span - dead)
    end = commanded(inputs, i, before + share * span - dead)
    chamber = arriving(supply, middle, end, inputs.valve[i], dt, f)
    moment = inputs.load[i - 1] + share * (inputs.load[i] - inputs.load[i - 1])
    time = before + share * span
    return Drive(chamber, rise / span, inputs.temperature, moment, time, inputs.clock + time, cycles, 0.0)


@njit(cache=True)
def cycle_increment(inputs: Inputs, i: int, parts: int) -> float:
    """Return cycles of the largest pressure that are done in each part of the way to sample i."""
    return abs(inputs.pressure[i] - inputs.pressure[i - 1]) / parts / (2.0 * PRESSURE_MAX_PA)


@njit(cache=True)
def _cross(a: Array, b: Array, out: Array) -> None:
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@njit(cache=True)
def _along(rotation: Array, r: int, vectors: Array, j: int) -> float:
    """Return component r of the turned vector j."""
    turned = rotation[r, 0] * vectors[j, 0]
    return turned + rotation[r, 1] * vectors[j, 1] + rotation[r, 2] * vectors[j, 2]


@njit(cache=True)
def weights(u: Array, bones: Bones, gravity: Array, moments: Array, slopes: Array) -> None:
    """Fill moments (n,) of the weights about each hinge, and their derivatives (n, n)."""
    n = len(u)
    rotation, place, before = np.eye(3), np.zeros(3), np.zeros(3)
    axes, first = np.empty((n, 3)), np.empty((n, 3))
    centres, places = np.empty((n, 3)), np.empty((n, 3))
    turned = np.empty(3)
    for j in range(n):
        for r in range(3):
            place[r] += _along(rotation, r, bones.offsets, j)
            places[j, r] = place[r]
            axes[j, r] = _along(rotation, r, bones.axes, j)
        s, c = np.sin(u[j]), 1.0 - np.cos(u[j])
        # Rodrigues about the axis in space: every column of the rotation is turned.
        for k in range(3):
            before[:] = rotation[:, k]
            along = axes[j, 0] * before[0] + axes[j, 1] * before[1] + axes[j, 2] * before[2]
            _cross(axes[j], before, turned)
            for r in range(3):
                rotation[r, k] = before[r] + s * turned[r] + c * (axes[j, r] * along - before[r])
        for r in range(3):
            centres[j, r] = place[r]
            for k in range(3):
                centres[j, r] += rotation[r, k] * bones.centres[j, k]
    mass, sums = 0.0, np.zeros(3)
    for j in range(n - 1, -1, -1):
        mass += bones.masses[j]
        for r in range(3):
            sums[r] += bones.masses[j] * centres[j, r]
            first[j, r] = sums[r] - mass * places[j, r]
    push = np.empty(3)
    for k in range(n):
        _cross(first[k], gravity, push)
        moments[k] = axes[k, 0] * push[0] + axes[k, 1] * push[1] + axes[k, 2] * push[2]
        _cross(axes[k], first[k], turned)
        _cross(turned, gravity, push)
        for j in range(k + 1):
            value = axes[j, 0] * push[0] + axes[j, 1] * push[1] + axes[j, 2] * push[2]
            slopes[j, k] = slopes[k, j] = value


@njit(cache=True)
def own(
    j: int, u: float, step: float, dt: float, drive: Drive, old: Array, new: Array, bones: Bones, f: Forms
) -> float:
    """Return the effort of hinge j alone: a module's joint, or the spring of a connection."""
    if bones.module[j] < 0:
        return -(bones.springs[j, 0] + bones.springs[j, 1] * u * u) * u
    held = 0.0
    if bones.module[j] == 0:
        held = f.end_base
    if j == len(bones.module) - 1:
        held = f.end_cap
    if held == 0.0:
        return effort(u, step, dt, drive, old, new, f)
    if f.end_giving <= 0.0:  # a spring parallel to the joint
        spring = 1.0 + f.end_cubic * (u / TYPICAL_ANGLE_RAD) ** 2
        return effort(u, step, dt, drive, old, new, f) - held * B_E * spring * u
    # A share of the module does not bend, and less of it the further it is bent.
    free = 1.0 - held / (1.0 + f.end_giving * abs(u) / TYPICAL_ANGLE_RAD)
    return effort(u / free, step / free, dt, drive, old, new, f)


@njit(cache=True)
def _solve(
    u: Array,
    before: Array,
    rates: Array,
    dt: float,
    drive: Drive,
    weight: float,
    gravity: Array,
    bones: Bones,
    memory: Array,
    new: Array,
    f: Forms,
) -> bool:
    """Solve for equilibrium at the end of a sub-step by Newton from the guess u; return whether it converged.

    `rates` (2, n) are velocity and acceleration at its start.
    """
    n = len(u)
    moments, residual = np.empty(n), np.empty(n)
    slopes, matrix = np.empty((n, n)), np.empty((n, n))
    wrap = wraps(before, bones.module, f)
    for iteration in range(ITERATIONS):
        weights(u, bones, gravity, moments, slopes)
        for j in range(n):
            at = with_wrap(drive, wrap[j])
            y = u[j]
            value = own(j, y, y - before[j], dt, at, memory[j], new[j], bones, f)
            residual[j] = value - drive.moment_n_m * bones.load_share[j] + weight * moments[j]
            # Friction has a kink where a joint turns back: there the slope is that of the side it is driven to.
            way = -1.0 if y == before[j] and residual[j] < 0.0 else 1.0
            z = y + way * SLOPE_STEP_RAD
            slope = (
                way * (own(j, z, z - before[j], dt, at, memory[j], new[j], bones, f) - value) / SLOPE_STEP_RAD
            )
            for k in range(n):
                matrix[j, k] = -weight * slopes[j, k]
            matrix[j, j] += max(-slope, LEAST_STIFFNESS)
            if bones.inertia[j] > 0.0:
                swing = 4.0 / dt * ((y - before[j]) / dt - rates[0, j]) - rates[1, j]
                residual[j] -= bones.inertia[j] * swing
                residual[j] -= bones.damping * (2.0 * (y - before[j]) / dt - rates[0, j])
                matrix[j, j] += 4.0 * bones.inertia[j] / dt**2 + 2.0 * bones.damping / dt
        move = np.linalg.solve(matrix, residual)
        largest = np.abs(move).max()
        share = 1.0 if iteration < PATIENCE else SHORTER
        move *= min(share, LARGEST_MOVE_RAD / max(largest, 1e-30))
        for j in range(n):
            turned = (u[j] - before[j]) * (u[j] + move[j] - before[j]) < 0.0
            u[j] = before[j] if turned else u[j] + move[j]
        if largest < TOLERANCE_RAD:
            break
    for j in range(n):
        at = with_wrap(drive, wrap[j])
        own(j, u[j], u[j] - before[j], dt, at, memory[j], new[j], bones, f)
        swing = 4.0 / dt * ((u[j] - before[j]) / dt - rates[0, j]) - rates[1, j]
        rates[0, j], rates[1, j] = 2.0 * (u[j] - before[j]) / dt - rates[0, j], swing
    return largest < TOLERANCE_RAD


@njit(cache=True)
def _follow(
    inputs: Inputs, bones: Bones, memory: Array, cycles: float, longest: float, f: Forms
) -> tuple[Array, float, bool]:
    """Simulate one run from rest: (t, n) angles, cycles after it, and whether every state converged."""
    n, count = len(memory), len(inputs.pressure)
    u, before, new = np.zeros(n), np.zeros(n), memory.copy()
    rates = np.zeros((2, n))
    supply = resting(inputs)
    well = True
    for k in range(RAMP_STEPS):
        share = (k + 1) / RAMP_STEPS
        drive = ramped(inputs, share, cycles)
        rates[:] = 0.0
        step = RAMP_S / RAMP_STEPS
        well &= _solve(u, before, rates, step, drive, share, inputs.gravity, bones, memory, new, f)
        before[:], memory[:] = u, new
    rates[:] = 0.0
    healed(memory)
    angles = np.empty((count, n))
    angles[0] = u
    for i in range(1, count):
        span = inputs.time[i] - inputs.time[i - 1]
        parts = max(1, int(np.ceil(span / longest - 1e-9)))
        dt = span / parts
        for k in range(1, parts + 1):
            cycles += cycle_increment(inputs, i, parts)
            drive = driven(inputs, i, k / parts, 0.5 / parts, dt, supply, cycles, f)
            guess = 2.0 * u - before
            before[:], u[:] = u, guess
            well &= _solve(u, before, rates, dt, drive, 1.0, inputs.gravity, bones, memory, new, f)
            memory[:] = new
        angles[i] = u
    return angles, cycles, well


def followed(
    protocol: Protocol, truth: Any, hinges: int, run_of: Callable[..., tuple[Array, float, bool]]
) -> list[Array]:
    """Return (t, n) hinge angles of every run, in order; specimens keep permanent changes.

    Args:
        run_of: of a run's inputs, the specimen's memory (advanced in place) and its cycles: the angles, the cycles
            done after it, and whether all went well.

    Raises:
        RuntimeError: a run did not go well.
    """
    memories: dict[str, tuple[Array, float]] = {}
    angles, clock = [], 0.0
    for run in protocol:
        memory, cycles = memories.get(run.specimen, (virgin(hinges), 0.0))
        found, cycles, well = run_of(run_inputs(run, truth.body, clock), memory, cycles)
        if not well or not np.isfinite(found).all():
            raise RuntimeError(f"run '{run.condition}' of the truth did not converge")
        memories[run.specimen] = (memory, cycles)
        angles.append(found)
        clock += run.seconds
    return angles


def follow(robot: Robot, protocol: Protocol, truth: Any) -> list[Array]:
    """Return (t, n) hinge angles of every run, in order. Raises `RuntimeError` if a state did not converge."""
    swings = truth.body.crossbar_kg_m2 > 0.0
    bones = {
        kg: compile_bones(skeleton(robot, truth.body, kg), truth.body, swings)
        for kg in {run.payload_kg for run in protocol}
    }
    quick = truth.forms.viscous > 0.0 or truth.forms.lag_s > 0.0
    longest = LONGEST_DYNAMIC_S if swings else LONGEST_QUICK_S if quick else LONGEST_S

    def simulate_run(inputs: Inputs, memory: Array, cycles: float) -> tuple[Array, float, bool]:
        return _follow(inputs, bones[inputs.payload], memory, cycles, longest, truth.forms)

    return followed(protocol, truth, len(next(iter(bones.values())).masses), simulate_run)
