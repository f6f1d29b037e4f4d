"""The FEM data of many designs: the study's sweep over any executor, resumed from the store.

Every design is an artifact of its own, so that whatever ends a sweep, the next one goes on from the finished
designs, and within a design from its finished states. A design that cannot be had is a record with its cause.
"""

from __future__ import annotations

import time
from concurrent.futures import Executor
from dataclasses import replace
from typing import Any

from pliant.config.designs import SweptDesign, sweep_designs
from pliant.config.study import Study
from pliant.errors import InvalidDesignError, UserError
from pliant.pipeline.crews import Crew, Given, Here, Processes, checked_workers, cpus
from pliant.pipeline.dataset import fem_stage
from pliant.pipeline.progress import Once, Task
from pliant.pipeline.sweep_drive import Drive
from pliant.pipeline.sweep_records import DesignOutcome, SweepRun
from pliant.pipeline.workbench import Workbench
from pliant.store.store import Artifact, ArtifactStore, Recipe


def sweep_study(
    bench: Workbench, study: Study, *, executor: Executor | None = None, workers: int | None = None
) -> SweepRun:
    """The FEM data of each design of the study's sweep.

    Args:
        bench: plugins, store, progress. Workers other than this process open the same store by its path.
        study: has `sweep`, `family`, `material` and `fem`.
        executor: any `concurrent.futures.Executor`; it is not shut down.
        workers: processes of our own instead; 1 solves in this process. By default one for each CPU.

    Raises:
        UserError: the study cannot be swept, or the workers cannot work (no store, other versions).
        NotReachedError: the executor broke, or processes cannot be started.
    """
    started = time.perf_counter()
    study.need("sweep", "a sweep")
    fem = study.need("fem", "FEM")
    if executor is not None and workers is not None:
        raise UserError("a sweep takes an executor or a number of workers, not both.")
    count = checked_workers(cpus() if workers is None else workers)
    bench = replace(bench, progress=Once(bench.progress))
    bench.build("fem", fem)
    bench.build("material", study.material)  # type: ignore[arg-type]
    outcomes, missing = _planned(bench, study, sweep_designs(study))
    possible = sum(outcome.status == "done" for outcome in outcomes.values()) + len(missing)
    bar = bench.progress.begin("designs", possible, done=possible - len(missing))
    try:
        if missing:
            crew = _crew(executor, min(count, len(missing)), bar)
            outcomes |= Drive(bench, study, crew, bar, missing).run()
    finally:
        bar.finish()
    return SweepRun(study, tuple(outcomes[n] for n in sorted(outcomes)), time.perf_counter() - started)


def _crew(executor: Executor | None, workers: int, bar: Task) -> Crew:
    if executor is not None:
        return Given(executor)
    return Processes(workers) if workers > 1 else Here(bar.describe)


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
