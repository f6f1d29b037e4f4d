"""What is found out about the best design once a search has ended: slopes, limits, the price of robustness."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pliant.config.search import RobustConfig
from pliant.execution.jobs import JobQueue
from pliant.interfaces.optimizer import Value
from pliant.records.search import FoundDesign, Robustness, SearchResult
from pliant.search.limits import limits
from pliant.search.outcome import Evaluates, Task, Told, evaluated
from pliant.search.problem import SearchProblem
from pliant.search.sensitivity import Many, slopes
from pliant.search.workers import told_of


@dataclass(frozen=True)
class Judges:
    """Who evaluates.

    Attributes:
        plain: undisturbed, in this process.
        disturbed: in the scenarios of a robust search; else the same.
        queue: workers that evaluate undisturbed; None where there is only this process.
    """

    plain: Evaluates
    disturbed: Evaluates
    queue: JobQueue[Task, Told] | None = None


def about_the_best(
    problem: SearchProblem, judges: Judges, result: SearchResult, nominal: SearchResult | None
) -> SearchResult:
    """The result with slopes, limits and, of a robust search, what robustness costs.

    Args:
        problem: the `SearchProblem`.
        judges: see there.
        result: without these.
        nominal: of a robust search: the nominal one beside it.
    """
    if not result.best:
        return result
    best = result.best[0]
    many = None if judges.queue is None else _many(judges.queue)
    found = slopes(judges.plain, problem, best, many) if problem.config.sensitivity else ()
    causes = {**result.refused, **result.failed}
    told = limits(problem, best, found, result.history, causes)
    return replace(result, slopes=found, limits=told, robustness=_robustness(problem, judges, best, nominal))


def _many(queue: JobQueue[Task, Told]) -> Many:
    """Candidates in one context, side by side."""

    def many(candidates: Sequence[Mapping[str, Value]], context: int) -> Iterator[Told]:
        tasks = [Task(number, values, context) for number, values in enumerate(candidates)]
        return map(told_of, queue.each(tasks))

    return many


def _robustness(
    problem: SearchProblem, judges: Judges, best: FoundDesign, beside: SearchResult | None
) -> Robustness | None:
    """Both best designs, nominal and robust, undisturbed and in the same scenarios."""
    robust = problem.config.robust
    if robust is None or beside is None or not beside.best:
        return None
    nominal = beside.best[0]
    designs = {"nominal": nominal, "robust": best}
    alone = {name: _score(judges.plain, design) for name, design in designs.items()}
    together = {name: _score(judges.disturbed, design) for name, design in designs.items()}
    sign = -1.0 if problem.maximised[0] else 1.0
    return Robustness(
        measure=robust.measure,
        level=robust.level,
        samples=robust.samples,
        sources=_sources(robust),
        nominal_of_nominal=sign * _first(alone["nominal"]),
        robust_of_nominal=sign * _first(together["nominal"]),
        nominal_of_robust=sign * _first(alone["robust"]),
        robust_of_robust=sign * _first(together["robust"]),
        spread={name: sign * np.array(told.scenarios, float) for name, told in together.items()},
        nominal=nominal,
    )


def _sources(robust: RobustConfig) -> tuple[str, ...]:
    """What was varied, in words."""
    varied = [
        f"{key}, standard deviation {said.get('sd')}" if isinstance(said, Mapping) else f"{key} ± {said}"
        for key, said in robust.vary.items()
    ]
    return (*(["laws within their error bars"] if robust.laws else []), *varied)


def _score(evaluator: Evaluates, design: FoundDesign) -> Told:
    return evaluated(evaluator, Task(design.number, design.values, design.context))


def _first(told: Told) -> float:
    return told.objectives[0] if told.objectives else float("nan")
