"""Blocked joint: its coordinate is prescribed, and its reaction effort is measured.

    u(t) given,   M(t) = τ'(p(t), u(t), history)

τ' is the law's effort with all law terms (`JointEfforts`), whose memory advances along the prescribed path; no
equilibrium is solved. This describes a tensile tester or a fixture that blocks an actuator. As in every history, a run
starts at rest, its first sample is reached slowly, and permanent memory continues from earlier runs of the specimen.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np

from pliant.errors import UserError
from pliant.mechanics.terms import Contribution
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.term import LawTerm

# Prescribed coordinate → measured effort, by joint type.
HELD = {"prismatic": "held_elongation_strain", "revolute": "held_angle_rad"}
BLOCKED = {"prismatic": "blocked_force_n", "revolute": "blocked_moment_n_m"}


def is_held(history: History) -> bool:
    """Return whether the joint's coordinate is prescribed in this run."""
    return any(name in history.actuation for name in HELD.values())


def prescribed_motion(chain: ChainModel, histories: Sequence[History]) -> list[Array]:
    """Return (t,) the coordinate of the single joint in each run, rad or m.

    Raises:
        UserError: a chain of several joints or axes, a run without a prescribed coordinate, or another joint type.
    """
    joint = chain.laws[0].joint
    if chain.n_joints != 1 or joint not in HELD:
        raise UserError(
            f"held_angle_rad and held_elongation_strain hold one joint, and this chain has {chain.n_joints} "
            f"{joint} joints: give it 'modules: 1' with a hinge or a slide."
        )
    name, scale = HELD[joint], chain.length_m if joint == "prismatic" else 1.0
    free = [history.run for history in histories if name not in history.actuation]
    if free:
        raise UserError(
            f"run '{free[0]}' has no {name}: the {joint} joint is held in all runs of a file, or in none."
        )
    return [scale * history.actuation[name] for history in histories]


def without_held(chain: ChainModel, history: History) -> History:
    """Return the run with the chain's inputs only; inputs that are not recorded are 0."""
    given = {name: values for name, values in history.actuation.items() if name not in HELD.values()}
    idle = {a.input: np.zeros(len(history)) for a in chain.actuators if a.input not in given}
    return replace(history, actuation={**given, **idle})


def blocked_efforts(chain: ChainModel, histories: Sequence[History], paths: Sequence[Array]) -> list[Array]:
    """Return (t,) τ of the single joint of a chain along prescribed coordinates (t,), N·m or N.

    Args:
        chain: with its law terms.
        histories: inputs and conditions of the chain, runs of a specimen in chronological order.
        paths: see `prescribed_motion`.
    """
    damage: dict[tuple[str, int], list[float]] = {}
    found = []
    for history, path in zip(histories, paths, strict=True):
        zeros, ones = np.zeros((2, len(path))), np.ones((2, len(path)))
        parts = Contribution(zeros[0], ones[0], ones[1], zeros[1])
        for number, term in enumerate(chain.terms):
            kept = damage.get((history.specimen, number)) if term.keeps else None
            values, damage[history.specimen, number] = _along(
                term, chain, history, path, kept or [0.0] * term.n_states
            )
            whole = getattr(parts, term.role)
            whole[:] = whole + values if term.role in ("moment", "rest") else whole * values
        found.append(_combined(chain, history.actuation, path, parts))
    return found


def _along(
    term: LawTerm, chain: ChainModel, history: History, path: Array, old: list[float]
) -> tuple[Array, list[float]]:
    """Return a term's values (t,), and its memory at the end; plain lists, since testers sample at a high rate."""
    net = np.sum([a.sign * history.actuation[a.input] for a in chain.actuators], axis=0)
    steps = np.full(len(path), math.inf)
    if history.time_s is not None:
        steps[1:] = np.diff(history.time_s)
    rates = np.diff(path, prepend=path[:1]) / steps
    numbers, function, values = term.numbers(0), term.function, []
    columns = (path, rates, steps, net, history.temperature_c)
    samples = zip(*(column.tolist() for column in columns), strict=True)
    for u, rate, step, pushed, warmth in samples:
        new: Any = old.copy()
        values.append(function(u, rate, step, pushed, warmth, cast(Any, old), new, cast(Any, numbers)))
        old = new
    return np.array(values), old


def _combined(chain: ChainModel, actuation: Mapping[str, Array], path: Array, parts: Contribution) -> Array:
    """Return τ' (t,) = Π f_elastic · E(u − Σ rest) + Π f_actuation · A(p, u) + Σ moment, see `LawTerm`."""
    law = chain.laws[chain.joints[0].law]
    total = np.array(parts.moment)
    none = np.zeros(len(path))
    for actuator in chain.actuators:
        s = actuator.sign

        def tau(pressure: Array, u: Array, s: float = s) -> Array:
            return s * law.evaluate(pressure, s * u[:, None]).tau[:, 0]

        straight = tau(none, path)
        total += parts.elastic * (tau(none, path - parts.rest) if parts.rest.any() else straight)
        if actuation[actuator.input].any():
            total += parts.actuation * (tau(actuation[actuator.input], path) - straight)
    return total
