"""What simulations in dynamics engines share: chains that settle by relaxation; arms and contacts of scenes."""

from __future__ import annotations

import time
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from pliant.errors import ContractError
from pliant.interfaces.simulation import SceneSimulation, SimulationState
from pliant.mechanics.efforts import actuation_values
from pliant.mechanics.relaxation import relax
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.rollout import Equilibrium, Inputs, OutsideDomain
from pliant.records.scene import Contact, Part, Scene
from pliant_plugins.physics.stepping import Steppable


class Joints(Protocol):
    """The joints of a chain inside an engine."""

    @property
    def q(self) -> Array:
        """(n, a) joint coordinates."""

    @property
    def rates(self) -> Array:
        """(n, a) their rates."""

    def place(self, q: Array, rates: Array) -> None:
        """Set joint coordinates and their rates."""


class DynamicSimulation(Steppable):
    """A chain in an engine with inertia; `settle` relaxes it to rest and reaches the present inputs slowly."""

    def __init__(
        self, chain: ChainModel, statics: ChainStatics, joints: Joints, tolerance: float, max_steps: int
    ) -> None:
        super().__init__(chain)
        self.statics, self._joints = statics, joints
        self._tolerance, self._max_settle_steps = tolerance, max_steps

    def apply(self, inputs: Inputs) -> None:
        self.statics.efforts.values(inputs.actuation)
        self._loads = Loads.from_inputs(self.chain, inputs)

    def settle(self) -> Equilibrium:
        start = time.perf_counter()
        loads, efforts = self.now(), self.statics.efforts
        self.begin_relaxing()
        try:
            relaxed = relax(self, self.statics, loads, self._tolerance, self._max_settle_steps)
        finally:
            self.end_relaxing()
        if self.chain.terms:
            self._memory = efforts.advance(relaxed.q, loads.actuation, self._memory)
        return Equilibrium(
            joint_angles=relaxed.q,
            markers_m=self.markers(),
            residual=relaxed.residual,
            converged=relaxed.converged,
            stable=relaxed.stable,
            iterations=relaxed.steps,
            wall_s=time.perf_counter() - start,
            outside_domain=efforts.outside_domain(relaxed.q, loads.actuation, self._time_s),
        )

    def now(self) -> Loads:
        """Return the present loads with the memory of law terms."""
        return self._loads.after(self._memory) if self.chain.terms else self._loads

    def snapshot(self) -> SimulationState:
        return self._state(self.q, self.rates)

    def restore(self, state: SimulationState) -> None:
        self._joints.place(state.position, state.velocity)
        self._recall(state, self.statics.efforts.terms)

    # Interface of the relaxation: see `pliant.mechanics.relaxation.Mover`.

    @property
    def q(self) -> Array:
        """(n, a) joint coordinates."""
        return self._joints.q

    @property
    def rates(self) -> Array:
        """(n, a) rates dq/dt of the joint coordinates."""
        return self._joints.rates

    def halt(self, q: Array) -> None:
        """Put the chain at q without velocity."""
        self._joints.place(q, np.zeros_like(q))

    @abstractmethod
    def relax_step(self, loads: Loads, q: Array, load_stiffness: Array, caution: float) -> None:
        """Make one pseudo-time step."""

    @abstractmethod
    def begin_relaxing(self) -> None:
        """Switch to the pseudo-time of the relaxation."""

    @abstractmethod
    def end_relaxing(self) -> None:
        """Switch back to the chain's own inertia and damping."""


class ArmsScene(SceneSimulation):
    """The arms of a scene in any engine: loads, velocity of the carriage, time."""

    def __init__(self, scene: Scene, chains: Sequence[ChainModel]) -> None:
        """Store the arms' `chains`, which may be changed for the engine."""
        self.scene, self._chains = scene, chains
        self._statics = [ChainStatics(chain) for chain in chains]
        self._loads = [Loads.unactuated(chain) for chain in chains]
        self._velocity, self._time_s = np.zeros(3), 0.0

    def apply(self, inputs: Sequence[Inputs]) -> None:
        if len(inputs) != len(self._chains):
            raise ContractError(f"the scene has {len(self._chains)} arms and got inputs for {len(inputs)}")
        for chain, given in zip(self._chains, inputs, strict=True):
            actuation_values(chain.actuators, given.actuation)
        self._loads = [
            Loads.from_inputs(chain, given) for chain, given in zip(self._chains, inputs, strict=True)
        ]

    def carry(self, velocity_m_s: Array) -> None:
        self._velocity = np.array(velocity_m_s, float)

    @property
    @abstractmethod
    def joints(self) -> Sequence[Joints]:
        """Return the joints of each arm."""

    def outside_domain(self) -> tuple[OutsideDomain, ...]:
        entries: list[OutsideDomain] = []
        before = 0
        for statics, joints, load in zip(self._statics, self.joints, self._loads, strict=True):
            outside = statics.efforts.outside_domain(joints.q, load.actuation, self._time_s)
            entries += [replace(entry, module=entry.module + before) for entry in outside]
            before += statics.geometry.n_joints
        return tuple(entries)


def ordered_contact(
    one: Part,
    other: Part,
    place_m: Array,
    normal: Array,
    normal_n: float,
    friction_n: Array,
    order: str,
    apart_m: float,
) -> Contact:
    """Return a contact with its bodies in this order of kinds, then of numbers.

    The unit `normal` points from `one` to `other`, `friction_n` is the force on `other`, `apart_m` is their distance,
    negative where they are in each other.
    """
    if (order.index(one.kind), one.number) > (order.index(other.kind), other.number):
        one, other, normal, friction_n = other, one, -normal, -friction_n
    return Contact(one, other, place_m, normal, normal_n, friction_n, max(-apart_m, 0.0))
