"""What searches for grippers come to: their score, how it grew with the grasps, what a policy proposes for a task."""

from __future__ import annotations

from typing import Any

import numpy as np
from benchmarks.studies.command import brief, spread

from pliant.records.design import Array
from pliant.records.search import STATUSES, SearchResult

LAST, MOST_DRAWS, MOST_POINTS = 0.25, 60, 60


def score(result: SearchResult) -> float:
    """The first objective of the best design, as stated; of one design per task the mean over the tasks."""
    values = [next(iter(design.objectives.values())) for design in result.best]
    return float(np.mean(values)) if result.best[0].context >= 0 else float(values[0])


def stable_tasks(result: SearchResult) -> int:
    """Tasks whose grasp is stable, with their best design and the noise of the search."""
    found = {
        task: metrics.get("success_share", 0.0)
        for design in result.best
        for task, metrics in design.conditions.items()
    }
    return sum(share == 1.0 for share in found.values())


def curve(result: SearchResult) -> dict[str, list[Any]]:
    """Score of the best so far against the grasps made: `grasps`, `score` (None before every task has one)."""
    history, sign = result.history, -1.0 if result.maximised[0] else 1.0
    contexts = sorted({int(k) for k in history.context})
    columns = []
    for context in contexts:
        scores = np.where(history.context == context, history.objectives[:, 0], np.nan)
        columns.append(np.fmin.accumulate(scores))
    best: Array = sign * np.mean(columns, axis=0) if columns else np.zeros(0)
    tried = max(1, len(result.conditions)) if contexts == [-1] else 1
    grasps = tried * np.cumsum(history.status != STATUSES.index("refused"))
    at = spread(len(best), MOST_POINTS)
    return {"grasps": [int(grasps[k]) for k in at], "score": brief(best[at])}


def acting(problem: Any) -> dict[str, list[str]]:
    """Task → the variables of a `SearchProblem` that set a key in it."""
    return {
        condition.name: [one.name for one in problem.variables if index in one.conditions]
        for index, condition in enumerate(problem.conditions)
    }


def policy(result: SearchResult) -> dict[str, dict[str, list[Any]]]:
    """Task → variable → values that were proposed for it in the last quarter of a search with contexts; else empty.

    Variables that are one for several tasks stand under its name, with the value that they have in the task.
    """
    history = result.history
    if not (history.context >= 0).any():
        return {}
    late = np.arange(len(history)) >= (1 - LAST) * len(history)
    found = {}
    for index, task in enumerate(result.conditions):
        rows = np.flatnonzero((history.context == index) & late & (history.status == STATUSES.index("ok")))
        few = [rows[k] for k in spread(len(rows), MOST_DRAWS)]
        columns = {name: np.asarray(values)[few] for name, values in history.values.items()}
        found[task] = {name: brief(own) for name, own in columns.items() if np.isfinite(own).all()}
    return found
