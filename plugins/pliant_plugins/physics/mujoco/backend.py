"""The MuJoCo engine: fast dynamics, and equilibria by relaxation."""

from __future__ import annotations

import math
import time
from typing import ClassVar

from pliant.interfaces.physics import Capabilities, PhysicsBackend, Simulation, SimulationState
from pliant.mechanics.relaxation import relax
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.rollout import Equilibrium, Inputs
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.mujoco.engine import MujocoChain


class MujocoSimulation(Simulation):
    """A chain in MuJoCo."""

    def __init__(self, chain: ChainModel, config: MujocoConfig) -> None:
        self.chain = chain
        self._config = config
        self._statics = ChainStatics(chain)
        self._engine = MujocoChain(chain, self._statics)
        self._loads = Loads.unactuated(chain)
        self._time_s = 0.0

    def apply(self, inputs: Inputs) -> None:
        self._statics.efforts.values(inputs.actuation)
        self._loads = Loads.of(self.chain, inputs)

    def settle(self) -> Equilibrium:
        start = time.perf_counter()
        prismatic = self._statics.geometry.kind == "prismatic"
        self._engine.set_stepping(self._config.settle_timestep_s, damping=0.0)
        relaxed = relax(
            self._engine,
            self._statics,
            self._loads,
            self._config.tolerance,
            self._config.max_settle_steps,
            reach=self.chain.length_m / self.chain.n_joints if prismatic else 1.0,
        )
        return Equilibrium(
            joint_angles=relaxed.q,
            markers_m=self.markers(),
            residual=relaxed.residual,
            converged=relaxed.converged,
            stable=relaxed.stable,
            iterations=relaxed.steps,
            wall_s=time.perf_counter() - start,
            outside_domain=self._statics.efforts.outside_domain(
                relaxed.q, self._loads.actuation, self._time_s
            ),
        )

    def step(self, duration_s: float) -> None:
        if duration_s <= 0.0:
            return
        n_steps = math.ceil(duration_s / self._longest_step() - 1e-9)
        self._engine.set_stepping(duration_s / n_steps, self._config.joint_damping)
        for _ in range(n_steps):
            self._engine.advance(self._loads, self._engine.q)
        self._time_s += duration_s

    def snapshot(self) -> SimulationState:
        return SimulationState(self._time_s, self._engine.q, self._engine.rates)

    def restore(self, state: SimulationState) -> None:
        self._time_s = state.time_s
        self._engine.place(state.position, state.velocity)

    def markers(self) -> Array:
        return self._engine.markers()

    def _longest_step(self) -> float:
        if self._engine.implicit:
            return self._config.timestep_s
        stable = self._engine.stable_step(self._loads, self._config.joint_damping)
        return min(self._config.timestep_s, stable)


class Mujoco(PhysicsBackend):
    """MuJoCo with its `discrete` integrator, which takes the laws' slopes implicitly."""

    capabilities: ClassVar[Capabilities] = Capabilities(("revolute", "spherical", "prismatic"), dynamic=True)
    config: MujocoConfig

    def build(self, chain: ChainModel) -> MujocoSimulation:
        return MujocoSimulation(chain, self.config)
