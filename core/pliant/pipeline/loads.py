"""Simulation of the task under fractions of its load, for a page's load slider."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.effect import Effect, EffectConfig
from pliant.interfaces.physics import PhysicsBackend, PhysicsConfig
from pliant.interfaces.task import SceneTask, TaskConfig
from pliant.pipeline.simulate import ChainSource, run_task
from pliant.pipeline.workbench import RunContext, content
from pliant.records.load_frames import LoadFrames
from pliant.records.rollout import Rollout, TaskResult
from pliant.store.store import Artifact

SHARES = (0.0, 0.25, 0.5, 0.75)  # in addition to the full load


def loads_stage(
    context: RunContext,
    source: ChainSource,
    physics: PhysicsConfig,
    task: TaskConfig,
    effects: Sequence[EffectConfig],
    own: TaskResult,
) -> Artifact | None:
    """Return the `LoadFrames` of a task with the result `own`; None without a load, a history, or a static engine.

    Only static engines are used: a motion in time under five loads would take five times as long.
    """
    backend: PhysicsBackend = context.build("physics", physics)
    payload_kg, force_n = task.tip_load(source.chain.payload_kg)
    loaded = payload_kg > 0.0 or force_n > 0.0
    scene = isinstance(context.build("task", task), SceneTask)
    if not loaded or scene or own.rollout is None or backend.capabilities.dynamic or not own.final.at_rest:
        return None
    nominal = own.rollout

    def compute(partial: Path) -> LoadFrames:
        built: list[Effect] = [context.build("effect", effect) for effect in effects]
        found = [(1.0, nominal)]
        for share in reversed(SHARES):
            chain = source.chain.with_(payload_kg=share * source.chain.payload_kg)
            try:
                lighter = run_task(
                    backend, context.build("task", _lightened(task, share)), built, chain
                ).rollout
            except UserError:
                continue  # for example outside the law's data: not shown
            if lighter is None or not _comparable(lighter, nominal):
                break  # a task that searches its actuation finds another one for another load
            found.append((share, lighter))
        found.reverse()
        return LoadFrames(
            payload_kg,
            force_n,
            np.array([share for share, _ in found]),
            np.stack([history.joint_angles for _, history in found]),
            np.stack([history.markers_m for _, history in found]),
        )

    plugins = [("physics", physics), ("task", task), *(("effect", effect) for effect in effects)]
    return context.make(
        "loads",
        compute,
        components=[*source.components, *(context.component(name, config) for name, config in plugins)],
        modules=["pliant.pipeline.loads", "pliant.pipeline.simulate", "pliant.pipeline.chain"],
        config={
            **source.config,
            "physics": content(physics),
            "task": content(task),
            "effects": [content(effect) for effect in effects],
        },
        inputs=source.inputs,
    )


def _lightened(task: TaskConfig, share: float) -> TaskConfig:
    """Return the task with its stated loads multiplied by a share."""
    named = {name: getattr(task, name, None) for name in ("payload_kg", "tip_force_n")}
    scaled = {
        name: tuple(share * v for v in value) if isinstance(value, tuple) else share * value
        for name, value in named.items()
        if value is not None
    }
    return task.model_copy(update=scaled)


def _comparable(history: Rollout, other: Rollout) -> bool:
    return (
        history.actuation.shape == other.actuation.shape
        and np.allclose(history.actuation, other.actuation)
        and bool(np.isfinite(history.markers_m).all())
    )
