"""A chain that is always in equilibrium: the simulation of the quasi-static engine."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.simulation import SimulationState
from pliant.mechanics.efforts import actuation_values
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.rollout import Equilibrium, Inputs, OutsideDomain, Response, Sensitivity
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig
from pliant_plugins.physics.quasistatic.newton import (
    ChainSolution,
    NewtonOptions,
    Responder,
    Solver,
    by_actuation,
    minimise,
    sensitivity,
)
from pliant_plugins.physics.stepping import Steppable


class QuasistaticSimulation(Steppable):
    """A chain that is always in equilibrium; it has no velocity, but its law terms may have a memory.

    `settle` reaches the present inputs slowly, `step` within the time given.
    """

    def __init__(
        self,
        chain: ChainModel,
        config: QuasistaticConfig,
        solver: Solver | None = None,
        responder: Callable[[], Responder] | None = None,
    ) -> None:
        super().__init__(chain)
        self._config, self._make_responder = config, responder
        options = newton_options(chain, config)
        self._solve = solver or (lambda q, loads: minimise(self._statics, loads, q, options))
        self._q = np.zeros((chain.n_joints, len(chain.axes)))
        # The last loads whose equilibrium is known: continuation starts there.
        self._settled_q, self._settled_loads = self._q, Loads.none(chain)
        self._settled: Equilibrium | None = None

    @cached_property
    def _statics(self) -> ChainStatics:
        return ChainStatics(self.chain)

    @cached_property
    def _responder(self) -> Responder | None:
        return self._make_responder() if self._make_responder else None

    def apply(self, inputs: Inputs) -> None:
        actuation_values(self.chain.actuators, inputs.actuation)
        self._loads = Loads.from_inputs(self.chain, inputs)

    def settle(self) -> Equilibrium:
        return self._reach(math.inf)

    def step(self, duration_s: float) -> None:
        self.advance(duration_s)

    def advance(self, duration_s: float) -> bool:
        if math.isfinite(duration_s):
            self._time_s += duration_s
        return self._reach(duration_s).converged

    def _reach(self, duration_s: float) -> Equilibrium:
        """Solve for equilibrium at the end of a step of this duration, infinite for a quasi-static approach."""
        start = time.perf_counter()
        if self.chain.terms:
            self._loads = self._loads.after(self._memory.over(duration_s))
        solution = self._solve(self._q, self._loads)
        if not solution.converged:
            solution = self._continue(solution)
        self._q = solution.q
        if self.chain.terms:
            self._memory = self._statics.efforts.advance(
                self._q, self._loads.actuation, self._memory.over(duration_s)
            )
        if solution.converged:
            self._settled_q, self._settled_loads = solution.q, self._loads
        outside: tuple[OutsideDomain, ...] = ()
        if not solution.inside:
            efforts = self._statics.efforts
            outside = efforts.outside_domain(self._q, self._loads.actuation, self._time_s)
        self._settled = Equilibrium(
            joint_angles=self._q.copy(),
            markers_m=self.markers() if solution.markers is None else solution.markers,
            residual=solution.residual,
            converged=solution.converged,
            stable=solution.stable,
            iterations=solution.iterations,
            wall_s=time.perf_counter() - start,
            outside_domain=outside,
        )
        return self._settled

    def sensitivity(self) -> Sensitivity:
        if self._settled is None or not self._settled.converged:
            raise UserError(
                "the chain has not settled in an equilibrium, so its answer has no derivatives: call settle() "
                "and see that it converged"
            )
        return sensitivity(self.chain, self._statics, self._settled_q, self._settled_loads)

    def respond(self, inputs: Inputs, start: Array | None = None) -> Response:
        if self._responder is None:
            self._q = self._q if start is None else start.copy()
            self.apply(inputs)
            settled = self.settle()
            return self._response(settled, *self._by_actuation(settled))
        found = self._responder(inputs, self._q if start is None else start)
        if not found.converged:  # by continuation, if need be
            self.apply(inputs)
            found = self._responder(inputs, self.settle().joint_angles)
        return found

    def _by_actuation(self, equilibrium: Equilibrium) -> tuple[Array, Array | None]:
        """Return derivatives of markers (k, n + 2, 3) and coordinates (k, n, a) by the inputs; None before settling."""
        names = self.chain.inputs
        if not equilibrium.converged:
            return np.zeros((len(names), *equilibrium.markers_m.shape)), None
        turned, moved = by_actuation(self.chain, self._statics, self._settled_q, self._settled_loads)
        return np.array([moved[name] for name in names]), np.array([turned[name] for name in names])

    def snapshot(self) -> SimulationState:
        return self._state(self._q.copy(), np.zeros_like(self._q))

    def restore(self, state: SimulationState) -> None:
        self._q = state.position.copy()
        self._recall(state, self._statics.efforts.terms)

    def markers(self) -> Array:
        return self._statics.geometry.markers(self._q)

    def _continue(self, direct: ChainSolution) -> ChainSolution:
        """Walk from the last settled loads to the present ones in steps that shrink on failure.

        Ends with the better of the direct attempt and the walk when both fail.
        """
        q, done, step = self._settled_q, 0.0, 0.5
        iterations, last = direct.iterations, direct
        while done < 1.0 and step >= self._config.smallest_step:
            target = min(1.0, done + step)
            loads = self._settled_loads.between(self._loads, target)
            last = self._solve(q, loads)
            iterations += last.iterations
            if last.converged:
                q, done, step = last.q, target, 2.0 * step
            else:
                step *= 0.5
        return replace(last if done >= 1.0 else direct, iterations=iterations)


def newton_options(chain: ChainModel, config: QuasistaticConfig) -> NewtonOptions:
    """Return tolerance, iterations and the longest move of a coordinate, in rad or m."""
    reach = config.max_turn
    if chain.laws[0].joint == "prismatic":
        reach *= chain.length_m / chain.n_joints
    return NewtonOptions(config.tolerance, config.max_iterations, reach)
