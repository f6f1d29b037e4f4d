"""What reaches the robot of what is commanded: simulations and scenes behind the effects' input maps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pliant.interfaces.effect import Model
from pliant.interfaces.physics import SceneSimulation, Simulation, SimulationState
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.rollout import Equilibrium, Inputs, OutsideDomain
from pliant.records.scene import Contact, SceneState


class Commands:
    """Commands in time, and what the effects' input maps let through: maps take whole histories from the start."""

    def __init__(self, model: Model) -> None:
        self._model = model
        self._time_s = 0.0
        self._past: list[tuple[float, Inputs]] = []
        self._present: Inputs | None = None

    def give(self, inputs: Inputs) -> Inputs:
        """A new command; what it comes to after a long wait."""
        self._present = inputs
        return self._acting(())

    def wait(self) -> Inputs | None:
        """The present command holds for so long that its past is forgotten."""
        if self._present is None:
            return None
        self._past = [(self._time_s, self._present)]
        return self._acting(())

    def pass_time(self, duration_s: float) -> Inputs | None:
        """What acts at the end of a step with the present command."""
        self._time_s += duration_s
        if self._present is None:
            return None
        acting = self._acting(self._past)
        self._past.append((self._time_s, self._present))
        return acting

    def go_back(self, time_s: float) -> None:
        """Forget what was commanded after this time."""
        self._time_s = time_s
        self._past = [entry for entry in self._past if entry[0] <= time_s]

    def _acting(self, past: Sequence[tuple[float, Inputs]]) -> Inputs:
        assert self._present is not None
        commands = [*past, (self._time_s, self._present)]
        history = History.of(
            {n: np.array([inputs.actuation[n] for _, inputs in commands]) for n in self._present.actuation},
            np.array([time_s for time_s, _ in commands]) if past else None,
            tip_force_n=np.array([inputs.tip_force_n for _, inputs in commands]),
            moment_n_m=np.array([inputs.moment_n_m for _, inputs in commands]),
        )
        acting = self._model.commanded(history).at(-1)
        return replace(acting, forces=self._present.forces, cords=self._present.cords)


class WithInputs(Simulation):
    """A simulation whose inputs pass through the effects' input maps first; `settle` waits for long."""

    def __init__(self, inner: Simulation, model: Model) -> None:
        self.inner, self.chain = inner, inner.chain
        self._commands = Commands(model)

    def apply(self, inputs: Inputs) -> None:
        self.inner.apply(self._commands.give(inputs))

    def settle(self) -> Equilibrium:
        acting = self._commands.wait()
        if acting is not None:
            self.inner.apply(acting)
        return self.inner.settle()

    def step(self, duration_s: float) -> None:
        acting = self._commands.pass_time(duration_s)
        if acting is not None:
            self.inner.apply(acting)
        self.inner.step(duration_s)

    def snapshot(self) -> SimulationState:
        return self.inner.snapshot()

    def restore(self, state: SimulationState) -> None:
        self._commands.go_back(state.time_s)
        self.inner.restore(state)

    def markers(self) -> Array:
        return self.inner.markers()


class SceneWithInputs(SceneSimulation):
    """A scene whose arms' inputs pass through the effects' input maps first, each arm with its own past."""

    def __init__(self, inner: SceneSimulation, model: Model) -> None:
        self.inner, self.scene = inner, inner.scene
        self._commands = [Commands(model) for _ in inner.scene.arms]

    def apply(self, inputs: Sequence[Inputs]) -> None:
        pairs = zip(self._commands, inputs, strict=True)
        self.inner.apply([commands.give(given) for commands, given in pairs])

    def step(self, duration_s: float) -> None:
        acting = [commands.pass_time(duration_s) for commands in self._commands]
        given = [inputs for inputs in acting if inputs is not None]
        if given:  # all arms are commanded together
            self.inner.apply(given)
        self.inner.step(duration_s)

    def restore(self, state: SceneState) -> None:
        for commands in self._commands:
            commands.go_back(state.time_s)
        self.inner.restore(state)

    def carry(self, velocity_m_s: Array) -> None:
        self.inner.carry(velocity_m_s)

    def push(self, index: int, force_n: Array, moment_n_m: Array | None = None) -> None:
        self.inner.push(index, force_n, moment_n_m)

    def snapshot(self) -> SceneState:
        return self.inner.snapshot()

    def markers(self, arm: int) -> Array:
        return self.inner.markers(arm)

    def contacts(self) -> tuple[Contact, ...]:
        return self.inner.contacts()

    def outside_domain(self) -> tuple[OutsideDomain, ...]:
        return self.inner.outside_domain()

    def close(self) -> None:
        self.inner.close()
