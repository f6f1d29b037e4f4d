"""The runs of a recording: slow and fast cycles, steps, several frequencies at once, small cycles, inputs in turn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from benchmarks.systems.robots import Robot
from benchmarks.systems.shapes import Array

QUIET_S, RAMP_S = 0.4, 0.4
RUNS = ("slow_1", "slow_2", "fast", "steps", "many_1", "many_2", "small", "in_turn")


@dataclass(frozen=True, eq=False)
class Run:
    """A run: its samples (t,) and its commands (t, inputs) there, straight lines between them."""

    name: str
    time_s: Array
    commands: Array


def protocol(robot: Robot, rng: np.random.Generator) -> tuple[Run, ...]:
    """Return the runs; slow cycles and those of many frequencies come twice."""
    clock = np.arange(round(robot.duration_s * robot.sampled_hz) + 1) / robot.sampled_hz
    n = len(robot.inputs)
    shapes = {
        "slow": _cycles(clock, robot.lowest_hz * rng.uniform(0.8, 1.25, n), rng),
        "fast": 0.8 * _cycles(clock, robot.lowest_hz * rng.uniform(4.0, 7.0, n), rng),
        "steps": _steps(clock, n, rng),
        "many": sum(0.35 * _cycles(clock, robot.lowest_hz * m * rng.uniform(0.8, 1.2, n), rng) for m in (1, 2, 4, 8)),
        "small": 0.25 * _cycles(clock, 2.0 * robot.lowest_hz * rng.uniform(0.8, 1.25, n), rng),
        "in_turn": _in_turn(clock, n, robot.duration_s),
    }  # fmt: skip
    centre, size = (np.array([one[k] for one in robot.inputs.values()]) for k in (1, 2))
    rise = np.clip((clock - QUIET_S) / RAMP_S, 0.0, 1.0)[:, None]
    return tuple(Run(name, clock, centre + size * rise * shapes[name.rstrip("_12")]) for name in RUNS)


def _cycles(clock: Array, hz: Array, rng: np.random.Generator) -> Array:
    """Return (t, n) cosines, so that what integrates them swings about its start, of either sign."""
    phase = rng.uniform(-0.3, 0.3, len(hz)) + np.pi * rng.integers(0, 2, len(hz))
    return np.asarray(np.cos(2.0 * np.pi * hz * clock[:, None] + phase))


def _steps(clock: Array, n: int, rng: np.random.Generator) -> Array:
    """Return levels that are held, each followed by its opposite, at other times for every input."""
    found = np.zeros((len(clock), n))
    for k in range(n):
        at, hold = QUIET_S + rng.uniform(0.0, 0.5), rng.uniform(0.6, 1.0)
        while at < clock[-1]:
            level = rng.uniform(0.3, 1.0) * (-1.0) ** rng.integers(0, 2)
            for sign in (1.0, -1.0, 0.0):
                found[(clock >= at) & (clock < at + hold), k] = sign * level
                at += hold
    return found


def _in_turn(clock: Array, n: int, duration_s: float) -> Array:
    """Return one cycle of each input alone."""
    long = (duration_s - QUIET_S) / n
    share = (clock[:, None] - QUIET_S) / long - np.arange(n)
    return np.where((share >= 0.0) & (share < 1.0), np.sin(4.0 * np.pi * share), 0.0)
