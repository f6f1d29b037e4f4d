"""What pictures of a shape-matching search need: the winner's backbone, and the best of every structure."""

from __future__ import annotations

from typing import Any

import numpy as np
from benchmarks.studies.searched import MOST_POINTS, brief, spread

from pliant import api
from pliant.pipeline.study import simulate_study
from pliant.records.search import SearchResult
from pliant.search.evaluate.evaluator import problem_of
from pliant.search.verify.direct_fem import direct_studies


def winner_lines(opened: api.OpenStudy, result: SearchResult) -> dict[str, Any]:
    """Backbone and target of the winner in the base's frame, x along the chain.

    Returns:
        `backbone_m`, `target_m`: (n, 3); `joints_m`: (k, 3); `laws`: "direct FEM", or "the search" where the check
        did not come to laws of FEM.
    """
    bench, study = opened.bench, opened.study
    winner = problem_of(bench, study).apply(result.best[0].values, 0)
    winner = winner.model_copy(update={"cross_check": (), "uncertainty": None})
    engine, check = (study.physics.kind if study.physics else ""), result.verification
    solved = check is not None and engine in check.verified
    if solved:
        (winner,), _ = direct_studies(bench, [winner])
    run = simulate_study(bench, winner)
    found = run.engines[0].result
    assert found is not None
    assert run.chain is not None
    origin, frame = np.asarray(run.chain.base_position_m, float), np.asarray(run.chain.base_rotation, float)
    lines = {
        "backbone_m": found.metrics["backbone_points_m"],
        "target_m": found.metrics["target_points_m"],
        "joints_m": found.final.markers_m[1:-1],
    }
    own = {name: ((np.asarray(points, float) - origin) @ frame).tolist() for name, points in lines.items()}
    return {**own, "laws": "direct FEM" if solved else "the search"}


def structures(result: SearchResult) -> list[dict[str, Any]]:
    """The best of every search of the study, best first: its structure, best objective, and best so far."""
    history, found = result.history, []
    for index, values in enumerate(result.branches):
        scores = history.objectives[history.branch == index, 0]
        best = np.fmin.accumulate(scores) if len(scores) else scores
        if not len(best) or not np.isfinite(best[-1]):
            continue
        at = spread(len(best), MOST_POINTS)
        found.append(
            {
                "values": dict(values),
                "best": brief(best[-1]),
                "candidates": len(best),
                "at": [k + 1 for k in at],
                "best_so_far": brief(best[at]),
            }
        )
    return sorted(found, key=lambda one: float(one["best"]))
