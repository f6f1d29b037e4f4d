"""Check of a search's best design as a separate stage, so that it can be repeated without the search."""

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
from pliant.execution.progress import open_progress_bar
from pliant.pipeline.remote import RemoteStudy
from pliant.pipeline.study import build_study_laws
from pliant.pipeline.workbench import RunContext, content
from pliant_search.evaluate.evaluator import shared_means
from pliant_search.problem.search_problem import SearchProblem
from pliant_search.records import FoundDesign, SearchResult, Verification
from pliant_search.stage_keys import MODULES, search_components, search_content
from pliant_search.verify.direct_fem import direct_studies, solvable
from pliant_search.verify.verification import check_engines, run_in, verification_cases, verify

STAGE = "verify"
WORTH_S = 10.0  # of remaining runs, on one processor; processes need two or three to start


def checked(
    context: RunContext,
    study: Study,
    problem: SearchProblem,
    result: SearchResult,
    key: str,
    executor: Executor,
) -> Verification | None:
    """Check the best design, or the best design of each condition, or the first design of a front.

    A check that cannot be made becomes a verification with a note, and is tried again next time.
    """
    contextual = all(design.context >= 0 for design in result.best)
    designs = result.best if contextual else result.best[:1]
    ahead = cache(lambda: run_ahead(context, problem, designs, executor))  # once, if something is missing
    found = {}
    for design in designs:
        name = problem.conditions[design.context].name if contextual else ""

        def compute(partial: Path, design: FoundDesign = design) -> Verification:
            ahead()
            return verify(context, problem, design)

        try:
            found[name] = context.make(
                STAGE,
                compute,
                components=search_components(context, study, [engine.kind for engine in study.cross_check]),
                modules=["pliant_search.verify.verification"],
                config={
                    "study": search_content(study, ()),
                    "cross_check": [content(engine) for engine in study.cross_check],
                    "values": dict(design.values),
                    "context": design.context,
                },
                inputs={"search": key},
            ).value
        except PliantError as error:
            context.progress.note(
                f"the check of the best design{' for ' + name if name else ''} failed: {error}"
            )
            found[name] = Verification({}, {}, {}, (), 0.0, 0.0, (str(error),))
    return merged(found)


def converged(result: SearchResult, study: Study, engine: str) -> bool:
    """Return whether the check of the best design, if there was one, gave numbers that satisfy the constraints.

    If there is nothing for FEM to check, as with stated laws, the same run with the laws of the search is used.

    Args:
        result: of the search, with the check.
        study: that was searched.
        engine: the kind of the study's own engine; results of other engines are ignored.
    """
    check = result.verification
    if check is None:
        return True
    if check.broken.get(engine):
        return False
    found = check.verified if solvable(study) else check.predicted
    return any(np.isfinite(value) for value in found.get(engine, {}).values())


def merged(checks: Mapping[str, Verification]) -> Verification | None:
    """Merge the checks of several conditions' best designs: metrics are means over the conditions.

    An engine without results in some conditions has no mean, and a note names them. Notes name their condition; a note
    of all conditions appears once, without a name.

    Args:
        checks: condition → check; a single check is returned unchanged.
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
        """Return engine → means, of engines with results in every check."""
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
        {
            engine: {
                f"{text} ({name})": amount
                for name, check in checks.items()
                for text, amount in check.broken.get(engine, {}).items()
            }
            for engine in dict.fromkeys(engine for check in every for engine in check.broken)
        },
    )


@dataclass(frozen=True)
class RunJob:
    """One run: the study as sent to a worker, and the index of the engine among those of its check."""

    study: RemoteStudy
    engine: int


def run(job: RunJob) -> None:
    """Run the job in a worker and put the result into the store."""
    with suppress(PliantError):
        context, study = job.study.open()
        run_in(context, study, check_engines(context, study)[job.engine])


def run_ahead(
    context: RunContext, problem: SearchProblem, designs: Sequence[FoundDesign], executor: Executor
) -> None:
    """Make the runs of a check in parallel if there are several and they take long.

    Ten noisy trials of six tasks in two engines, with two laws each, take minutes of one processor. The check reads
    them from the store; a failure here recurs in the check, which reports it.

    Args:
        context: plugins, store, progress.
        problem: the `SearchProblem`.
        designs: that are checked.
        executor: runs the jobs.
    """
    try:
        cases = [[study for _, study in verification_cases(context, problem, design)] for design in designs]
    except PliantError:
        return
    first, *others = [study for studies in cases for study in studies]
    if not others or isinstance(executor, InlineExecutor):
        return
    engines, begun = check_engines(context, first), time.perf_counter()
    with open_progress_bar(context.progress, "first run of the check", len(engines)) as bar:
        for engine in engines:
            try:
                run_in(context, first, engine)
            except Exception as error:
                if interrupted(error):
                    raise KeyboardInterrupt from None
            bar.advance()
    solved = solvable(problem.study)
    left = len(others) + (1 + len(others) if solved else 0)
    if (time.perf_counter() - begun) * left < WORTH_S:
        return
    for studies in cases if solved else ():
        with suppress(PliantError):  # FEM does not solve these designs
            direct, _ = direct_studies(context, studies)
            for study in direct:
                build_study_laws(context, study)
            others += direct
    remote = [RemoteStudy.from_study(context, study, MODULES if executor.remote else ()) for study in others]
    jobs = [RunJob(study, engine) for study in remote for engine in range(len(engines))]
    with (
        open_progress_bar(context.progress, "runs of the check", len(jobs)) as bar,
        suppress(NotReachedError),
        JobQueue(executor, run) as queue,
    ):
        for _ in queue.each(jobs):
            bar.advance()
