"""Trials of a study's task under many settings: each an artifact of the store, computed here or by two processes."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pliant.config.study import Study, study_model
from pliant.errors import NotReachedError, UserError
from pliant.interfaces.effect import EffectConfig
from pliant.interfaces.task import TaskConfig
from pliant.pipeline.crews import Processes
from pliant.pipeline.progress import Task
from pliant.pipeline.simulate import ChainSource, simulate_stage
from pliant.pipeline.study import chain_of_study, physics_of_study
from pliant.pipeline.workbench import Workbench
from pliant.registry.discovery import discover
from pliant.registry.files import with_files
from pliant.store.store import ArtifactStore

SHARE = "success_share"


@dataclass(frozen=True)
class Setting:
    """A task's config with its conditions, noise and number of trials, and the effects in the model."""

    task: TaskConfig
    effects: tuple[EffectConfig, ...]


@dataclass(frozen=True)
class Job:
    """One setting for a worker: the whole study as JSON values, its Python files, the store's root."""

    study: dict[str, Any]
    plugins: tuple[str, ...]
    store: str


def simulate_trials(
    bench: Workbench, study: Study, settings: Sequence[Setting], workers: int = 1
) -> list[tuple[int, int]]:
    """Successes and trials of each setting; what the store has is not simulated again.

    Args:
        bench: plugins, store, progress.
        study: chain, physics and everything that settings share.
        settings: see `Setting`; trials of one seed draw the same random numbers in every setting.
        workers: processes; 1 simulates in this one.

    Raises:
        UserError: a task that does not count successes, or an engine that cannot simulate it.
    """
    source = chain_of_study(bench, study)  # the law is there before workers begin
    bar = bench.progress.begin("simulating conditions", len(settings))
    try:
        if workers > 1 and len(settings) > 1:
            return _by_processes(bench, study, settings, workers, bar)
        return _here(bench, study, source, settings, bar)
    finally:
        bar.finish()


def _here(
    bench: Workbench, study: Study, source: ChainSource, settings: Sequence[Setting], bar: Task
) -> list[tuple[int, int]]:
    physics = physics_of_study(bench, study)
    found = []
    for setting in settings:
        made = simulate_stage(bench, source, physics, setting.task, setting.effects)
        found.append(_count(made.value.metrics, setting.task))
        bar.advance()
    return found


def _by_processes(
    bench: Workbench, study: Study, settings: Sequence[Setting], workers: int, bar: Task
) -> list[tuple[int, int]]:
    crew = Processes(min(workers, len(settings)), simulate_job)
    whole = False
    running: dict[Future[tuple[int, int]], int] = {}
    found: dict[int, tuple[int, int]] = {}
    queue = list(enumerate(settings))[::-1]
    store = str(bench.store.root.resolve())
    plugins = tuple(str(file) for file in study.plugins)
    try:
        while queue or running:
            while queue and len(running) < workers:
                number, setting = queue.pop()
                running[crew.submit(Job(_json(study, setting), plugins, store))] = number
            ended, _ = wait(running, return_when=FIRST_COMPLETED, timeout=0.5)
            for future in ended:
                found[running.pop(future)] = future.result()
                bar.advance()
        whole = True
    finally:
        crew.stop(at_once=not whole)
    return [found[number] for number in range(len(settings))]


def simulate_job(job: Job) -> tuple[int, int]:
    """What a worker does: the study from its JSON values, one setting, through the shared store."""
    registry = with_files(discover(), [Path(file) for file in job.plugins])
    study = study_model(job.study, registry).model_validate(job.study)
    bench = Workbench(registry, ArtifactStore(Path(job.store)))
    setting = Setting(study.need("task", "a simulation"), study.effects)
    return _here(bench, study, chain_of_study(bench, study), [setting], bench.progress.begin("", 1))[0]


def _json(study: Study, setting: Setting) -> dict[str, Any]:
    raw = {key: value for key, value in study.canonical().items() if value is not None}
    raw |= {"task": setting.task.canonical(), "effects": [effect.canonical() for effect in setting.effects]}
    return {key: value for key, value in raw.items() if key not in ("noise", "measurements", "cross_check")}


def _count(metrics: Any, task: TaskConfig) -> tuple[int, int]:
    share = metrics.get(SHARE)
    trials = int(getattr(task, "trials", 1))
    if share is None:
        raise UserError(
            f"task '{task.kind}' does not say how many trials succeed ('{SHARE}'); counts need one."
        )
    if not 0.0 <= share <= 1.0:
        raise NotReachedError(f"task '{task.kind}' gives a share of successes of {share:g}")
    return round(share * trials), trials
