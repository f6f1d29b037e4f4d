"""Checks that an engine supports what a study requires; each refusal is one sentence."""

from __future__ import annotations

from pliant.config.chain import MountConfig
from pliant.config.study import Study
from pliant.errors import MissingDependencyError, UserError
from pliant.interfaces.physics import (
    HistoryBackend,
    MountBackend,
    PhysicsBackend,
    PhysicsConfig,
    SceneBackend,
    StaticSceneBackend,
)
from pliant.interfaces.task import SceneTask, Task
from pliant.pipeline.workbench import RunContext
from pliant.records.chain import ChainModel


def check_engines(context: RunContext, study: Study, *kinds: PhysicsConfig) -> None:
    """Check requirements that need no law, so that nothing is solved for a study that its engines refuse.

    Args:
        context: plugins, store, progress.
        study: with its task.
        kinds: the engines; engines that are not installed are reported when they are built.
    """
    task: Task | SceneTask | None = None if study.task is None else context.build("task", study.task)
    for config in kinds:
        try:
            backend: PhysicsBackend = context.build("physics", config)
        except MissingDependencyError:
            continue
        check_asked(backend, task)
        if study.chain is not None and study.chain.base.mount is not None:
            check_mount(backend, task, study.chain.base.mount)


def check_asked(backend: PhysicsBackend, task: Task | SceneTask | None) -> None:
    """Raise `UserError` if the task needs contact, or contact between fingers, and the engine has none."""
    kind = backend.config.kind
    if not isinstance(task, SceneTask):
        return
    if task.settles and isinstance(backend, StaticSceneBackend):
        return
    if not isinstance(backend, SceneBackend):
        raise UserError(
            f"physics '{kind}' has no contacts, which this task needs; use 'mujoco' or 'pybullet'."
        )
    if task.arms_touch and not backend.capabilities.arms_touch:
        raise UserError(
            f"physics '{kind}' has no contact between fingers, which this task requires; use 'mujoco', or "
            "leave 'finger_contact' out."
        )
    if task.free_bases and not backend.capabilities.free_bases:
        raise UserError(
            f"physics '{kind}' has no chains on a free base, which task '{task.config.kind}' needs; use 'mujoco' or "
            "'pybullet'."
        )


def check_mount(backend: PhysicsBackend, task: Task | SceneTask | None, mount: MountConfig) -> None:
    """Raise `UserError` if the engine or the task does not support a chain on a mount, or the mount does not exist."""
    if not isinstance(backend, MountBackend):
        raise UserError(no_mount(backend.config.kind))
    if task is not None and not task.mounts:
        raise UserError(
            f"task '{task.config.kind}' needs a base that stays where it is; leave 'chain.base.mount' out, or take "
            "another task, such as 'tip_load' or 'follow_pressure'."
        )
    backend.check_mount(mount.record())


def no_mount(kind: str) -> str:
    """Return the message for an engine that cannot simulate a chain on an imported arm."""
    return (
        f"physics '{kind}' cannot put a chain on an arm: use 'mujoco', also for 'cross_check', or leave "
        "'chain.base.mount' out."
    )


def require_histories(backend: PhysicsBackend) -> HistoryBackend:
    """Return the engine if it follows histories; raise `UserError` otherwise."""
    if isinstance(backend, HistoryBackend):
        return backend
    raise UserError(
        f"physics '{backend.config.kind}' cannot follow measured histories; comparing with measurements "
        "needs 'physics: quasistatic' or 'physics: mujoco'."
    )


def check_terms(backend: PhysicsBackend, chain: ChainModel) -> None:
    """Raise `UserError` for law terms that the engine does not support."""
    if any(term.needs_time for term in chain.terms) and not isinstance(backend, HistoryBackend):
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
    """Raise `UserError` for joint types and mounts that the engine does not support."""
    if chain.mount is not None and not isinstance(backend, MountBackend):
        raise UserError(no_mount(kind))
    joints = {law.joint for law in chain.laws}
    unknown = joints - set(backend.capabilities.joints)
    if unknown:
        raise UserError(
            f"physics '{kind}' has no {', '.join(sorted(unknown))} joints; "
            f"it has {', '.join(backend.capabilities.joints)}."
        )
