"""What a study asks of an engine that does not have it, each refused in one sentence."""

from __future__ import annotations

from pliant.config.chain import MountConfig
from pliant.config.study import Study
from pliant.errors import MissingDependencyError, UserError
from pliant.interfaces.physics import PhysicsBackend, PhysicsConfig
from pliant.interfaces.task import SceneTask, Task
from pliant.pipeline.workbench import Workbench
from pliant.records.chain import ChainModel


def check_engines(bench: Workbench, study: Study, *kinds: PhysicsConfig) -> None:
    """Ask what needs no law, so that nothing is solved for a study that its engines refuse.

    Args:
        bench: the surroundings.
        study: with its task.
        kinds: the engines; those that are not installed are left to whoever builds them.
    """
    task: Task | SceneTask | None = None if study.task is None else bench.build("task", study.task)
    for config in kinds:
        try:
            backend: PhysicsBackend = bench.build("physics", config)
        except MissingDependencyError:
            continue
        check_asked(backend, task)
        if study.chain is not None and study.chain.base.mount is not None:
            check_mount(backend, task, study.chain.base.mount)


def check_asked(backend: PhysicsBackend, task: Task | SceneTask | None) -> None:
    """Raise `UserError` where the task needs contact, or fingers that touch each other, and the engine has none."""
    kind, can = backend.config.kind, backend.capabilities
    if not isinstance(task, SceneTask):
        return
    if not can.contacts:
        raise UserError(
            f"physics '{kind}' has no contacts, which this task needs; use 'mujoco' or 'pybullet'."
        )
    if task.arms_touch and not can.arms_touch:
        raise UserError(
            f"physics '{kind}' lets fingers go through each other, and this task wants them to touch; use 'mujoco', or "
            "leave 'finger_contact' out."
        )


def check_mount(backend: PhysicsBackend, task: Task | SceneTask | None, mount: MountConfig) -> None:
    """Raise `UserError` where the engine or the task cannot have a chain on a mount, or the mount is not there."""
    if not backend.capabilities.mounts:
        raise UserError(no_mount(backend.config.kind))
    if task is not None and not task.mounts:
        raise UserError(
            f"task '{task.config.kind}' needs a base that stays where it is; leave 'chain.base.mount' out, or take "
            "another task, such as 'tip_load' or 'follow_pressure'."
        )
    backend.check_mount(mount.record())


def no_mount(kind: str) -> str:
    """The sentence on an engine that cannot carry a chain on somebody else's arm."""
    return (
        f"physics '{kind}' cannot put a chain on an arm: use 'mujoco', also for 'cross_check', or leave "
        "'chain.base.mount' out."
    )


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
    """Raise `UserError` for kinds of joints that the engine does not have, and for a mount that it cannot carry."""
    if chain.mount is not None and not backend.capabilities.mounts:
        raise UserError(no_mount(kind))
    joints = {law.joint for law in chain.laws}
    unknown = joints - set(backend.capabilities.joints)
    if unknown:
        raise UserError(
            f"physics '{kind}' has no {', '.join(sorted(unknown))} joints; "
            f"it has {', '.join(backend.capabilities.joints)}."
        )
