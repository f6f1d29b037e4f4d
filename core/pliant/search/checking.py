"""The check of a search's winner as a stage of its own, so that it can be repeated without the search."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pliant.config.study import Study
from pliant.errors import PliantError
from pliant.pipeline.study import DEFAULT_PHYSICS
from pliant.pipeline.workbench import Workbench, content
from pliant.records.search import FoundDesign, SearchResult, Verification
from pliant.search.stage_keys import components_of, content_of

STAGE = "verify"


def checked(
    bench: Workbench, study: Study, problem: Any, result: SearchResult, key: str
) -> Verification | None:
    """The check of the best design, or of the best design of each condition; of a front, of its first.

    A check that cannot be made is one with a note, and is tried again next time.
    """
    contextual = all(design.context >= 0 for design in result.best)
    found = []
    for design in result.best if contextual else result.best[:1]:
        try:
            found.append(_check(bench, study, problem, design, key))
        except PliantError as error:
            bench.progress.note(f"the check of the best design failed: {error}")
            found.append(Verification({}, {}, {}, (), 0.0, 0.0, (str(error),)))
    return merged(found)


def converged(study: Study, result: SearchResult) -> bool:
    """Whether the check of the winner, where there was one, came to numbers in the study's engine."""
    from pliant.search.direct_fem import solvable

    check = result.verification
    if check is None:
        return True
    found = check.verified if solvable(study) else check.predicted
    engine = study.physics.kind if study.physics is not None else DEFAULT_PHYSICS
    return any(np.isfinite(value) for value in found.get(engine, {}).values())


def _check(bench: Workbench, study: Study, problem: Any, design: FoundDesign, key: str) -> Verification:

    def compute(partial: Path) -> Verification:
        from pliant.search.verification import verify

        return verify(bench, problem, design)

    made = bench.make(
        STAGE,
        compute,
        components=components_of(bench, study, [engine.kind for engine in study.cross_check]),
        modules=["pliant.search.verification"],
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


def merged(checks: Sequence[Verification]) -> Verification | None:
    """The checks of the best designs of several conditions as one: metrics are means over conditions."""
    if len(checks) < 2:
        return checks[0] if checks else None
    by_engine: dict[str, dict[str, Mapping[str, float]]] = {}
    for check in checks:
        for engine, conditions in check.conditions.items():
            by_engine.setdefault(engine, {}).update(conditions)
    return Verification(
        _mean([check.predicted for check in checks]),
        _mean([check.verified for check in checks]),
        by_engine,
        tuple(law for check in checks for law in check.laws),
        sum(check.fem_wall_s for check in checks),
        sum(check.wall_s for check in checks),
        tuple(dict.fromkeys(note for check in checks for note in check.notes)),
    )


def _mean(checks: Sequence[Mapping[str, Mapping[str, float]]]) -> dict[str, dict[str, float]]:
    """Engine → metric → mean, of engines that answered in every check and metrics that all have."""
    found: dict[str, dict[str, float]] = {}
    for engine in [name for name in checks[0] if all(name in check for check in checks)]:
        every = [check[engine] for check in checks]
        shared = [name for name in every[0] if all(name in one for one in every)]
        found[engine] = {name: float(np.mean([one[name] for one in every])) for name in shared}
    return found
