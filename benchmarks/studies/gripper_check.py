"""The baseline gripper in the check of the winners, and successes of a check."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

from pliant.config.study import Study
from pliant.errors import PliantError
from pliant.pipeline.study import simulate_study
from pliant.pipeline.workbench import Workbench
from pliant.search.evaluate.evaluator import measured, numbers, problem_of
from pliant.search.problem.study_setter import StudySetter, changed
from pliant.search.verify.direct_fem import direct_studies, solvable


def baseline(bench: Workbench, study: Study) -> dict[str, Any]:
    """The study's own gripper, no variable set, in all its tasks and engines, `verify.change` on top.

    Returns:
        `engines`: engine → task → metrics; `design`: variable → the study's own value, SI; `laws`: direct FEM, or
        those of the search where the study says so; `notes`; `wall_s`.

    Raises:
        UserError: the study is wrong; an engine's own failure is a note.
    """
    begun, notes = time.perf_counter(), list[str]()
    problem = problem_of(bench, study)
    setter = StudySetter(study, bench.registry)
    verify = problem.config.verify
    change = verify.change if verify is not None else {}
    own = [changed(bench.registry, setter.study(dict(c.changes)), change) for c in problem.conditions]
    solved = solvable(study)
    cases = direct_studies(bench, own)[0] if solved else own
    engines: dict[str, dict[str, Any]] = {}
    for condition, case in zip(problem.conditions, cases, strict=True):
        for engine in (case.physics, *case.cross_check):
            kind = engine.kind if engine is not None else ""
            alone = case.model_copy(update={"physics": engine, "cross_check": (), "uncertainty": None})
            try:
                run = simulate_study(bench, alone).engines[0]
            except PliantError as error:
                notes.append(f"{kind}, {condition.name}: {error}")
                continue
            assert run.result is not None
            trials = {"trials": float(getattr(case.task, "trials", 1))}
            engines.setdefault(run.kind, {})[condition.name] = numbers(measured(run.result)) | trials
    return {
        "engines": engines,
        "design": {v.name: v.stated for v in problem.variables if v.stated is not None and not v.each},
        "laws": "direct FEM" if solved else "the search",
        "notes": list(dict.fromkeys(notes)),
        "wall_s": time.perf_counter() - begun,
    }


def engines_of(part: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Engine → task → verified metrics of a search's winner or of the baseline."""
    if "engines" in part:
        return dict(part["engines"])
    return dict((part.get("verified") or {}).get("conditions", {}))


def stable(tasks: Mapping[str, Mapping[str, float]]) -> tuple[int, int]:
    """Stable grasps and trials over tasks."""
    counts = [round(one["trials"]) for one in tasks.values()]
    held = [round(one["success_share"] * n) for one, n in zip(tasks.values(), counts, strict=True)]
    return sum(held), sum(counts)


def rise_m(tasks: Mapping[str, Mapping[str, float]]) -> float:
    """Mean of `z_max` over tasks."""
    return sum(one["z_max_m"] for one in tasks.values()) / len(tasks)
