"""The check of a search's winner as a stage of its own, so that it can be repeated without the search."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from pliant.config.study import Study
from pliant.errors import PliantError
from pliant.execution.executors import Executor
from pliant.pipeline.workbench import Workbench, content
from pliant.records.search import FoundDesign, SearchResult, Verification
from pliant.search.check_runs import run_ahead
from pliant.search.problem.search_problem import SearchProblem
from pliant.search.stage_keys import components_of, content_of
from pliant.search.verify.direct_fem import solvable
from pliant.search.verify.verification import verify

STAGE = "verify"


def checked(
    bench: Workbench, study: Study, problem: SearchProblem, result: SearchResult, key: str, executor: Executor
) -> Verification | None:
    """The check of the best design, or of the best design of each condition; of a front, of its first.

    A check that cannot be made is one with a note, and is tried again next time.
    """
    contextual = all(design.context >= 0 for design in result.best)
    designs = result.best if contextual else result.best[:1]
    ahead = cache(
        lambda: run_ahead(bench, problem, designs, executor)
    )  # once, and where something is missing only
    found = {}
    for design in designs:
        name = problem.conditions[design.context].name if contextual else ""
        try:
            found[name] = _check(bench, study, problem, design, key, ahead)
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


def _check(
    bench: Workbench,
    study: Study,
    problem: SearchProblem,
    design: FoundDesign,
    key: str,
    ahead: Callable[[], None],
) -> Verification:

    def compute(partial: Path) -> Verification:
        ahead()
        return verify(bench, problem, design)

    made = bench.make(
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
    )
    value: Verification = made.value
    return value


def merged(checks: Mapping[str, Verification]) -> Verification | None:
    """The checks of several conditions' best designs as one: metrics are means over the conditions.

    An engine that did not answer in all of them has no mean, and a note says where it did not.

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
    predicted = {name: check.predicted for name, check in checks.items()}
    verified = {name: check.verified for name, check in checks.items()}
    return Verification(
        _mean(predicted),
        _mean(verified),
        by_engine,
        tuple(law for check in every for law in check.laws),
        sum(check.fem_wall_s for check in every),
        sum(check.wall_s for check in every),
        (
            *_notes(checks),
            *_unanswered(predicted, "with the laws of the search"),
            *_unanswered(verified, "with laws from direct FEM"),
        ),
    )


def _notes(checks: Mapping[str, Verification]) -> list[str]:
    """Notes with their condition; those of all conditions once, without."""
    found = []
    for name, check in checks.items():
        for note in check.notes:
            everywhere = all(note in other.notes for other in checks.values())
            found.append(note if everywhere else f"{name}: {note}")
    return list(dict.fromkeys(found))


def _unanswered(checks: Mapping[str, Mapping[str, Any]], how: str) -> list[str]:
    """Sentences about engines that answered in some conditions only."""
    engines = dict.fromkeys(engine for check in checks.values() for engine in check)
    found = []
    for engine in engines:
        failed = [name for name, check in checks.items() if engine not in check]
        if failed:
            found.append(f"{engine}, {how}: no answer for {', '.join(failed)}, so no mean.")
    return found


def _mean(checks: Mapping[str, Mapping[str, Mapping[str, float]]]) -> dict[str, dict[str, float]]:
    """Engine → metric → mean, of engines that answered in every check and metrics that all have."""
    listed = list(checks.values())
    found: dict[str, dict[str, float]] = {}
    for engine in [name for name in listed[0] if all(name in check for check in listed)]:
        every = [check[engine] for check in listed]
        shared = [name for name in every[0] if all(name in one for one in every)]
        found[engine] = {name: float(np.mean([one[name] for one in every])) for name in shared}
    return found
