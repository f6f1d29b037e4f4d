"""The check of a search's winner as a stage of its own, so that it can be repeated without the search."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from pliant.config.study import Study
from pliant.errors import NotReachedError, PliantError, interrupted
from pliant.execution.executors import Executor, InlineExecutor
from pliant.execution.jobs import JobQueue
from pliant.execution.progress import bar_of
from pliant.pipeline.remote import RemoteStudy
from pliant.pipeline.study import laws_of_study
from pliant.pipeline.workbench import Workbench, content
from pliant.records.search import FoundDesign, SearchResult, Verification
from pliant.search.evaluate.evaluator import shared_means
from pliant.search.problem.search_problem import SearchProblem
from pliant.search.stage_keys import MODULES, components_of, content_of
from pliant.search.verify.direct_fem import direct_studies, solvable
from pliant.search.verify.verification import cases_of, engines_of, run_in, verify

STAGE = "verify"
WORTH_S = 10.0  # of runs that are left, on one processor; processes take two or three to begin


def checked(
    bench: Workbench, study: Study, problem: SearchProblem, result: SearchResult, key: str, executor: Executor
) -> Verification | None:
    """The check of the best design, or of the best design of each condition; of a front, of its first.

    A check that cannot be made is one with a note, and is tried again next time.
    """
    contextual = all(design.context >= 0 for design in result.best)
    designs = result.best if contextual else result.best[:1]
    ahead = cache(lambda: run_ahead(bench, problem, designs, executor))  # once, where something is missing
    found = {}
    for design in designs:
        name = problem.conditions[design.context].name if contextual else ""

        def compute(partial: Path, design: FoundDesign = design) -> Verification:
            ahead()
            return verify(bench, problem, design)

        try:
            found[name] = bench.make(
                STAGE,
                compute,
                components=components_of(bench, study, [engine.kind for engine in study.cross_check]),
                modules=["pliant.search.verify.verification"],
                config={
                    "study": content_of(study, ()),
                    "cross_check": [content(engine) for engine in study.cross_check],
                    "values": dict(design.values),
                    "context": design.context,
                },
                inputs={"search": key},
            ).value
        except PliantError as error:
            bench.progress.note(
                f"the check of the best design{' for ' + name if name else ''} failed: {error}"
            )
            found[name] = Verification({}, {}, {}, (), 0.0, 0.0, (str(error),))
    return merged(found)


def converged(result: SearchResult, study: Study, engine: str) -> bool:
    """Whether the check of the winner, where there was one, came to numbers.

    Where FEM has nothing to check, as with stated laws, the same run with the laws of the search counts.

    Args:
        result: of the search, with the check.
        study: that was searched.
        engine: the kind of the study's own engine; what others found does not count.
    """
    check = result.verification
    if check is None:
        return True
    found = check.verified if solvable(study) else check.predicted
    return any(np.isfinite(value) for value in found.get(engine, {}).values())


def merged(checks: Mapping[str, Verification]) -> Verification | None:
    """The checks of several conditions' best designs as one: metrics are means over the conditions.

    An engine that did not answer in all of them has no mean, and a note says where it did not. Notes have their
    condition; those of all conditions stand once, without.

    Args:
        checks: condition → check; one alone is returned as it is.
    """
    every = list(checks.values())
    if len(every) < 2:
        return every[0] if every else None
    by_engine: dict[str, dict[str, Mapping[str, float]]] = {}
    for check in every:
        for engine, conditions in check.conditions.items():
            by_engine.setdefault(engine, {}).update(conditions)
    notes = [
        note if all(note in other.notes for other in every) else f"{name}: {note}"
        for name, check in checks.items()
        for note in check.notes
    ]
    unanswered: list[str] = []

    def means(
        found: Mapping[str, Mapping[str, Mapping[str, float]]], how: str
    ) -> dict[str, dict[str, float]]:
        """Engine → means, of engines that answered in every check."""
        answered = {}
        for engine in dict.fromkeys(engine for answers in found.values() for engine in answers):
            failed = [name for name, answers in found.items() if engine not in answers]
            if failed:
                unanswered.append(f"{engine}, {how}: no answer for {', '.join(failed)}, so no mean.")
            else:
                answered[engine] = shared_means([answers[engine] for answers in found.values()])
        return answered

    predicted = means({n: c.predicted for n, c in checks.items()}, "with the laws of the search")
    verified = means({n: c.verified for n, c in checks.items()}, "with laws from direct FEM")
    return Verification(
        predicted,
        verified,
        by_engine,
        tuple(law for check in every for law in check.laws),
        sum(check.fem_wall_s for check in every),
        sum(check.wall_s for check in every),
        (*dict.fromkeys(notes), *unanswered),
    )


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
    """Make the runs of a check side by side, where there are several and they take long.

    Ten noisy trials of six tasks in two engines, with two laws each, are minutes of one processor. The check reads
    them from the store; what fails here is met again by the check itself, which tells.

    Args:
        bench: plugins, store, progress.
        problem: the `SearchProblem`.
        designs: that are checked.
        executor: who runs.
    """
    try:
        cases = [[study for _, study in cases_of(bench, problem, design)] for design in designs]
    except PliantError:
        return
    first, *others = [study for studies in cases for study in studies]
    if not others or isinstance(executor, InlineExecutor):
        return
    engines, begun = engines_of(bench, first), time.perf_counter()
    with bar_of(bench.progress, "first run of the check", len(engines)) as bar:
        for engine in engines:
            try:
                run_in(bench, first, engine)
            except Exception as error:
                if interrupted(error):
                    raise KeyboardInterrupt from None
            bar.advance()
    solved = solvable(problem.study)
    left = len(others) + (1 + len(others) if solved else 0)
    if (time.perf_counter() - begun) * left < WORTH_S:
        return
    for studies in cases if solved else ():
        with suppress(PliantError):  # no studies of designs that FEM does not solve
            direct, _ = direct_studies(bench, studies)
            for study in direct:
                laws_of_study(bench, study)
            others += direct
    remote = [RemoteStudy.of(bench, study, MODULES if executor.remote else ()) for study in others]
    jobs = [RunJob(study, engine) for study in remote for engine in range(len(engines))]
    with (
        bar_of(bench.progress, "runs of the check", len(jobs)) as bar,
        suppress(NotReachedError),
        JobQueue(executor, run) as queue,
    ):
        for _ in queue.each(jobs):
            bar.advance()
