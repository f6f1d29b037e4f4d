"""What simulations in dynamics engines share: inputs, settling by relaxation, time and snapshots; loads of scenes."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Protocol

from pliant.errors import ContractError
from pliant.interfaces.physics import Simulation, SimulationState
from pliant.mechanics.efforts import actuation_values
from pliant.mechanics.relaxation import Mover, relax
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.mechanics.terms import Memory
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.rollout import Equilibrium, Inputs, OutsideDomain
from pliant.records.scene import Scene


class Engine(Mover, Protocol):
    """A chain inside a dynamics engine."""

    def begin_relaxing(self) -> None:
        """Switch to the pseudo-time of the relaxation."""

    def end_relaxing(self) -> None:
        """Switch back to the chain's own inertia and damping."""

    def travel(self, loads: Loads, duration_s: float) -> Memory | None:
        """Advance in real time; the memory of law terms at the end, None where the engine does not follow it."""

    def place(self, q: Array, rates: Array) -> None:
        """Set joint coordinates and their rates."""

    def markers(self) -> Array:
        """(n + 2, 3) base, joints and tip from the engine's own kinematics."""

    def close(self) -> None:
        """Free the engine's resources; a second call does nothing."""


class DynamicSimulation(Simulation):
    """A chain in an engine with inertia; `settle` relaxes it to rest and reaches the present inputs slowly."""

    def __init__(
        self,
        chain: ChainModel,
        statics: ChainStatics,
        engine: Engine,
        tolerance: float,
        max_settle_steps: int,
    ) -> None:
        self.chain = chain
        self._statics, self._engine = statics, engine
        self._tolerance, self._max_settle_steps = tolerance, max_settle_steps
        self._loads = Loads.unactuated(chain)
        # Of law terms, before a step that takes for ever: engines put their own step in.
        self._memory = statics.efforts.terms.rested() if chain.terms else None
        self._time_s = 0.0
        prismatic = statics.geometry.kind == "prismatic"
        self._reach = chain.length_m / chain.n_joints if prismatic else 1.0

    def apply(self, inputs: Inputs) -> None:
        self._statics.efforts.values(inputs.actuation)
        self._loads = Loads.of(self.chain, inputs)

    def settle(self) -> Equilibrium:
        start = time.perf_counter()
        loads = self.now()
        self._engine.begin_relaxing()
        try:
            relaxed = relax(
                self._engine, self._statics, loads, self._tolerance, self._max_settle_steps, self._reach
            )
        finally:
            self._engine.end_relaxing()
        efforts = self._statics.efforts
        if self._memory is not None:
            self._memory = efforts.advance(relaxed.q, loads.actuation, self._memory)
        outside = efforts.outside_domain(relaxed.q, loads.actuation, self._time_s)
        return Equilibrium(
            joint_angles=relaxed.q,
            markers_m=self.markers(),
            residual=relaxed.residual,
            converged=relaxed.converged,
            stable=relaxed.stable,
            iterations=relaxed.steps,
            wall_s=time.perf_counter() - start,
            outside_domain=outside,
        )

    def step(self, duration_s: float) -> None:
        if duration_s > 0.0:
            self._memory = self._engine.travel(self.now(), duration_s) or self._memory
            self._time_s += duration_s

    def now(self) -> Loads:
        """The present loads, with the past that law terms remember."""
        return self._loads if self._memory is None else self._loads.after(self._memory)

    def snapshot(self) -> SimulationState:
        states = None if self._memory is None else self._memory.states.copy()
        return SimulationState(self._time_s, self._engine.q, self._engine.rates, states)

    def restore(self, state: SimulationState) -> None:
        self._time_s = state.time_s
        self._engine.place(state.position, state.velocity)
        if self._memory is not None:
            rested = self._statics.efforts.terms.rested()
            states = rested.states if state.memory is None else state.memory.copy()
            self._memory = replace(self._memory, previous=state.position.copy(), states=states)

    def markers(self) -> Array:
        return self._engine.markers()

    def close(self) -> None:
        self._engine.close()


def loads_of_arms(scene: Scene, chains: Sequence[ChainModel], inputs: Sequence[Inputs]) -> list[Loads]:
    """Loads of each arm of a scene, whose chains may be changed for an engine.

    Raises:
        ContractError: inputs for another number of arms.
        UserError: an input of a chain has no value.
    """
    if len(inputs) != len(scene.arms):
        raise ContractError(f"the scene has {len(scene.arms)} arms and got inputs for {len(inputs)}")
    for chain, given in zip(chains, inputs, strict=True):
        actuation_values(chain.actuators, given.actuation)
    return [Loads.of(chain, given) for chain, given in zip(chains, inputs, strict=True)]


def arms_outside_domain(
    statics: Sequence[ChainStatics], coordinates: Iterable[Array], loads: Iterable[Loads], time_s: float
) -> tuple[OutsideDomain, ...]:
    """Where laws of a scene's arms are used outside their domain; joints are numbered through all arms."""
    entries: list[OutsideDomain] = []
    before = 0
    for arm, q, load in zip(statics, coordinates, loads, strict=True):
        outside = arm.efforts.outside_domain(q, load.actuation, time_s)
        entries += [replace(entry, module=entry.module + before) for entry in outside]
        before += arm.geometry.n_joints
    return tuple(entries)
