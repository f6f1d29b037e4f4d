"""Runs and prescribed motions for checks of effects, and one joint followed in plain Python.

`follow_joint` is a slow, readable reference for an engine's `follow`: an engine that compiles law terms must agree
with it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from pliant.mechanics.efforts import JointEfforts
from pliant.mechanics.terms import TermMemory
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import REFERENCE_TEMPERATURE_C, History

PRESSURE = "pressure_pa"
# The first sample of a run is reached slowly from the straight shape, in this many steps.
RAMP_STEPS = 4
WIDEST_RAD = math.pi


@dataclass(frozen=True, eq=False)
class HeldMotion:
    """A prescribed motion of one joint: time (t,), angle (t,), actuation (t,), temperature (t,).

    The step to the first sample is slow: its duration is infinite.
    """

    time_s: Array
    angle_rad: Array
    actuation: Array
    temperature_c: Array

    @staticmethod
    def from_angles(
        time_s: Array, angle_rad: Array, actuation: float = 0.0, temperature_c: float | None = None
    ) -> HeldMotion:
        """Return a motion at constant actuation and temperature."""
        warmth = REFERENCE_TEMPERATURE_C if temperature_c is None else temperature_c
        n = len(angle_rad)
        return HeldMotion(np.asarray(time_s, float), angle_rad, np.full(n, actuation), np.full(n, warmth))


@dataclass(frozen=True, eq=False)
class Driven:
    """Response of a driven joint: effort (t,) in N·m, its slope ∂τ'/∂u (t,), memory (t, states)."""

    effort: Array
    slope: Array
    states: Array


def drive(chain: ChainModel, motion: HeldMotion) -> Driven:
    """Move the first joint of a one-axis chain with its law terms along a prescribed motion."""
    one = first_joint(chain)
    efforts = JointEfforts(one)
    memory = efforts.terms.rested()
    effort, slope, states = [], [], []
    for k, angle in enumerate(motion.angle_rad):
        dt = float(motion.time_s[k] - motion.time_s[k - 1]) if k else math.inf
        memory = replace(memory, dt_s=dt, temperature_c=float(motion.temperature_c[k]))
        q = np.array([[float(angle)]])
        inputs = {actuator.input: float(motion.actuation[k]) for actuator in one.actuators}
        answer = efforts.evaluate(q, inputs, memory)
        effort.append(answer.tau[0, 0])
        slope.append(answer.dtau_du[0, 0, 0])
        memory = efforts.advance(q, inputs, memory)
        states.append(memory.states[0, 0])
    return Driven(np.array(effort), np.array(slope), np.array(states))


def follow_joint(chain: ChainModel, histories: Sequence[History]) -> tuple[Array, ...]:
    """Return (t,) angle of one weightless joint under each history: τ'(p, u) = M at every sample, in plain Python.

    Histories of one specimen are consecutive: `LawTerm`s with permanent memory pass it on.
    """
    keeps = np.array([term.keeps for term in chain.terms for _ in range(term.n_states)], bool)
    kept: dict[str, Array] = {}
    paths = []
    for history in histories:
        efforts = JointEfforts(_carrying(chain, history))
        memory, angles = efforts.terms.rested(), []
        if history.specimen in kept:
            memory = replace(memory, states=np.where(keeps, kept[history.specimen], memory.states))
        for k in range(len(history)):
            times = history.time_s
            dt = math.inf if k == 0 or times is None else float(times[k] - times[k - 1])
            for share in np.arange(1, RAMP_STEPS + 1) / RAMP_STEPS if k == 0 else np.ones(1):
                memory = replace(memory, dt_s=dt, temperature_c=float(history.temperature_c[k]))
                inputs = {name: float(share * values[k]) for name, values in history.actuation.items()}
                angle = _balance(efforts, inputs, float(share * history.moment_n_m[k]), memory)
                memory = efforts.advance(np.array([[angle]]), inputs, memory)
            angles.append(float(memory.previous[0, 0]))
        kept[history.specimen] = memory.states
        paths.append(np.array(angles))
    return tuple(paths)


def _carrying(chain: ChainModel, history: History) -> ChainModel:
    """Return the chain with the law terms of the payload of a run."""
    more_kg = 0.0 if history.payload_kg is None else float(history.payload_kg[0]) - chain.payload_kg
    return chain.with_(terms=tuple(term.carrying(more_kg) for term in chain.terms))


def _balance(efforts: JointEfforts, inputs: dict[str, float], opposed: float, memory: TermMemory) -> float:
    """Return the angle closest to the present one at which the effort, which falls with it, is the opposing moment."""

    def unbalanced(angle: float) -> float:
        return float(efforts.evaluate(np.array([[angle]]), inputs, memory).tau[0, 0]) - opposed

    start, width = float(memory.previous[0, 0]), 0.01
    value = unbalanced(start)
    if value == 0.0:
        return start
    while width < WIDEST_RAD:
        end = start + math.copysign(width, value)
        if unbalanced(end) * value <= 0.0:
            return float(brentq(unbalanced, min(start, end), max(start, end), xtol=1e-13, rtol=1e-14))
        width *= 2.0
    raise ValueError(f"no equilibrium within {WIDEST_RAD:.3g} rad of {start:.3g} rad")


def first_joint(chain: ChainModel) -> ChainModel:
    """Return the chain cut after its first joint, with that joint's parameters of its law terms."""
    terms = tuple(
        replace(t, per_joint=t.per_joint[:1], per_payload_kg=t.per_payload_kg[:1]) for t in chain.terms
    )
    return chain.with_(
        joints=chain.joints[:1],
        bodies=chain.bodies[:2],
        shapes=chain.shapes[:2],
        rings=(),
        centre_line=(),
        terms=terms,
    )


def triangles(
    levels: Sequence[float], rate: float, step_s: float, holds_s: float = 0.0
) -> tuple[Array, Array]:
    """Return (time, value) of linear ramps from 0 through the levels at one rate, with a pause at each."""
    values, here = [0.0], 0.0
    for level in levels:
        n = max(1, math.ceil(abs(level - here) / (rate * step_s) - 1e-9))
        values += np.linspace(here, level, n + 1)[1:].tolist()
        values += [level] * round(holds_s / step_s)
        here = level
    times: Array = step_s * np.arange(len(values), dtype=float)
    return times, np.array(values, float)
