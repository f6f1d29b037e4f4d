"""The PyBullet engine: explicit dynamics, and equilibria by relaxation."""

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
from pliant_plugins.physics.pybullet.config import PybulletConfig
from pliant_plugins.physics.pybullet.engine import BulletChain


class PybulletSimulation(Simulation):
    """A chain in a PyBullet client of its own."""

    def __init__(self, chain: ChainModel, config: PybulletConfig) -> None:
        self.chain = chain
        self._config = config
        self._statics = ChainStatics(chain)
        self._engine = BulletChain(chain, self._statics, config.settle_timestep_s)
        self._loads = Loads.unactuated(chain)
        self._time_s = 0.0

    def apply(self, inputs: Inputs) -> None:
        self._statics.efforts.values(inputs.actuation)
        self._loads = Loads.of(self.chain, inputs)

    def settle(self) -> Equilibrium:
        start = time.perf_counter()
        prismatic = self._statics.geometry.kind == "prismatic"
        self._engine.begin_relaxing()
        relaxed = relax(
            self._engine,
            self._statics,
            self._loads,
            self._config.tolerance,
            self._config.max_settle_steps,
            reach=self.chain.length_m / self.chain.n_joints if prismatic else 1.0,
        )
        self._engine.end_relaxing()
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
        damping = self._config.joint_damping
        longest = min(self._config.timestep_s, self._engine.stable_step(self._loads, damping))
        n_steps = math.ceil(duration_s / longest - 1e-9)
        self._engine.set_timestep(duration_s / n_steps)
        for _ in range(n_steps):
            q, rates = self._engine.state()
            self._engine.advance(self._loads, q, rates, damping)
        self._time_s += duration_s

    def snapshot(self) -> SimulationState:
        return SimulationState(self._time_s, *self._engine.state())

    def restore(self, state: SimulationState) -> None:
        self._time_s = state.time_s
        self._engine.place(state.position, state.velocity)

    def markers(self) -> Array:
        return self._engine.markers()

    def close(self) -> None:
        self._engine.close()


class Pybullet(PhysicsBackend):
    """PyBullet (Bullet's articulated bodies) with explicit torques of the laws."""

    capabilities: ClassVar[Capabilities] = Capabilities(("revolute", "spherical", "prismatic"), dynamic=True)
    config: PybulletConfig

    def build(self, chain: ChainModel) -> PybulletSimulation:
        return PybulletSimulation(chain, self.config)
