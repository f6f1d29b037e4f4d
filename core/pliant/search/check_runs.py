"""The runs of a check side by side, before the check reads them from the store one after the other.

Ten noisy trials of six tasks in two engines, with two laws each, are minutes of one processor. What fails here is met
again by the check itself, which tells.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

from pliant.config.study import Study
from pliant.errors import NotReachedError, PliantError, interrupted
from pliant.execution.executors import Executor, InlineExecutor
from pliant.execution.jobs import JobQueue
from pliant.pipeline.remote import RemoteStudy
from pliant.pipeline.study import laws_of_study
from pliant.pipeline.workbench import Workbench
from pliant.records.search import FoundDesign
from pliant.search.problem.search_problem import SearchProblem
from pliant.search.stage_keys import MODULES
from pliant.search.verify.direct_fem import direct_studies, solvable
from pliant.search.verify.verification import cases_of, engines_of, run_in

WORTH_S = 10.0  # of what is left, on one processor; processes take two or three to begin


@dataclass(frozen=True)
class RunJob:
    """One run: the study as a worker gets it, and the place of the engine among those of its check."""

    study: RemoteStudy
    engine: int


def run(job: RunJob) -> None:
    """In a worker: leave the result in the store."""
    with suppress(PliantError):
        bench, study = job.study.open()
        run_in(bench, study, engines_of(bench, study)[job.engine])


def run_ahead(
    bench: Workbench, problem: SearchProblem, designs: Sequence[FoundDesign], executor: Executor
) -> None:
    """Make the runs of a check, where there are several and they take long.

    Args:
        bench: plugins, store, progress.
        problem: the `SearchProblem`.
        designs: that are checked.
        executor: who runs.
    """
    try:
        cases = [[case.study for case in cases_of(bench, problem, design)] for design in designs]
    except PliantError:
        return
    first, *others = [study for studies in cases for study in studies]
    if not others or isinstance(executor, InlineExecutor):
        return
    each_s = _one(bench, first)
    engines, solved = len(engines_of(bench, first)), solvable(problem.study)
    left = len(others) + (1 + len(others) if solved else 0)
    if each_s * left < WORTH_S:
        return
    if solved:
        others += _solved(bench, cases)
    modules = MODULES if executor.remote else ()
    remote = [RemoteStudy.of(bench, study, modules) for study in others]
    _together(bench, executor, [RunJob(study, engine) for study in remote for engine in range(engines)])


def _one(bench: Workbench, study: Study) -> float:
    """Run a study here, in all engines; the time that it took, s."""
    begun, engines = time.perf_counter(), engines_of(bench, study)
    bar = bench.progress.begin("first run of the check", len(engines))
    try:
        for engine in engines:
            try:
                run_in(bench, study, engine)
            except Exception as error:
                if interrupted(error):
                    raise KeyboardInterrupt from None
            bar.advance()
    finally:
        bar.finish()
    return time.perf_counter() - begun


def _solved(bench: Workbench, cases: Sequence[Sequence[Study]]) -> list[Study]:
    """The studies with laws of direct FEM, which is solved and fitted here; without designs where that fails."""
    found: list[Study] = []
    for studies in cases:
        with suppress(PliantError):
            direct, _ = direct_studies(bench, studies)
            for study in direct:
                laws_of_study(bench, study)
            found += direct
    return found


def _together(bench: Workbench, executor: Executor, jobs: Sequence[RunJob]) -> None:
    """Errors stay where they are: the check meets them and tells."""
    bar = bench.progress.begin("runs of the check", len(jobs))
    try:
        with suppress(NotReachedError), JobQueue(executor, run) as queue:
            for _ in queue.each(jobs):
                bar.advance()
    finally:
        bar.finish()
