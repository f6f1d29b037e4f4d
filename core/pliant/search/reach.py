"""Whether a task can be reached by the longest chain that a search may build, before it begins."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from pliant.errors import UserError
from pliant.interfaces.optimizer import Value
from pliant.pipeline.chain_length import chain_length_m
from pliant.pipeline.workbench import Workbench
from pliant.search.problem import SearchProblem


def require_reach(problem: SearchProblem, bench: Workbench) -> None:
    """Ask the task of every condition whether the longest straight chain will do.

    More and longer modules make longer chains, so that the longest has every number at its upper bound, whatever the
    constraints. Where no design at these bounds can be built, nothing is known and nothing refused.

    Raises:
        UserError: the task is out of reach, as its `check_reach` says.
    """
    if problem.study.chain is None or problem.study.task is None:
        return
    for condition in range(len(problem.conditions)):
        longest, task = 0.0, problem.study.task
        for values in _largest(problem):
            try:
                study = problem.apply(values, condition)
                longest = max(longest, chain_length_m(bench, study))
            except UserError:
                return
            assert study.task is not None
            task = study.task
        bench.build("task", task).check_reach(longest)


def _largest(problem: SearchProblem) -> Iterator[Mapping[str, Value]]:
    """Upper bounds of the numbers, with each choice of each categorical variable in turn."""
    chosen = [v for v in problem.variables if v.variable.type == "categorical"]
    base: dict[str, Value] = {
        v.name: v.variable.choices[0] if v in chosen else v.variable.high for v in problem.variables
    }
    yield base
    for v in chosen:
        for choice in v.variable.choices[1:]:
            yield {**base, v.name: choice}
