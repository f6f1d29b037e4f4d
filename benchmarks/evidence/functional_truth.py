"""Truth engine 1: a massless planar chain that creeps through equilibria, five to a sample.

The candidates' engine takes one backward Euler step per sample; here the inputs are followed in sub-steps, relaxation
is integrated exactly and the statics is written in absolute angles: with ψ_i = Σ_{j≤i} u_j − φ,

    V = −g Σ_i (S_i cos ψ_i − B_i sin ψ_i),   r_j = effort_j(u_j) − M − Σ_{i≥j} g (S_i sin ψ_i + B_i cos ψ_i)

where S_i = (own first moment + length × all mass beyond) of piece i and B_i the same to its side.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from benchmarks.evidence.forms import Drive, Forms, effort, healed, lagged, virgin
from benchmarks.evidence.protocols import SAMPLE_S, Protocol, Run
from benchmarks.evidence.robots import GRAVITY_M_S2, PRESSURE_MAX_PA, Array, Robot
from numba import njit

SUB_STEPS = 5
# Runs start from straight along a slow ramp of all loads.
RAMP_STEPS, RAMP_S = 40, 40.0
SLOPE_STEP_RAD = 1e-6
LEAST_STIFFNESS = 1e-3
LARGEST_MOVE_RAD, TOLERANCE_RAD, ITERATIONS = 0.1, 1e-9, 100
# Newton may hop across kinks: from this iteration on it takes shorter moves.
PATIENCE, SHORTER = 20, 0.3


def first_moments(robot: Robot, fitting_kg: float, arm_share: float, side_m: float) -> tuple[Array, Array]:
    """(S, B), kg·m, of pieces that each carry a fitting at a share of their length and `side_m` off the axis."""
    lengths = robot.piece_lengths_m
    masses = robot.piece_masses_kg + fitting_kg
    beyond = np.concatenate([np.cumsum(masses[::-1])[::-1][1:], [0.0]])
    own = lengths * (robot.piece_masses_kg / 2 + fitting_kg * arm_share)
    return own + lengths * beyond, np.full(robot.modules, fitting_kg * side_m)


@njit
def _weights(u: Array, pitch: float, along: Array, aside: Array, moments: Array, slopes: Array) -> None:
    """Moments of the weights about each joint and their Hessian's running sums, both summed from the tip."""
    psi, n = -pitch, len(u)
    for i in range(n):
        psi += u[i]
        moments[i] = GRAVITY_M_S2 * (along[i] * np.sin(psi) + aside[i] * np.cos(psi))
        slopes[i] = GRAVITY_M_S2 * (along[i] * np.cos(psi) - aside[i] * np.sin(psi))
    for i in range(n - 2, -1, -1):
        moments[i] += moments[i + 1]
        slopes[i] += slopes[i + 1]


@njit
def _solve(
    u: Array,
    before: Array,
    dt: float,
    drive: Drive,
    pitch: float,
    weight: float,
    along: Array,
    aside: Array,
    memory: Array,
    new: Array,
    f: Forms,
) -> bool:
    """Newton to the equilibrium at the end of one sub-step; u starts as the guess. True where it converged."""
    n = len(u)
    moments, slopes, residual = np.empty(n), np.empty(n), np.empty(n)
    matrix = np.empty((n, n))
    for iteration in range(ITERATIONS):
        _weights(u, pitch, along, aside, moments, slopes)
        for j in range(n):
            y, old, fresh = u[j], memory[j], new[j]
            value = effort(y, y - before[j], dt, drive, old, fresh, f)
            residual[j] = value - drive.moment_n_m - weight * moments[j]
            # Friction has a kink where a joint turns back: there the slope is that of the side it is driven to.
            way = -1.0 if y == before[j] and residual[j] < 0.0 else 1.0
            z = y + way * SLOPE_STEP_RAD
            slope = way * (effort(z, z - before[j], dt, drive, old, fresh, f) - value) / SLOPE_STEP_RAD
            for k in range(n):
                matrix[j, k] = weight * slopes[max(j, k)]
            matrix[j, j] += max(-slope, LEAST_STIFFNESS)
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
        effort(u[j], u[j] - before[j], dt, drive, memory[j], new[j], f)
    return largest < TOLERANCE_RAD


@njit
def _follow(
    pressure: Array,
    load: Array,
    temperature: float,
    pitch: float,
    along: Array,
    aside: Array,
    memory: Array,
    cycles: float,
    f: Forms,
) -> tuple[Array, float, bool]:
    """One run from rest: (t, n) angles, cycles done after it, and whether every state converged."""
    n, count = len(memory), len(pressure)
    u, before, new = np.zeros(n), np.zeros(n), memory.copy()
    supply = np.full(2, pressure[0])
    well = True
    for k in range(RAMP_STEPS):
        share = (k + 1) / RAMP_STEPS
        drive = Drive(share * pressure[0], 0.0, temperature, share * load[0], 0.0, cycles)
        well &= _solve(u, before, RAMP_S / RAMP_STEPS, drive, pitch, share, along, aside, memory, new, f)
        before[:], memory[:] = u, new
    healed(memory)
    angles = np.empty((count, n))
    angles[0] = u
    dt = SAMPLE_S / SUB_STEPS
    for i in range(1, count):
        rate = (pressure[i] - pressure[i - 1]) / SAMPLE_S
        for k in range(1, SUB_STEPS + 1):
            share = k / SUB_STEPS
            supplied = pressure[i - 1] + (share - 0.5 / SUB_STEPS) * rate * SAMPLE_S
            tube = lagged(supply, supplied, dt, f)
            if f.lag_s <= 0.0:
                tube = pressure[i - 1] + share * rate * SAMPLE_S
            cycles += abs(rate) * dt / (2.0 * PRESSURE_MAX_PA)
            moment = load[i - 1] + share * (load[i] - load[i - 1])
            time = (i - 1 + share) * SAMPLE_S
            drive = Drive(tube, rate, temperature, moment, time, cycles)
            guess = 2.0 * u - before
            before[:], u[:] = u, guess
            well &= _solve(u, before, dt, drive, pitch, 1.0, along, aside, memory, new, f)
            memory[:] = new
        angles[i] = u
    return angles, cycles, well


def follow(robot: Robot, protocol: Protocol, truth: Any) -> list[Array]:
    """(t, n) joint angles of every run, in order; specimens keep what does not heal.

    Raises:
        RuntimeError: a state did not converge.
    """
    body = truth.body
    along, aside = first_moments(robot, body.fitting_kg, body.fitting_share, body.fitting_side_m)
    memories: dict[str, tuple[Array, float]] = {}
    angles = []
    for run in protocol:
        memory, cycles = memories.get(run.specimen, (virgin(robot.modules), 0.0))
        followed, cycles, well = _follow(*_inputs(run), along, aside, memory, cycles, truth.forms)
        if not well:
            raise RuntimeError(f"functional truth: run '{run.condition}' did not converge")
        memories[run.specimen] = (memory, cycles)
        angles.append(followed)
    return angles


def _inputs(run: Run) -> tuple[Array, Array, float, float]:
    return run.pressure_pa, run.moment_n_m, run.temperature_c, run.base_pitch_rad
