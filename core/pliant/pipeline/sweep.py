"""FEM data of many designs: the study's sweep over any executor, resumed from the store.

Every design is a separate artifact, so that after an interruption the next sweep resumes from the finished designs,
and a design from its finished states. A design without data is a record with its cause.
"""

from __future__ import annotations

import csv
import io
import platform
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from pliant.config.designs import SweptDesign, material_parameters, sweep_designs
from pliant.config.study import Study
from pliant.errors import InvalidDesignError, NotReachedError, PliantError, UserError
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
from pliant.execution.progress_store import JobProgress, progress_store_in
from pliant.fem_tables.writing import write_table
from pliant.pipeline.dataset import fem_stage
from pliant.pipeline.remote import other_version, registry_with, store_seen
from pliant.pipeline.workbench import RunContext
from pliant.records.fem import PASSED, SELF_CONTACT, ModuleData
from pliant.store.parcel import packed, received
from pliant.store.store import (
    Artifact,
    ArtifactStore,
    CorruptedError,
    Recipe,
    load_artifact,
    write_atomically,
)

Status = Literal["done", "refused", "not_reached", "error", "crashed", "busy", "stop"]
POLL_S = 0.5
ARRIVES_WITHIN_S = 90.0
NUMBER = "design"  # column of a sweep's table


@dataclass(frozen=True)
class SweepJob:
    """One design for a worker.

    Attributes:
        number: of the design in its sweep.
        configs: family, material and fem as JSON values.
        plugins: Python files with the user's kinds.
        store: root of the store.
        progress: a folder that the driver made in the store (`ProgressStore`): its presence shows that the store is
            shared; a worker that does not see it uses a local store and returns its artifact as bytes.
        key: of the artifact, by the driver's code and libraries.
        waits: whether to wait for another process that is computing this design; else the answer is "busy".
    """

    number: int
    configs: Mapping[str, Any]
    plugins: tuple[str, ...]
    store: str
    progress: str
    key: str
    waits: bool = False


@dataclass(frozen=True)
class WorkerOutcome:
    """Outcome of a design in a worker: `stop` is a mistake that affects every design.

    `parcel` is the artifact as bytes, from a worker that does not see the store.
    """

    status: Status
    cause: str = ""
    wall_s: float = 0.0
    notes: tuple[str, ...] = ()
    parcel: bytes = b""


def solve(job: SweepJob, say: Callable[[str], None] | None = None) -> WorkerOutcome:
    """Solve one design in a worker, unless the store has it; `say` is notified of its states in this process.

    The worker finds its own plugins and opens the store by its path, or a store of its host. It never raises: every
    failure of a design is an answer.
    """
    started = time.perf_counter()
    progress: JobProgress | None = None
    status: Status = "stop"
    parcel = b""
    try:
        store = ArtifactStore(store_seen(Path(job.progress), job.store))
        shared = store.root == Path(job.store)
        with tempfile.TemporaryDirectory() if not shared else nullcontext(job.progress) as folder:
            progress = JobProgress(Path(folder) / str(job.number), say)
            if not job.waits and store.computed_elsewhere("fem", job.key):
                return WorkerOutcome("busy")
            status, cause = _solved(job, RunContext(registry_with(job.plugins), store, progress))
        if status == "done" and not shared:
            parcel = packed(store.root / "fem" / job.key)
    except PliantError as error:
        cause = str(error)
    except OSError as error:  # the folder or the store was removed
        status, cause = "stop", f"worker on {platform.node()}: {error}."
    notes = tuple(progress.notes) if progress else ()
    return WorkerOutcome(status, cause, time.perf_counter() - started, notes, parcel)


def _solved(job: SweepJob, context: RunContext) -> tuple[Status, str]:
    """Return status and cause; raise `UserError` for mistakes that affect every design."""
    try:
        family, material, fem = (
            context.registry.config_model(interface, config).model_validate(config)
            for interface, config in job.configs.items()
        )
        made = fem_stage(context, family, material, fem)  # type: ignore[arg-type]
    except InvalidDesignError as error:
        return "refused", str(error)
    except NotReachedError as error:
        return "not_reached", str(error)
    except UserError:
        raise
    except (Exception, SystemExit) as error:  # a plugin may raise anything
        return "error", ": ".join(filter(None, (type(error).__name__, " ".join(str(error).split()))))
    if made.key != job.key:
        raise other_version(" (its result has another key)")
    return "done", ""


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


def write_sweep_table(run: SweepRun, path: Path, digits: int | None = None) -> None:
    """Write the states of all finished designs; a parameter that a design lacks is blank.

    Columns `material.…` state the rubber, so that a study with another one is refused.
    The file is written atomically; without any design it has only a header.

    Args:
        run: the sweep.
        path: of the table.
        digits: significant digits of the states' numbers; all by default. Parameters of designs are not rounded.
    """
    designs = ((d.number, d.changes, data, material_parameters(d.material)) for d, data in run.data())
    write_designs(designs, path, digits, tuple(run.outcomes[0].design.changes if run.outcomes else ()))


def write_designs(
    designs: Iterable[tuple[int, Mapping[str, Any], ModuleData, Mapping[str, Any] | None]],
    path: Path,
    digits: int | None = None,
    names: Sequence[str] = (),
) -> None:
    """Write the states of several designs as one table.

    Args:
        designs: number, parameters, data and material constants of each.
        path: of the table.
        digits: as for `write_sweep_table`.
        names: parameters that have a column even without a design.
    """
    columns: dict[str, None] = {}
    rows: list[dict[str, str]] = []
    with tempfile.TemporaryDirectory() as folder:
        part = Path(folder) / "part.csv"
        for number, changes, data, material in designs:
            write_table(data, part, material)
            with part.open(encoding="utf-8", newline="") as file:
                reader = csv.DictReader(file)
                columns |= dict.fromkeys(reader.fieldnames or ())
                for row in reader:
                    row = row if digits is None else {k: shortened(cell, digits) for k, cell in row.items()}
                    own = {name: str(value) for name, value in changes.items()}
                    rows.append({**own, **row, NUMBER: str(number)})
    columns |= dict.fromkeys([*names, NUMBER])
    text = io.StringIO()
    writer = csv.DictWriter(text, list(columns), restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_atomically(path, text.getvalue())


def shortened(cell: str, digits: int) -> str:
    """Return a number with `digits` significant digits; integers and words are unchanged."""
    try:
        return cell if cell.lstrip("-").isdecimal() else f"{float(cell):.{digits}g}"
    except ValueError:
        return cell


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
