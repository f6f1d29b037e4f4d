"""FEM data of many designs: the study's sweep over any executor, resumed from the store.

Every design is a separate artifact, so that after an interruption the next sweep resumes from the finished designs,
and a design from its finished states. A design without data is a record with its cause.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pliant.config.study import Study
from pliant.errors import InvalidDesignError, NotReachedError, UserError
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
from pliant.execution.progress_store import progress_store_in
from pliant.pipeline.dataset import fem_stage
from pliant.pipeline.workbench import RunContext
from pliant.records.fem import PASSED, SELF_CONTACT, ModuleData
from pliant.store.parcel import received
from pliant.store.store import (
    Artifact,
    ArtifactStore,
    CorruptedError,
    Recipe,
    load_artifact,
)
from pliant_designs.sweep_designs import SweptDesign, sweep_designs
from pliant_designs.sweep_jobs import Status, SweepJob, WorkerOutcome, solve

POLL_S = 0.5
ARRIVES_WITHIN_S = 90.0


@dataclass(frozen=True)
class DesignOutcome:
    """Outcome of one design of a sweep.

    Attributes:
        design: the requested design.
        status: done, refused (by its family), not_reached (its FEM), error (unexpected), crashed (its worker died).
        cause: why it is not done.
        key: of its artifact in the store; "" without one.
        folder: of the artifact.
        n_states, n_failed, self_contact: states solved, not reached, and solved with overlapping convolutions.
        passed_through: overlapping states that `fem.self_contact: pass` allows.
        free_angle_rad: the largest angle of the free branch (m for a prismatic joint).
        joint: kind of the module's joint.
        wall_s: time of its FEM when it was solved.
        cached: whether it existed before this sweep.
        failed: the states that were not reached.
    """

    design: SweptDesign
    status: Status
    cause: str = ""
    key: str = ""
    folder: Path | None = None
    n_states: int = 0
    n_failed: int = 0
    self_contact: int = 0
    passed_through: int = 0
    free_angle_rad: float | None = None
    joint: str = "revolute"
    wall_s: float = 0.0
    cached: bool = False
    failed: tuple[Mapping[str, object], ...] = ()

    @staticmethod
    def from_artifact(design: SweptDesign, made: Artifact, cached: bool) -> DesignOutcome:
        """Return the outcome of a design that has data."""
        data: ModuleData = made.value
        free = data.branch == "free"
        main = data.deformation[:, data.axes.index(data.main_axis)]
        return DesignOutcome(
            design,
            "done",
            key=made.key,
            folder=made.folder,
            n_states=len(data),
            n_failed=len(data.failed),
            self_contact=int(np.sum(data.status == SELF_CONTACT)),
            passed_through=int(np.sum(data.status == PASSED)),
            free_angle_rad=float(main[free].max()) if free.any() else None,
            joint=data.joint,
            wall_s=float(made.manifest["wall_s"]),
            cached=cached,
            failed=data.failed,
        )

    def data(self) -> ModuleData:
        """Return the design's FEM data. Raises `NotReachedError` if it has none."""
        if self.folder is None:
            raise NotReachedError(f"design {self.design.number} has no FEM data: {self.cause}")
        value: ModuleData = load_artifact(self.folder).value
        return value


@dataclass(frozen=True)
class SweepRun:
    """All designs of a sweep, in its order."""

    study: Study
    outcomes: tuple[DesignOutcome, ...]
    wall_s: float

    def done(self) -> tuple[DesignOutcome, ...]:
        """Return the designs that have data."""
        return tuple(o for o in self.outcomes if o.status == "done")

    def refused(self) -> tuple[DesignOutcome, ...]:
        """Return the designs that the family refuses."""
        return tuple(o for o in self.outcomes if o.status == "refused")

    def failed(self) -> tuple[DesignOutcome, ...]:
        """Return the possible designs without data."""
        return tuple(o for o in self.outcomes if o.status not in ("done", "refused"))

    def data(self) -> Iterator[tuple[SweptDesign, ModuleData]]:
        """Yield each finished design with its data, read from the store one by one."""
        for outcome in self.done():
            yield outcome.design, outcome.data()


def sweep_study(
    context: RunContext, study: Study, *, executor: Workers = None, workers: int | None = None
) -> SweepRun:
    """Return the FEM data of each design of the study's sweep.

    Args:
        context: plugins, store, progress. Workers other than this process open the same store by its path.
        study: has `sweep`, `family`, `material` and `fem`.
        executor: any `concurrent.futures.Executor`, which is not shut down; or the address of a dask scheduler.
        workers: number of local processes instead; 1 solves in this process. Default: the study's, or one per CPU.

    Raises:
        UserError: the study cannot be swept, or the workers cannot work (no store, other versions).
        NotReachedError: the executor broke, or processes cannot be started.
    """
    started = time.perf_counter()
    study.need("sweep", "a sweep")
    fem = study.need("fem", "FEM")
    chosen = study.resolve_workers(either(executor, workers, "a sweep"))
    if isinstance(chosen, int):
        checked_workers(chosen)
    context = replace(context, progress=Once(context.progress))
    context.build("fem", fem)
    context.build("material", study.material)  # type: ignore[arg-type]
    outcomes, missing = _planned(context, study, sweep_designs(study))
    possible = sum(outcome.status == "done" for outcome in outcomes.values()) + len(missing)
    bar = context.progress.begin("designs", possible, done=possible - len(missing))
    try:
        if missing:
            with executor_for(chosen, len(missing)) as running:
                outcomes |= _run(context, study, missing, running, bar)
    finally:
        bar.finish()
    for outcome in outcomes.values():
        if outcome.key:  # workers do not have the study
            context.store.uses.note("fem", outcome.key)
    return SweepRun(study, tuple(outcomes[n] for n in sorted(outcomes)), time.perf_counter() - started)


def _run(
    context: RunContext,
    study: Study,
    missing: Mapping[int, tuple[SweptDesign, str]],
    executor: Executor,
    bar: ProgressBar,
) -> dict[int, DesignOutcome]:
    """Submit jobs and collect answers until all are done; return outcomes by number."""
    outcomes: dict[int, DesignOutcome] = {}
    root = context.store.root

    def take(one: Finished[SweepJob, WorkerOutcome], queue: JobQueue[SweepJob, WorkerOutcome]) -> None:
        number = one.item.number
        if one.failure is not None:
            status: Status = "crashed" if one.failure.error is None else "error"
            answer = WorkerOutcome(status, one.failure.cause)
        else:
            answer = one.unwrap()
        for note in answer.notes:
            context.progress.note(note)
        if answer.status == "stop":
            raise UserError(answer.cause)
        if answer.status == "busy":  # another sweep is solving it: submit it again and wait for it
            queue.submit([replace(one.item, waits=True)])
            return
        design, key = missing[number]
        if answer.status == "done":
            if answer.parcel:
                _take_in(answer.parcel, root / "fem" / key)
            outcomes[number] = DesignOutcome.from_artifact(design, _arrived(root / "fem" / key), cached=False)
        else:
            outcomes[number] = DesignOutcome(design, answer.status, answer.cause, wall_s=answer.wall_s)
        bar.advance()

    function = partial(solve, say=bar.describe) if isinstance(executor, InlineExecutor) else solve
    plugins = tuple(str(file) for file in study.plugins)
    with (
        progress_store_in(root) as progress,
        JobQueue[SweepJob, WorkerOutcome](
            executor, function, lambda job: progress.began(job.number)
        ) as queue,
    ):
        for number, (design, key) in missing.items():
            blocks = {"family": design.family, "material": design.material, "fem": study.need("fem", "FEM")}
            configs = {name: block.canonical() for name, block in blocks.items()}
            queue.submit([SweepJob(number, configs, plugins, str(root.resolve()), str(progress.folder), key)])
        while queue.waiting:
            for one in queue.completed(POLL_S):
                progress.clear(one.item.number)
                take(one, queue)
            bar.describe(progress.states(job.number for job in queue.running))
    return outcomes


def _take_in(parcel: bytes, folder: Path) -> None:
    """Put an artifact from a worker on another host into the store."""
    try:
        received(parcel, folder)
    except CorruptedError as error:
        raise UserError(f"{folder.name}: a worker's artifact cannot be read here ({error}).") from None


def _arrived(folder: Path) -> Artifact:
    """Return an artifact that a worker has just written; it may appear late on a network file system."""
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
    """Error for an artifact that is not in the store; its message is the key."""


class _Looking(ArtifactStore):
    """A store that computes nothing."""

    def make(self, recipe: Recipe, *_: Any) -> Artifact:
        found = self.find(recipe)
        if found is None:
            raise _MissingError(recipe.key)
        return found


def _planned(
    context: RunContext, study: Study, designs: tuple[SweptDesign, ...]
) -> tuple[dict[int, DesignOutcome], dict[int, tuple[SweptDesign, str]]]:
    """Return by number the designs that are in the store or refused, and those to solve with their keys."""
    looking = replace(context, store=_Looking(context.store.root))
    known: dict[int, DesignOutcome] = {}
    missing: dict[int, tuple[SweptDesign, str]] = {}
    for design in designs:
        try:
            if design.cause:
                raise InvalidDesignError(design.cause)
            made = fem_stage(looking, design.family, design.material, study.need("fem", "FEM"))
            known[design.number] = DesignOutcome.from_artifact(design, made, cached=True)
        except InvalidDesignError as error:
            known[design.number] = DesignOutcome(design, "refused", str(error))
        except _MissingError as key:
            missing[design.number] = (design, str(key))
    return known, missing
