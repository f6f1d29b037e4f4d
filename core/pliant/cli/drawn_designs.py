"""What the page of a search draws: the best designs under their task, simulated once more."""

from __future__ import annotations

from pliant.config.study import Study
from pliant.errors import PliantError
from pliant.interfaces.task import SceneTask
from pliant.pipeline.workbench import Workbench
from pliant.records.search import FoundDesign, SearchResult
from pliant.report.search_files import DrawnDesign
from pliant.report.search_view import spread_of
from pliant.search.evaluate.fast_path import FastPath
from pliant.search.problem.search_problem import SearchProblem

OF_A_FRONT = 4
OF_CONDITIONS = 6


def drawn_designs(
    bench: Workbench, study: Study, problem: SearchProblem, result: SearchResult
) -> list[DrawnDesign]:
    """The best design in each condition, the best of each condition, or some spread over a front; none of no design.

    One that cannot be simulated again is left out, and a note says why.
    """
    path, found = FastPath(bench, study), []
    for label, design, condition in _chosen(problem, result):
        winner = problem.apply(design.values, condition)
        scene = isinstance(bench.build("task", winner.noisy_task()), SceneTask)
        try:
            answer = path.result(winner)
            chain = None if scene else path.chain(winner, shapes=True)
        except PliantError as error:
            bench.progress.note(f"the picture of '{label}' is missing: {error}")
            continue
        found.append(DrawnDesign(label, chain, answer))
    return found


def _chosen(problem: SearchProblem, result: SearchResult) -> list[tuple[str, FoundDesign, int]]:
    """Label, design and the condition in which it is drawn."""
    names = [condition.name for condition in problem.conditions]
    best = result.best
    if not best:
        return []
    if best[0].context >= 0:
        return [(names[design.context], design, design.context) for design in best[:OF_CONDITIONS]]
    if len(best) > 1:
        return [(f"design {k + 1}", best[k], 0) for k in spread_of(len(best), OF_A_FRONT)]
    return [(name or "best", best[0], condition) for condition, name in enumerate(names[:OF_CONDITIONS])]
