"""The quasi-static engine: every state is an equilibrium under the present inputs."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from pliant.interfaces.physics import Capabilities, PhysicsBackend, Simulation, SimulationState, Variation
from pliant.mechanics.statics import Balance, ChainStatics, Loads
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.rollout import Equilibrium, Inputs
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig
from pliant_plugins.physics.quasistatic.newton import NewtonOptions, Solution, minimise
from pliant_plugins.physics.quasistatic.stepping import Paths, step_through

if TYPE_CHECKING:
    from pliant_plugins.physics.quasistatic.histories import HingeFollower


@dataclass(frozen=True, eq=False)
class _Problem:
    statics: ChainStatics
    loads: Loads

    def balance(self, q: Array) -> Balance:
        return self.statics.balance(q, self.loads)

    def potential(self, q: Array) -> float:
        return self.statics.potential(q, self.loads)


class QuasistaticSimulation(Simulation):
    """A chain that is always in equilibrium; it has no velocity, but its law terms may have a memory.

    `settle` reaches the present inputs slowly, `step` within the time given.
    """

    def __init__(self, chain: ChainModel, config: QuasistaticConfig) -> None:
        self.chain = chain
        self._config = config
        self._statics = ChainStatics(chain)
        reach = config.max_turn
        if chain.laws[0].joint == "prismatic":
            reach *= chain.length_m / chain.n_joints
        self._options = NewtonOptions(config.tolerance, config.max_iterations, reach)
        self._time_s = 0.0
        self._q = np.zeros((chain.n_joints, len(chain.axes)))
        # The last loads whose equilibrium is known: continuation starts there.
        self._settled_q, self._settled_loads = self._q, Loads.none(chain)
        self._loads = Loads.unactuated(chain)
        self._memory = self._statics.efforts.terms.rested()

    def apply(self, inputs: Inputs) -> None:
        self._statics.efforts.values(inputs.actuation)
        self._loads = Loads.of(self.chain, inputs)

    def settle(self) -> Equilibrium:
        return self.advance(math.inf)

    def step(self, duration_s: float) -> None:
        self._time_s += duration_s
        self.advance(duration_s)

    def warm(self, temperature_c: float) -> None:
        """Set the temperature that law terms see from now on."""
        self._memory = replace(self._memory, temperature_c=temperature_c)

    def advance(self, duration_s: float) -> Equilibrium:
        """The equilibrium at the end of a step of this duration; infinite where it is reached slowly."""
        start = time.perf_counter()
        self._loads = self._loads.after(self._memory.over(duration_s))
        solution = minimise(_Problem(self._statics, self._loads), self._q, self._options)
        if not solution.converged:
            solution = self._continue(solution)
        self._q = solution.q
        efforts = self._statics.efforts
        self._memory = efforts.advance(self._q, self._loads.actuation, self._memory.over(duration_s))
        if solution.converged:
            self._settled_q, self._settled_loads = solution.q, self._loads
        outside = efforts.outside_domain(self._q, self._loads.actuation, self._time_s)
        return Equilibrium(
            joint_angles=self._q.copy(),
            markers_m=self.markers(),
            residual=solution.residual,
            converged=solution.converged,
            stable=solution.stable,
            iterations=solution.iterations,
            wall_s=time.perf_counter() - start,
            outside_domain=outside,
        )

    def snapshot(self) -> SimulationState:
        memory = self._memory.states.copy()
        return SimulationState(self._time_s, self._q.copy(), np.zeros_like(self._q), memory)

    def restore(self, state: SimulationState) -> None:
        self._time_s, self._q = state.time_s, state.position.copy()
        rested = self._statics.efforts.terms.rested()
        states = rested.states if state.memory is None else state.memory.copy()
        self._memory = replace(self._memory, previous=self._q.copy(), states=states)

    def markers(self) -> Array:
        return self._statics.geometry.markers(self._q)

    def _continue(self, direct: Solution) -> Solution:
        """Walk from the last settled loads to the present ones in steps that shrink on failure.

        Ends with the better of the direct attempt and the walk when both fail.
        """
        q, done, step = self._settled_q, 0.0, 0.5
        iterations, last = direct.iterations, direct
        while done < 1.0 and step >= self._config.smallest_step:
            target = min(1.0, done + step)
            loads = self._settled_loads.between(self._loads, target)
            last = minimise(_Problem(self._statics, loads), q, self._options)
            iterations += last.iterations
            if last.converged:
                q, done, step = last.q, target, 2.0 * step
            else:
                step *= 0.5
        if done < 1.0:
            return Solution(direct.q, direct.residual, False, direct.stable, iterations)
        return Solution(q, last.residual, True, last.stable, iterations)


class Quasistatic(PhysicsBackend):
    """Statics by Newton's method with the analytic stiffness of `pliant.mechanics.statics`."""

    capabilities: ClassVar[Capabilities] = Capabilities(
        ("revolute", "spherical", "prismatic"), dynamic=False, internal_states=True
    )
    config: QuasistaticConfig

    def __init__(self, config: QuasistaticConfig) -> None:
        super().__init__(config)
        self._follower: HingeFollower | None = None

    def build(self, chain: ChainModel) -> QuasistaticSimulation:
        return QuasistaticSimulation(chain, self.config)

    def preparing(self, chain: ChainModel) -> str | None:
        if chain.laws[0].joint != "revolute":
            return None
        from pliant_plugins.physics.quasistatic.kernel import is_compiled  # numba takes a second

        if is_compiled():
            return None
        return "compiling the simulation, about half a minute; this happens once after an installation."

    def follow(
        self, chain: ChainModel, histories: Sequence[History], towards: Sequence[Variation] = ()
    ) -> Paths:
        """Hinge chains in a compiled loop; others step by step, differences by the varied chain's own path."""
        if chain.laws[0].joint != "revolute":
            return step_through(self.build, chain, histories, towards, self.config.longest_step_s)
        if self._follower is None:
            from pliant_plugins.physics.quasistatic.histories import HingeFollower  # numba takes a second

            self._follower = HingeFollower(self.config)
        return self._follower.follow(chain, histories, towards)
