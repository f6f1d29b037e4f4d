"""Histories of any chain by stepping a simulation through them, sample by sample."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace
from typing import Protocol

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.physics import SimulationState, Variation
from pliant.mechanics.kinematics import base_rotations
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import Followed, History
from pliant.records.rollout import Inputs

Paths = tuple[tuple[Followed, ...], tuple[tuple[Followed, ...], ...]]


class Reached(Protocol):
    """The end of a step."""

    @property
    def converged(self) -> bool:
        """The simulation can answer for where it is."""


class Steppable(Protocol):
    """A simulation that goes through histories."""

    def apply(self, inputs: Inputs) -> None:
        """Set actuation and loads from now on."""

    def warm(self, temperature_c: float) -> None:
        """Set the temperature that law terms see from now on."""

    def advance(self, duration_s: float) -> Reached:
        """Go on to the end of a step of this duration; infinite where it is reached slowly."""

    def snapshot(self) -> SimulationState:
        """The present state."""

    def restore(self, state: SimulationState) -> None:
        """Return to a snapshot."""

    def close(self) -> None:
        """Free the engine's resources."""


Builder = Callable[[ChainModel], Steppable]


def step_through(
    build: Builder,
    chain: ChainModel,
    histories: Sequence[History],
    towards: Sequence[Variation],
    longest_step_s: float = math.inf,
) -> Paths:
    """See `PhysicsBackend.follow`; samples further apart than `longest_step_s` are reached in equal parts.

    Raises:
        UserError: a base or payload that changes within a run, an input that is missing or not a number.
    """
    for its_chain, its_histories in [(chain, histories), *((v.chain, v.histories) for v in towards)]:
        check_driven(its_chain, its_histories)
    paths = _all(build, chain, histories, longest_step_s)
    changed = [_all(build, v.chain, v.histories, longest_step_s) for v in towards]
    return paths, tuple(_difference(moved, paths) for moved in changed)


def check_driven(chain: ChainModel, histories: Sequence[History]) -> None:
    """Raise `UserError` where a history lacks an input of the chain, or a number of it."""
    for history in histories:
        missing = [a.input for a in chain.actuators if a.input not in history.actuation]
        if missing:
            raise UserError(f"run '{history.run}' has no {missing[0]}, which drives the chain")
        _check_finite(history)


def _check_finite(history: History) -> None:
    for name, values in {
        **history.actuation,
        "time_s": history.time_s,
        "tip_force_n": history.tip_force_n,
        "moment_n_m": history.moment_n_m,
        "temperature_c": history.temperature_c,
        "base_angles_rad": history.base_angles_rad,
        "payload_kg": history.payload_kg,
    }.items():
        if values is not None and not np.all(np.isfinite(values)):
            sample = int(np.flatnonzero(~np.isfinite(values).reshape(len(values), -1).all(axis=1))[0])
            raise UserError(
                f"run '{history.run}', sample {sample + 1}: {name} is not a finite number; a chain cannot be "
                "followed over a gap in what drives it, so fill it or leave the sample out."
            )


def _all(
    build: Builder, chain: ChainModel, histories: Sequence[History], longest_step_s: float
) -> tuple[Followed, ...]:
    """One run after another; what terms keep goes on with the specimen."""
    keeps = np.repeat([term.keeps for term in chain.terms], [term.n_states for term in chain.terms])
    damage: dict[str, Array] = {}
    paths = []
    for history in histories:
        path, memory = _one(build, chain, history, longest_step_s, damage.get(history.specimen))
        paths.append(path)
        if keeps.any() and memory is not None:
            damage[history.specimen] = np.where(keeps, memory, 0.0)
    return tuple(paths)


def _one(
    build: Builder, chain: ChainModel, history: History, longest_step_s: float, damage: Array | None
) -> tuple[Followed, Array | None]:
    """The run and the memory of the law terms (n, a, states) at its end, from that at its beginning."""
    rotation = base_rotations(np.asarray(chain.base_rotation, float), history.base_angles_rad[:1])[0]
    payload = chain.payload_kg if history.payload_kg is None else float(history.payload_kg[0])
    if np.ptp(history.base_angles_rad, axis=0).any() or (
        history.payload_kg is not None and np.ptp(history.payload_kg) > 0.0
    ):
        raise UserError(
            f"run '{history.run}': base and payload must stay as they are within a run of "
            f"{chain.laws[0].joint} joints; split it"
        )
    q: list[Array] = []
    converged: list[bool] = []
    simulation = build(chain.with_(base_rotation=rotation, payload_kg=payload))
    with closing(simulation):
        if damage is not None:
            simulation.restore(replace(simulation.snapshot(), memory=damage))
        for k in range(len(history)):
            duration = math.inf
            if k and history.time_s is not None:
                duration = float(history.time_s[k] - history.time_s[k - 1])
            parts = max(1, math.ceil(duration / longest_step_s - 1e-9)) if math.isfinite(duration) else 1
            reached = True
            for part in range(1, parts + 1):
                inputs, temperature = _between(history, k, part / parts)
                simulation.apply(inputs)
                simulation.warm(temperature)
                reached &= simulation.advance(duration / parts).converged
            converged.append(reached)
            q.append(simulation.snapshot().position)
    return Followed(np.array(q), np.array(converged)), simulation.snapshot().memory


def _between(history: History, k: int, share: float) -> tuple[Inputs, float]:
    """Inputs and temperature at a share of the way from sample k − 1 to k."""
    last, here = history.at(max(k - 1, 0)), history.at(k)
    before = float(history.temperature_c[max(k - 1, 0)])

    def mixed(a: float, b: float) -> float:
        return share * b + (1.0 - share) * a

    return Inputs(
        {name: mixed(last.actuation[name], value) for name, value in here.actuation.items()},
        share * here.tip_force_n + (1.0 - share) * last.tip_force_n,
        mixed(last.moment_n_m, here.moment_n_m),
    ), mixed(before, float(history.temperature_c[k]))


def _difference(moved: Sequence[Followed], paths: Sequence[Followed]) -> tuple[Followed, ...]:
    return tuple(
        Followed(a.joint_angles - b.joint_angles, b.converged) for a, b in zip(moved, paths, strict=True)
    )
