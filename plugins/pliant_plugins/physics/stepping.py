"""Histories of any chain by stepping a simulation through them, sample by sample."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.errors import UserError
from pliant.interfaces.physics import Variation
from pliant.interfaces.simulation import Simulation, SimulationState
from pliant.mechanics.kinematics import base_rotations
from pliant.mechanics.statics import Loads
from pliant.mechanics.terms import LawTerms, TermMemory
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import Followed, History
from pliant.records.rollout import Inputs

Paths = tuple[tuple[Followed, ...], tuple[tuple[Followed, ...], ...]]


class Steppable(Simulation):
    """A chain with a clock, and law terms that remember."""

    def __init__(self, chain: ChainModel) -> None:
        self.chain = chain
        self._loads = Loads.unactuated(chain)
        self._time_s = 0.0

    @cached_property
    def _memory(self) -> TermMemory:
        """The memory of law terms, at first before a step that takes for ever: engines put their own step in."""
        return TermMemory.at_rest(self.chain.terms, (self.chain.n_joints, len(self.chain.axes)))

    def warm(self, temperature_c: float) -> None:
        """Set the temperature that law terms see from now on."""
        self._memory = replace(self._memory, temperature_c=temperature_c)

    def _state(self, position: Array, velocity: Array) -> SimulationState:
        memory = self._memory.states.copy() if self.chain.terms else None
        return SimulationState(self._time_s, position, velocity, memory)

    def _recall(self, state: SimulationState, terms: LawTerms) -> None:
        """Take time and memory from a state; terms are rested where it has no memory."""
        self._time_s = state.time_s
        states = terms.rested().states if state.memory is None else state.memory.copy()
        self._memory = replace(self._memory, previous=state.position.copy(), states=states)


# Simulates one run in steps no longer than given: joint coordinates (t, n, a) and whether each was reached.
Through = Callable[[Any, History, float], tuple[Array, NDArray[np.bool_]]]


def sample_by_sample(
    simulation: Steppable, history: History, longest_step_s: float, first: int = 0, last: int | None = None
) -> tuple[Array, NDArray[np.bool_]]:
    """Return joint coordinates (t, n, a) at samples `first` to `last` (exclusive), and whether each was reached."""
    q: list[Array] = []
    converged: list[bool] = []
    for k in range(first, len(history) if last is None else last):
        duration = math.inf
        if k and history.time_s is not None:
            duration = float(history.time_s[k] - history.time_s[k - 1])
        parts = 1 if math.isinf(duration) else int(n_parts(duration, longest_step_s))
        reached = True
        for part in range(1, parts + 1):
            inputs, temperature = _between(history, k, part / parts)
            simulation.apply(inputs)
            simulation.warm(temperature)
            reached &= simulation.advance(duration / parts)
        converged.append(reached)
        q.append(simulation.snapshot().position)
    return np.array(q), np.array(converged)


def step_through(
    build: Callable[[ChainModel], Steppable],
    chain: ChainModel,
    histories: Sequence[History],
    towards: Sequence[Variation],
    longest_step_s: float = math.inf,
    through: Through = sample_by_sample,
) -> Paths:
    """See `PhysicsBackend.follow`; samples further apart than `longest_step_s` are reached in equal parts.

    `through` simulates one run.

    Raises:
        UserError: a base or payload that changes within a run, an input that is missing or not a number.
    """

    def walk(chain: ChainModel, histories: Sequence[History]) -> list[Followed]:
        """Follow runs one after another; permanent states of terms continue with the specimen."""
        check_driven(chain, histories)
        keeps = np.repeat([term.keeps for term in chain.terms], [term.n_states for term in chain.terms])
        damage: dict[str, Array] = {}
        paths = []
        for history in histories:
            with closing(build(_placed(chain, history))) as simulation:
                if history.specimen in damage:
                    simulation.restore(replace(simulation.snapshot(), memory=damage[history.specimen]))
                paths.append(Followed(*through(simulation, history, longest_step_s)))
                memory = simulation.snapshot().memory
            if keeps.any() and memory is not None:
                damage[history.specimen] = np.where(keeps, memory, 0.0)
        return paths

    paths = walk(chain, histories)
    moved = [walk(v.chain, v.histories) for v in towards]
    return tuple(paths), tuple(
        tuple(Followed(a.joint_angles - b.joint_angles, b.converged) for a, b in zip(one, paths, strict=True))
        for one in moved
    )


def n_parts(duration_s: Any, longest_step_s: float) -> Any:
    """Return the number of equal parts of finite durations, each no longer than the longest step; at least 1."""
    return np.maximum(1, np.ceil(np.asarray(duration_s) / longest_step_s - 1e-9)).astype(np.int64)


def check_driven(chain: ChainModel, histories: Sequence[History]) -> None:
    """Raise `UserError` where a history lacks an input of the chain, or a number of it."""
    names = ("time_s", "tip_force_n", "moment_n_m", "temperature_c", "base_angles_rad", "payload_kg")
    for history in histories:
        missing = [a.input for a in chain.actuators if a.input not in history.actuation]
        if missing:
            raise UserError(f"run '{history.run}' has no {missing[0]}, which drives the chain")
        for name, values in {**history.actuation, **{name: getattr(history, name) for name in names}}.items():
            if values is not None and not np.all(np.isfinite(values)):
                sample = int(np.flatnonzero(~np.isfinite(values).reshape(len(values), -1).all(axis=1))[0])
                raise UserError(
                    f"run '{history.run}', sample {sample + 1}: {name} is not a finite number; a chain cannot be "
                    "followed over a gap in what drives it, so fill it or leave the sample out."
                )


def _placed(chain: ChainModel, history: History) -> ChainModel:
    """Return the chain, with its terms, under the base and payload of a run."""
    if np.ptp(history.base_angles_rad, axis=0).any() or (
        history.payload_kg is not None and np.ptp(history.payload_kg) > 0.0
    ):
        raise UserError(
            f"run '{history.run}': base and payload must stay as they are within a run of "
            f"{chain.laws[0].joint} joints; split it"
        )
    rotation = base_rotations(np.asarray(chain.base_rotation, float), history.base_angles_rad[:1])[0]
    payload = chain.payload_kg if history.payload_kg is None else float(history.payload_kg[0])
    terms = tuple(term.carrying(payload - chain.payload_kg) for term in chain.terms)
    return chain.with_(base_rotation=rotation, payload_kg=payload, terms=terms)


def _between(history: History, k: int, share: float) -> tuple[Inputs, float]:
    """Return inputs and temperature at a share of the way from sample k − 1 to k."""
    last, here = history.at(max(k - 1, 0)), history.at(k)
    before = float(history.temperature_c[max(k - 1, 0)])

    def mixed(a: float, b: float) -> float:
        return share * b + (1.0 - share) * a

    return Inputs(
        {name: mixed(last.actuation[name], value) for name, value in here.actuation.items()},
        share * here.tip_force_n + (1.0 - share) * last.tip_force_n,
        mixed(last.moment_n_m, here.moment_n_m),
    ), mixed(before, float(history.temperature_c[k]))
