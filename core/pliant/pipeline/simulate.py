"""Stage 4: a chain in an engine, under a task, with effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.effect import Effect, EffectConfig, Model
from pliant.interfaces.physics import PhysicsBackend, PhysicsConfig
from pliant.interfaces.task import SceneEngine, SceneTask, Task, TaskConfig
from pliant.pipeline.commands import SceneWithInputs, WithInputs
from pliant.pipeline.workbench import Workbench, content
from pliant.records.chain import ChainModel
from pliant.records.rollout import OutsideDomain, TaskResult
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
    built_task: Task | SceneTask = bench.build("task", task)
    built_effects: list[Effect] = [bench.build("effect", effect) for effect in effects]
    check_capabilities(backend, source.chain, physics.kind)

    def compute(partial: Path) -> TaskResult:
        if sentence := backend.preparing(source.chain, histories=False):
            bench.progress.note(sentence)
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


def run_task(
    backend: PhysicsBackend, task: Task | SceneTask, effects: Sequence[Effect], chain: ChainModel
) -> TaskResult:
    """Apply the effects to the prepared chain, simulate it under the task, map the result.

    Raises:
        UserError: the engine cannot simulate it, or a joint leaves its law's data and the task calls that an error.
    """
    model = Model(task.prepare(chain))
    for effect in effects:
        model = effect.apply(model)
    check_terms(backend, model.chain)
    if isinstance(task, SceneTask):
        result = task.run(model.chain, _scene_engine(backend, model))
    else:
        with backend.build(model.chain) as simulation:
            result = task.run(WithInputs(simulation, model) if model.inputs else simulation)
    if task.config.outside_domain == "error":
        refuse_extrapolation(result.final.outside_domain)
    reported = model.reported({**result.metrics, **_pushed(result)})
    return replace(result, metrics={name: reported[name] for name in reported if name != "actuation"})


def _pushed(result: TaskResult) -> dict[str, float]:
    """The sum of the last inputs, for output maps that depend on it; nothing where a task leaves no history."""
    return {} if result.rollout is None else {"actuation": float(np.sum(result.rollout.actuation[-1]))}


def refuse_extrapolation(outside: Sequence[OutsideDomain]) -> None:
    """Raise `UserError` that names the entry furthest outside its law's domain."""
    if not outside:
        return
    worst = max(outside, key=lambda entry: abs(entry.excess))
    raise UserError(
        f"joint {worst.module} leaves the domain of its law: {worst} at time {worst.time_s:.3g} of the task"
        f"{f', and {len(outside) - 1} more' if len(outside) > 1 else ''}. Give the law data there, load the chain "
        "less, or set 'outside_domain: report' in the task."
    )


def _scene_engine(backend: PhysicsBackend, model: Model) -> SceneEngine:
    """The engine's scenes, with the effects' input maps in front of them.

    Raises:
        UserError: the engine has no contacts.
    """
    kind = backend.config.kind
    if not backend.capabilities.contacts:
        raise UserError(
            f"physics '{kind}' has no contacts, which this task needs; use 'mujoco' or 'pybullet'."
        )
    if not model.inputs:
        return backend.build_scene
    return lambda scene: SceneWithInputs(backend.build_scene(scene), model)


def check_terms(backend: PhysicsBackend, chain: ChainModel) -> None:
    """Raise `UserError` for law terms that the engine cannot follow."""
    if any(term.needs_time for term in chain.terms) and not backend.capabilities.internal_states:
        kind = backend.config.kind
        raise UserError(
            f"physics '{kind}' does not follow effects with rate or memory; use 'quasistatic' or "
            "'mujoco', or leave them out of 'effects'."
        )
    if any(term.is_inertia for term in chain.terms) and backend.capabilities.dynamic:
        raise UserError(
            f"physics '{backend.config.kind}' accelerates the chain's masses by itself, and an effect that adds their "
            "inertia would count them twice; leave it out of 'effects', or use physics 'quasistatic'."
        )


def check_capabilities(backend: PhysicsBackend, chain: ChainModel, kind: str) -> None:
    """Raise `UserError` for kinds of joints that the engine does not have."""
    joints = {law.joint for law in chain.laws}
    unknown = joints - set(backend.capabilities.joints)
    if unknown:
        raise UserError(
            f"physics '{kind}' has no {', '.join(sorted(unknown))} joints; "
            f"it has {', '.join(backend.capabilities.joints)}."
        )
