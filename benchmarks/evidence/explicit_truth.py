"""Truth engine 3: one joint with its own inertia, by explicit steps of 1 ms (velocity Verlet, Verlet 1967).

    I ü = effort(u) − c(u̇) u̇ − M + Q(u)

Half a kick, a drift, half a kick; the effort's memory goes along once per step. What heals in time is forgotten after
the joint has been laid slowly where the first sample has it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from benchmarks.evidence.forms import Drive, Forms, effort, healed, viscous_torque, with_wrap, wraps
from benchmarks.evidence.functional_truth import (
    Bones,
    Inputs,
    compile_bones,
    cycle_increment,
    driven,
    followed,
    ramped,
    resting,
    weights,
)
from benchmarks.evidence.protocols import Protocol
from benchmarks.evidence.robots import Array, Robot
from benchmarks.evidence.skeleton import skeleton
from numba import njit

STEP_S = 0.001
RAMP_S, SETTLE_S = 4.0, 2.0


@njit(cache=True)
def _advance(
    state: Array,
    dt: float,
    drive: Drive,
    weight: float,
    gravity: Array,
    bones: Bones,
    memory: Array,
    new: Array,
    f: Forms,
    viscous: Forms,
) -> None:
    """Advance `state` by a step: angle, velocity, and its rate without the damping, which is implicit."""
    moments, slopes, at = np.empty(1), np.empty((1, 1)), np.empty(1)
    damping = bones.damping + viscous_torque(state[1], viscous)
    state[1] = (state[1] + 0.5 * dt * state[2]) / (1.0 + 0.5 * dt * damping / bones.inertia[0])
    step = dt * state[1]
    state[0] += step
    at[0] = state[0]
    weights(at, bones, gravity, moments, slopes)
    seen = with_wrap(drive, wraps(at, bones.module, f)[0])
    total = effort(state[0], step, dt, seen, memory[0], new[0], f)
    total += weight * moments[0] - drive.moment_n_m * bones.load_share[0]
    memory[0, :] = new[0]
    state[2] = total / bones.inertia[0]
    state[1] = (state[1] + 0.5 * dt * state[2]) / (1.0 + 0.5 * dt * damping / bones.inertia[0])


@njit(cache=True)
def _follow(
    inputs: Inputs, bones: Bones, memory: Array, cycles: float, f: Forms, viscous: Forms
) -> tuple[Array, float]:
    """Simulate one run from rest: (t, 1) angles and the specimen's number of cycles after it."""
    count = len(inputs.pressure)
    new, state = memory.copy(), np.zeros(3)
    ramp = round(RAMP_S / STEP_S)
    for k in range(ramp + round(SETTLE_S / STEP_S)):
        share = min(1.0, (k + 1) / ramp)
        drive = ramped(inputs, share, cycles)
        _advance(state, STEP_S, drive, share, inputs.gravity, bones, memory, new, f, viscous)
        if k >= ramp:  # it stops immediately, without ringing into the run
            state[1] *= 0.99
    healed(memory)
    supply = resting(inputs)
    angles = np.empty((count, 1))
    angles[0, 0] = state[0]
    for i in range(1, count):
        span = inputs.time[i] - inputs.time[i - 1]
        parts = max(1, round(span / STEP_S))
        dt = span / parts
        for k in range(1, parts + 1):
            cycles += cycle_increment(inputs, i, parts)
            drive = driven(inputs, i, k / parts, 0.0, dt, supply, cycles, f)
            _advance(state, dt, drive, 1.0, inputs.gravity, bones, memory, new, f, viscous)
        angles[i, 0] = state[0]
    return angles, cycles


def follow(robot: Robot, protocol: Protocol, truth: Any) -> list[Array]:
    """Return (t, 1) joint angles of every run, in order.

    Raises:
        ValueError: a chain; its modes are too fast for explicit steps.
        RuntimeError: the motion is not finite.
    """
    bones = {
        kg: compile_bones(skeleton(robot, truth.body, kg), truth.body, swings=True)
        for kg in {run.payload_kg for run in protocol}
    }
    if robot.modules != 1:
        raise ValueError(f"the explicit engine follows one joint, and '{robot.name}' has {robot.modules}")

    dry = truth.forms._replace(viscous=0.0)

    def simulate_run(inputs: Inputs, memory: Array, cycles: float) -> tuple[Array, float, bool]:
        return *_follow(inputs, bones[inputs.payload], memory, cycles, dry, truth.forms), True

    return followed(protocol, truth, 1, simulate_run)
