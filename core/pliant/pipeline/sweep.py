"""The FEM data of many designs: the study's sweep over any executor, resumed from the store.

Every design is an artifact of its own, so that whatever ends a sweep, the next one goes on from the finished
designs, and within a design from its finished states. A design that cannot be had is a record with its cause.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from pliant.config.designs import SweptDesign, sweep_designs
from pliant.config.study import Study
from pliant.errors import InvalidDesignError, UserError
from pliant.execution.executors import (
    Executor,
    InlineExecutor,
    Workers,
    checked_workers,
    either,
    executor_for,
)
from pliant.execution.jobs import Finished, JobQueue
from pliant.execution.progress import Once, ProgressBar
from pliant.execution.progress_store import ProgressStore, progress_store_in
from pliant.pipeline.dataset import fem_stage
from pliant.pipeline.sweep_records import DesignOutcome, SweepRun
from pliant.pipeline.sweep_worker import Answer, SweepJob, solve
from pliant.pipeline.workbench import Workbench
from pliant.store.store import Artifact, ArtifactStore, CorruptedError, Recipe, load_artifact

POLL_S = 0.5
ARRIVES_WITHIN_S = 90.0


def sweep_study(
    bench: Workbench, study: Study, *, executor: Workers = None, workers: int | None = None
) -> SweepRun:
    """The FEM data of each design of the study's sweep.

    Args:
        bench: plugins, store, progress. Workers other than this process open the same store by its path.
        study: has `sweep`, `family`, `material` and `fem`.
        executor: any `concurrent.futures.Executor`, which is not shut down; or the address of a dask scheduler.
        workers: processes of our own instead; 1 solves in this process. By default one for each CPU.

    Raises:
        UserError: the study cannot be swept, or the workers cannot work (no store, other versions).
        NotReachedError: the executor broke, or processes cannot be started.
    """
    started = time.perf_counter()
    study.need("sweep", "a sweep")
    fem = study.need("fem", "FEM")
    chosen = either(executor, workers, "a sweep")
    if isinstance(chosen, int):
        checked_workers(chosen)
    bench = replace(bench, progress=Once(bench.progress))
    bench.build("fem", fem)
    bench.build("material", study.material)  # type: ignore[arg-type]
    outcomes, missing = _planned(bench, study, sweep_designs(study))
    possible = sum(outcome.status == "done" for outcome in outcomes.values()) + len(missing)
    bar = bench.progress.begin("designs", possible, done=possible - len(missing))
    try:
        if missing:
            with executor_for(chosen, len(missing)) as running:
                outcomes |= _Sweep(bench, study, missing, bar).run(running)
    finally:
        bar.finish()
    return SweepRun(study, tuple(outcomes[n] for n in sorted(outcomes)), time.perf_counter() - started)


class _Sweep:
    """One sweep under way: jobs out, answers in, until none is left."""

    def __init__(
        self, bench: Workbench, study: Study, missing: Mapping[int, tuple[SweptDesign, str]], bar: ProgressBar
    ) -> None:
        self.bench, self.study, self.missing, self.bar = bench, study, missing, bar
        self.outcomes: dict[int, DesignOutcome] = {}

    def run(self, executor: Executor) -> dict[int, DesignOutcome]:
        """Outcomes by number."""
        here = isinstance(executor, InlineExecutor)
        function = partial(solve, say=self.bar.describe) if here else solve
        with (
            progress_store_in(self.bench.store.root) as progress,
            JobQueue[SweepJob, Answer](executor, function, lambda job: progress.began(job.number)) as queue,
        ):
            for number in self.missing:
                queue.submit([self._job(number, progress)])
            while queue.waiting:
                for one in queue.completed(POLL_S):
                    progress.clear(one.item.number)
                    self._take(one, queue)
                self.bar.describe(progress.states(job.number for job in queue.running))
        return self.outcomes

    def _job(self, number: int, progress: ProgressStore) -> SweepJob:
        design, key = self.missing[number]
        configs = {
            "family": design.family.canonical(),
            "material": design.material.canonical(),
            "fem": self.study.need("fem", "FEM").canonical(),
        }
        plugins = tuple(str(file) for file in self.study.plugins)
        store = str(self.bench.store.root.resolve())
        return SweepJob(number, configs, plugins, store, str(progress.folder), key)

    def _take(self, one: Finished[SweepJob, Answer], queue: JobQueue[SweepJob, Answer]) -> None:
        number = one.item.number
        if one.failure is not None:
            status = "crashed" if one.failure.error is None else "error"
            answer = Answer(status, one.failure.cause)  # type: ignore[arg-type]
        else:
            answer = one.unwrap()
        for note in answer.notes:
            self.bench.progress.note(note)
        if answer.status == "stop":
            raise UserError(answer.cause)
        if answer.status == "busy":  # another sweep has it: later, and then with patience
            queue.submit([replace(one.item, waits=True)])
            return
        design, key = self.missing[number]
        if answer.status == "done":
            made = _arrived(self.bench.store.root / "fem" / key)
            self.outcomes[number] = DesignOutcome.of(design, made, cached=False)
        else:
            self.outcomes[number] = DesignOutcome(design, answer.status, answer.cause, wall_s=answer.wall_s)
        self.bar.advance()


def _arrived(folder: Path) -> Artifact:
    """An artifact that a worker has just written; a network file system may show it to us a while later."""
    until = time.monotonic() + ARRIVES_WITHIN_S
    while not folder.is_dir() and time.monotonic() < until:
        list(folder.parent.iterdir())
        time.sleep(POLL_S)
    try:
        return load_artifact(folder)
    except CorruptedError as error:
        raise UserError(
            f"{folder} was written by a worker and cannot be read here ({error}); is the store on a shared file system?"
        ) from None


class _MissingError(Exception):
    """An artifact is not in the store; its message is the key."""


class _Looking(ArtifactStore):
    """A store that computes nothing."""

    def make(self, recipe: Recipe, *_: Any) -> Artifact:
        found = self.find(recipe)
        if found is None:
            raise _MissingError(recipe.key)
        return found


def _planned(
    bench: Workbench, study: Study, designs: tuple[SweptDesign, ...]
) -> tuple[dict[int, DesignOutcome], dict[int, tuple[SweptDesign, str]]]:
    """By number: designs that are in the store or refused, and those to solve with their keys."""
    looking = replace(bench, store=_Looking(bench.store.root))
    known: dict[int, DesignOutcome] = {}
    missing: dict[int, tuple[SweptDesign, str]] = {}
    for design in designs:
        if design.cause:
            known[design.number] = DesignOutcome(design, "refused", design.cause)
            continue
        try:
            made = fem_stage(looking, design.family, design.material, study.need("fem", "FEM"))
            known[design.number] = DesignOutcome.of(design, made, cached=True)
        except InvalidDesignError as error:
            known[design.number] = DesignOutcome(design, "refused", str(error))
        except _MissingError as key:
            missing[design.number] = (design, str(key))
    return known, missing
