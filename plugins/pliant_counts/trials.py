"""Simulation of a study's task under many settings, each an artifact of the store, by any executor."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from pliant.config.study import Study
from pliant.errors import NotReachedError, UserError
from pliant.execution.executors import InlineExecutor, Workers, executor_for
from pliant.execution.jobs import JobQueue
from pliant.interfaces.effect import EffectConfig
from pliant.interfaces.task import TaskConfig
from pliant.pipeline.remote import RemoteStudy
from pliant.pipeline.simulate import ChainSource, simulate_stage
from pliant.pipeline.study import build_study_chain, study_physics
from pliant.pipeline.workbench import RunContext
from pliant_counts.binomial import Count

SHARE = "success_share"


@dataclass(frozen=True)
class Setting:
    """A task's config with its conditions, noise and number of trials, and the effects in the model."""

    task: TaskConfig
    effects: tuple[EffectConfig, ...]


def simulate_trials(
    context: RunContext, study: Study, settings: Sequence[Setting], workers: Workers = 1
) -> list[Count]:
    """Return successes and trials of each setting; results in the store are reused.

    Args:
        context: plugins, store, progress.
        study: chain, physics and everything else that the settings share.
        settings: see `Setting`; trials of one seed draw the same random numbers in every setting.
        workers: see `executor_for`; 1 simulates in this process.

    Raises:
        UserError: a task that does not count successes, or an engine that cannot simulate it.
        NotReachedError: a setting killed its worker twice; the results of the others are in the store.
    """
    source = build_study_chain(context, study)  # the law is stored before workers begin
    bar = context.progress.begin("simulating conditions", len(settings))
    function: Callable[[Any], Count] = partial(_simulated, context, study, source)
    items: Sequence[Any] = settings
    done = []
    try:
        with executor_for(workers, len(settings)) as executor:
            if not isinstance(executor, InlineExecutor):
                modules = (__name__,) if executor.remote else ()
                items = [
                    RemoteStudy.from_study(context, _with(study, setting), modules) for setting in settings
                ]
                function = simulate_remote
            with JobQueue(executor, function) as queue:
                for one in queue.each(items):
                    done.append(one)
                    bar.advance()
    finally:
        bar.finish()
    return [one.unwrap() for one in done]


def simulate_remote(remote: RemoteStudy) -> tuple[int, int]:
    """Run the task of a study in a worker, through the shared store."""
    context, study = remote.open()
    setting = Setting(study.need("task", "a simulation"), study.effects)
    return _simulated(context, study, build_study_chain(context, study), setting)


def _with(study: Study, setting: Setting) -> Study:
    """Return the study of one setting; its task includes the study's noise."""
    changes = {"task": setting.task, "effects": setting.effects}
    return study.model_copy(update={**changes, "noise": None, "measurements": None, "cross_check": ()})


def _simulated(context: RunContext, study: Study, source: ChainSource, setting: Setting) -> Count:
    task = setting.task
    made = simulate_stage(context, source, study_physics(context, study), task, setting.effects)
    share, trials = made.value.metrics.get(SHARE), int(getattr(task, "trials", 1))
    if share is None:
        raise UserError(
            f"task '{task.kind}' does not say how many trials succeed ('{SHARE}'); counts need one."
        )
    if not 0.0 <= share <= 1.0:
        raise NotReachedError(f"task '{task.kind}' gives a share of successes of {share:g}")
    return round(share * trials), trials
