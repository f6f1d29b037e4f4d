"""Choice of another design if by direct FEM the best one violates a constraint."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from pliant_search.problem.search_problem import SearchProblem
from pliant_search.records import STATUSES, FoundDesign, SearchResult, Verification
from pliant_search.run.results import changed_settings

# A metric below this share of a unit has no ratio.
LEAST = 1e-12


def next_best(
    problem: SearchProblem, result: SearchResult, check: Verification, engine: str
) -> Iterator[FoundDesign]:
    """Yield designs of the history, best first, that are feasible if their laws err as those of the best design do.

    Their metrics are multiplied by the ratio of the FEM metric to the predicted metric of the best design.

    Args:
        problem: the search.
        result: with one best design and one objective.
        check: of the best design.
        engine: the study's own.
    """
    predicted, verified = check.predicted.get(engine, {}), check.verified.get(engine, {})
    ratio = {
        name: verified[name] / value
        for name, value in predicted.items()
        if name in verified and abs(value) > LEAST and np.isfinite([value, verified[name]]).all()
    }
    history, seen = result.history, [dict(result.best[0].values)]
    order = np.argsort(history.objectives[:, 0], kind="stable")
    for row in order[np.isfinite(history.objectives[order, 0])]:
        if STATUSES[int(history.status[row])] != "ok":
            continue
        design = _design_at(problem, result, int(row))
        corrected = {name: value * ratio.get(name, 1.0) for name, value in design.metrics.items()}
        if dict(design.values) not in seen and not problem.metric_violations(design.values, corrected):
            seen.append(dict(design.values))
            yield design


def _design_at(problem: SearchProblem, result: SearchResult, row: int) -> FoundDesign:
    """Return a candidate of the history as a design."""
    history = result.history
    by_name = {variable.name: variable for variable in result.variables}
    values: dict[str, Any] = dict(result.branches[int(history.branch[row])])
    for name, column in history.values.items():
        variable, value = by_name[name], float(column[row])
        if variable.choices:
            values[name] = variable.choices[int(value)]
        else:
            values[name] = round(value) if variable.type == "integer" else value
    signs = [-1.0 if maximised else 1.0 for maximised in result.maximised]
    objectives = {
        name: sign * float(value)
        for name, sign, value in zip(result.objectives, signs, history.objectives[row], strict=True)
    }
    context = int(history.context[row])
    metrics = {name: float(column[row]) for name, column in history.metrics.items()}
    return FoundDesign(
        dict(problem.full(values)),
        changed_settings(problem, values, context),
        objectives,
        metrics,
        {},
        int(history.branch[row]),
        context,
        row,
    )
