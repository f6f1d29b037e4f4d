"""What is found out about the best design once a search has ended: slopes, limits, the price of robustness."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pliant.config.search import RobustConfig
from pliant.execution.jobs import JobQueue
from pliant.interfaces.optimizer import Trial, Value
from pliant.records.search import FoundDesign, Robustness, SearchResult
from pliant.search.analyse.limits import limits
from pliant.search.analyse.sensitivity import Many, slopes
from pliant.search.evaluate.evaluator import Evaluates, evaluated
from pliant.search.problem.search_problem import SearchProblem
from pliant.search.workers import told_of


@dataclass(frozen=True)
class Evaluators:
    """Who evaluates.

    Attributes:
        plain: undisturbed, in this process.
        disturbed: in the scenarios of a robust search; else the same.
        queue: workers that evaluate undisturbed; None where there is only this process.
    """

    plain: Evaluates
    disturbed: Evaluates
    queue: JobQueue[Trial, Trial] | None = None


def post_analysis(
    problem: SearchProblem, evaluators: Evaluators, result: SearchResult, nominal: SearchResult | None
) -> SearchResult:
    """The result with slopes, limits and, of a robust search, what robustness costs.

    Args:
        problem: the `SearchProblem`.
        evaluators: see there.
        result: without these.
        nominal: of a robust search: the nominal one beside it.
    """
    if not result.best:
        return result
    best = result.best[0]
    many = None if evaluators.queue is None else _many(evaluators.queue)
    found = slopes(evaluators.plain, problem, best, many) if problem.config.sensitivity else ()
    causes = {**result.refused, **result.failed}
    told = limits(problem, best, found, result.history, causes)
    return replace(
        result, slopes=found, limits=told, robustness=_robustness(problem, evaluators, best, nominal)
    )


def _many(queue: JobQueue[Trial, Trial]) -> Many:
    """Candidates in one context, side by side."""

    def many(candidates: Sequence[Mapping[str, Value]], context: int) -> Iterator[Trial]:
        trials = [Trial(number, values, context) for number, values in enumerate(candidates)]
        return map(told_of, queue.each(trials))

    return many


def _robustness(
    problem: SearchProblem, evaluators: Evaluators, best: FoundDesign, beside: SearchResult | None
) -> Robustness | None:
    """Both best designs, nominal and robust, undisturbed and in the same scenarios."""
    robust = problem.config.robust
    if robust is None or beside is None or not beside.best:
        return None
    nominal = beside.best[0]
    designs = {"nominal": nominal, "robust": best}
    alone = {name: _score(evaluators.plain, design) for name, design in designs.items()}
    together = {name: _score(evaluators.disturbed, design) for name, design in designs.items()}
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


def _score(evaluator: Evaluates, design: FoundDesign) -> Trial:
    return evaluated(evaluator, Trial(design.number, design.values, design.context))


def _first(told: Trial) -> float:
    return told.objective
