"""Equilibria of a task that are recorded once, and followed to first order as the chain changes.

With the residual R(q; θ) = 0 of the recorded equilibrium q and its stiffness K = −∂R/∂q, a chain changed by Δθ settles
at

    q + K⁻¹ R(q; θ + Δθ) = q + ∂q/∂θ Δθ + O(Δθ²)

the implicit derivative, without an iteration. Only R is evaluated for the changed chain: of its laws that is the effort
at one state. The task itself is run on these equilibria, so that its metrics need no derivatives of their own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pliant.config.study import Study
from pliant.errors import ContractError
from pliant.interfaces.physics import PhysicsBackend, Variation
from pliant.interfaces.simulation import Simulation, SimulationState, StaticSimulation
from pliant.interfaces.task import Task
from pliant.mechanics.kinematics import ChainGeometry
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.pipeline.engine_checks import require_histories
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import Followed, History
from pliant.records.rollout import Equilibrium, Inputs, Response, Sensitivity, TaskResult
from pliant_search.evaluate.fast_path import FastPath, LawDraw


@dataclass(eq=False)
class TaskRun:
    """A run of a task.

    Attributes:
        chain: the simulated chain, with effects.
        settled: inputs and equilibrium of every `settle`, in order.
        only_settled: whether the task did nothing but apply inputs and settle.
        task, result: the task and what it returned.
    """

    chain: ChainModel | None = None
    settled: list[tuple[Inputs, Equilibrium]] = field(default_factory=list)
    only_settled: bool = True
    task: Task | None = None
    result: TaskResult | None = None

    def obstacle(self) -> str:
        """Return why its equilibria cannot be followed, as part of a sentence; empty if they can be."""
        if self.chain is not None and self.chain.terms:
            return "an effect has a rate or a memory"
        if self.chain is not None and self.chain.mount is not None:
            return "the chain is carried by an arm"
        if self.chain is None or not self.only_settled or not self.settled:
            return "the task does not only settle the chain"
        if not all(equilibrium.converged for _, equilibrium in self.settled):
            return "a level of the task did not settle"
        return ""

    @property
    def q(self) -> list[Array]:
        """Joint coordinates (n, a) of each level."""
        return [equilibrium.joint_angles for _, equilibrium in self.settled]

    def at(self, q: Sequence[Array]) -> TaskRun:
        """Return the run at other joint coordinates of its levels, to follow it from there."""
        levels = [
            (inputs, replace(one, joint_angles=there))
            for (inputs, one), there in zip(self.settled, q, strict=True)
        ]
        return replace(self, settled=levels)

    def stiffnesses(self) -> list[Array]:
        """Return K (n·a, n·a) at each level."""
        assert self.chain is not None
        statics = ChainStatics(self.chain)
        return [
            statics.balance(equilibrium.joint_angles, Loads.from_inputs(self.chain, inputs)).stiffness
            for inputs, equilibrium in self.settled
        ]

    def reach(self) -> Array:
        """Return (levels · n · a,) the change of each coordinate that is equivalent to 1 rad."""
        assert self.chain is not None
        own = np.tile(ChainGeometry.from_chain(self.chain).reach, self.chain.n_joints)
        return np.tile(own, len(self.settled))


class RecordedSimulation(Simulation):
    """A simulation that records its equilibria in a run."""

    def __init__(self, inner: Simulation, run: TaskRun) -> None:
        self.inner, self.chain, self._run, self._inputs = inner, inner.chain, run, Inputs({})
        run.chain = inner.chain

    def apply(self, inputs: Inputs) -> None:
        self._inputs = inputs
        self.inner.apply(inputs)

    def settle(self) -> Equilibrium:
        found = self.inner.settle()
        self._run.settled.append((self._inputs, found))
        return found

    def markers(self) -> Array:
        return self.inner.markers()

    def step(self, duration_s: float) -> None:
        self._run.only_settled = False
        self.inner.step(duration_s)

    def snapshot(self) -> SimulationState:
        self._run.only_settled = False
        return self.inner.snapshot()

    def restore(self, state: SimulationState) -> None:
        self._run.only_settled = False
        self.inner.restore(state)

    def sensitivity(self) -> Sensitivity:
        self._run.only_settled = False
        return self.inner.sensitivity()

    def respond(self, inputs: Inputs, start: Array | None = None) -> Response:
        self._run.only_settled = False
        return self.inner.respond(inputs, start)

    def close(self) -> None:
        self.inner.close()


# From the index of a level and the residual (n, a) of the changed chain at the recorded q to the q to show.
Placed = Callable[[int, Array], Array]


class FollowedSimulation(StaticSimulation):
    """A changed chain that is shown at coordinates chosen by the residuals at the equilibria of another run."""

    def __init__(self, chain: ChainModel, base: TaskRun, placed: Placed) -> None:
        super().__init__(chain)
        self._levels, self._placed = iter(enumerate(base.settled)), placed
        self._statics, self._loads = ChainStatics(chain), Loads.none(chain)

    def apply(self, inputs: Inputs) -> None:
        self._loads = Loads.from_inputs(self.chain, inputs)

    def settle(self) -> Equilibrium:
        try:
            level, (_, equilibrium) = next(self._levels)
        except StopIteration:
            raise ContractError(
                "the task settles the changed chain more often than the recorded one"
            ) from None
        self.q = self._placed(level, self._statics.residual(equilibrium.joint_angles, self._loads))
        return replace(equilibrium, joint_angles=self.q, markers_m=self._statics.geometry.markers(self.q))


class _EngineInPlace(PhysicsBackend):
    """An engine whose simulations record their equilibria, or follow those of another run."""

    def __init__(self, engine: PhysicsBackend, run: TaskRun) -> None:
        super().__init__(engine.config)
        self._engine, self._run = engine, run

    def build(self, chain: ChainModel) -> Simulation:
        return RecordedSimulation(self._engine.build(chain), self._run)

    def follow(
        self, chain: ChainModel, histories: Sequence[History], towards: Sequence[Variation] = ()
    ) -> tuple[tuple[Followed, ...], tuple[tuple[Followed, ...], ...]]:
        """See `HistoryBackend`; its presence admits effects with a memory, which `TaskRun.obstacle` names."""
        self._run.only_settled = False
        return require_histories(self._engine).follow(chain, histories, towards)


class _Follower(PhysicsBackend):
    def __init__(self, engine: PhysicsBackend, run: TaskRun, base: TaskRun, placed: Placed) -> None:
        super().__init__(engine.config)
        self._run, self._base, self._placed = run, base, placed

    def build(self, chain: ChainModel) -> Simulation:
        self._run.chain = chain
        return FollowedSimulation(chain, self._base, self._placed)


class RecordedPath(FastPath):
    """A path that records the run of every study that it simulates, until `runs` is cleared."""

    runs: list[TaskRun]

    def result(self, study: Study, draw: LawDraw | None = None) -> TaskResult:
        run = TaskRun(task=self.context.build("task", study.noisy_task()))
        self.runs.append(run)
        run.result = self.run(study, draw, lambda engine: _EngineInPlace(engine, run))
        return run.result

    def followed(self, study: Study, base: TaskRun, placed: Placed) -> TaskRun:
        """Return the run of a study whose chain is shown next to the equilibria of `base`."""
        run = TaskRun(task=self.context.build("task", study.noisy_task()))
        run.result = self.run(study, None, lambda engine: _Follower(engine, run, base, placed))
        return run
