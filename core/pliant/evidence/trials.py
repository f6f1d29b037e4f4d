"""Trials of a study's task under many settings: each an artifact of the store, computed by any executor."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from pliant.config.study import Study
from pliant.errors import NotReachedError, UserError
from pliant.execution.executors import Executor, InlineExecutor, Workers, executor_for
from pliant.execution.jobs import Finished, JobQueue
from pliant.execution.progress import ProgressBar
from pliant.interfaces.effect import EffectConfig
from pliant.interfaces.task import TaskConfig
from pliant.pipeline.remote import RemoteStudy
from pliant.pipeline.simulate import ChainSource, simulate_stage
from pliant.pipeline.study import chain_of_study, physics_of_study
from pliant.pipeline.workbench import Workbench

SHARE = "success_share"


@dataclass(frozen=True)
class Setting:
    """A task's config with its conditions, noise and number of trials, and the effects in the model."""

    task: TaskConfig
    effects: tuple[EffectConfig, ...]


def simulate_trials(
    bench: Workbench, study: Study, settings: Sequence[Setting], workers: Workers = 1
) -> list[tuple[int, int]]:
    """Successes and trials of each setting; what the store has is not simulated again.

    Args:
        bench: plugins, store, progress.
        study: chain, physics and everything that settings share.
        settings: see `Setting`; trials of one seed draw the same random numbers in every setting.
        workers: see `executor_for`; 1 simulates in this process.

    Raises:
        UserError: a task that does not count successes, or an engine that cannot simulate it.
        NotReachedError: a setting killed its worker twice; the results of the others are in the store.
    """
    source = chain_of_study(bench, study)  # the law is there before workers begin
    bar = bench.progress.begin("simulating conditions", len(settings))
    try:
        with executor_for(workers, len(settings)) as executor:
            if isinstance(executor, InlineExecutor):
                done = _finished(executor, partial(_simulated, bench, study, source), settings, bar)
            else:
                modules = (__name__,) if executor.remote else ()
                remote = [RemoteStudy.of(bench, _with(study, setting), modules) for setting in settings]
                done = _finished(executor, simulate_remote, remote, bar)
    finally:
        bar.finish()
    return [one.unwrap() for one in done]


def _finished(
    executor: Executor, function: Callable[[Any], tuple[int, int]], items: Sequence[Any], bar: ProgressBar
) -> list[Finished[Any, tuple[int, int]]]:
    found = []
    with JobQueue(executor, function) as queue:
        for one in queue.each(items):
            found.append(one)
            bar.advance()
    return found


def simulate_remote(remote: RemoteStudy) -> tuple[int, int]:
    """What a worker does: the task of a study, through the shared store."""
    bench, study = remote.open()
    setting = Setting(study.need("task", "a simulation"), study.effects)
    return _simulated(bench, study, chain_of_study(bench, study), setting)


def _with(study: Study, setting: Setting) -> Study:
    """The study of one setting; its task has the study's noise."""
    changes = {"task": setting.task, "effects": setting.effects}
    return study.model_copy(update={**changes, "noise": None, "measurements": None, "cross_check": ()})


def _simulated(bench: Workbench, study: Study, source: ChainSource, setting: Setting) -> tuple[int, int]:
    made = simulate_stage(bench, source, physics_of_study(bench, study), setting.task, setting.effects)
    return _count(made.value.metrics, setting.task)


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
