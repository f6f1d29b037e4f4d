"""Stage 4: a chain in an engine, under a task, with effects."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pliant.errors import UserError
from pliant.interfaces.effect import Effect, EffectConfig, Model
from pliant.interfaces.physics import PhysicsBackend, PhysicsConfig, Simulation, SimulationState
from pliant.interfaces.task import Task, TaskConfig
from pliant.pipeline.workbench import Workbench, content
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.rollout import Equilibrium, Inputs, TaskResult
from pliant.registry.component import Component
from pliant.store.store import Artifact


@dataclass(frozen=True)
class ChainSource:
    """A chain with everything that determined it, for the keys of what is made from it."""

    chain: ChainModel
    config: Mapping[str, Any]
    inputs: Mapping[str, str]
    components: Sequence[Component]


def simulate_stage(
    bench: Workbench,
    source: ChainSource,
    physics: PhysicsConfig,
    task: TaskConfig,
    effects: Sequence[EffectConfig],
) -> Artifact:
    """Run the task; the artifact's value is a `TaskResult`.

    Raises `MissingDependencyError` for an engine that is not installed and `UserError` for a chain that it
    cannot simulate.
    """
    backend: PhysicsBackend = bench.build("physics", physics)
    built_task: Task = bench.build("task", task)
    built_effects: list[Effect] = [bench.build("effect", effect) for effect in effects]
    _check_capabilities(backend, source.chain, physics.kind)

    def compute(partial: Path) -> TaskResult:
        return run_task(backend, built_task, built_effects, source.chain)

    return bench.make(
        "simulate",
        compute,
        components=[
            *source.components,
            bench.component("physics", physics),
            bench.component("task", task),
            *(bench.component("effect", effect) for effect in effects),
        ],
        modules=["pliant.pipeline.simulate", "pliant.pipeline.chain"],
        config={
            **source.config,
            "physics": content(physics),
            "task": content(task),
            "effects": [content(effect) for effect in effects],
        },
        inputs=source.inputs,
    )


def run_task(backend: PhysicsBackend, task: Task, effects: Sequence[Effect], chain: ChainModel) -> TaskResult:
    """Apply the effects to the prepared chain, simulate it under the task, map the result."""
    model = Model(task.prepare(chain))
    for effect in effects:
        model = effect.apply(model)
    with backend.build(model.chain) as simulation:
        result = task.run(_WithInputs(simulation, model.inputs) if model.inputs else simulation)
    for output in model.outputs:
        result = output(result)
    return result


def _check_capabilities(backend: PhysicsBackend, chain: ChainModel, kind: str) -> None:
    joints = {law.joint for law in chain.laws}
    unknown = joints - set(backend.capabilities.joints)
    if unknown:
        raise UserError(
            f"physics '{kind}' has no {', '.join(sorted(unknown))} joints; "
            f"it has {', '.join(backend.capabilities.joints)}."
        )


class _WithInputs(Simulation):
    """A simulation whose inputs pass through the effects' input maps first."""

    def __init__(self, inner: Simulation, maps: Sequence[Callable[[Inputs], Inputs]]) -> None:
        self.inner, self.maps, self.chain = inner, maps, inner.chain

    def apply(self, inputs: Inputs) -> None:
        for change in self.maps:
            inputs = change(inputs)
        self.inner.apply(inputs)

    def settle(self) -> Equilibrium:
        return self.inner.settle()

    def step(self, duration_s: float) -> None:
        self.inner.step(duration_s)

    def snapshot(self) -> SimulationState:
        return self.inner.snapshot()

    def restore(self, state: SimulationState) -> None:
        self.inner.restore(state)

    def markers(self) -> Array:
        return self.inner.markers()
