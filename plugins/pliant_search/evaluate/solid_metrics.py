"""Numbers of a candidate's solid that formulas of a search may name beside the task's metrics."""

from __future__ import annotations

from typing import Any

from pliant.config.study import Study
from pliant.pipeline.workbench import RunContext
from pliant.registry.function import package_function
from pliant_search.problem.search_problem import SearchProblem

THINNEST_WALL = "thinnest_wall"
OF_SOLIDS = (f"{THINNEST_WALL}_m",)


def named_of_solids(problem: SearchProblem) -> tuple[str, ...]:
    """Return those of `OF_SOLIDS` that a formula of the search names."""
    return OF_SOLIDS if problem.names_metric(THINNEST_WALL) else ()


def solid_metrics(context: RunContext, problem: SearchProblem, study: Study) -> dict[str, Any]:
    """Return the thinnest wall of the modules' solid (m) if a formula names it.

    Raises:
        UserError: a module without a mesh.
        MissingDependencyError: the package of solids, or its boolean library, is not installed.
    """
    if not named_of_solids(problem):
        return {}
    return {OF_SOLIDS[0]: package_function(THINNEST_WALL, "pliant_print")(context, study)}
