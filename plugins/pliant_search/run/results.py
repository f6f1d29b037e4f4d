"""Records of a search from its evaluated trials: history, best designs, counts."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from pliant_search.optimizer import OK, REFUSED, Trial, Value, Variable
from pliant_search.problem.search_problem import SearchProblem
from pliant_search.records import STATUSES, FoundDesign, SearchHistory

NAN = float("nan")
Row = tuple[int, Trial]  # with the index of its branch


def build_history(variables: Sequence[Variable], rows: Sequence[Row], objectives: int) -> SearchHistory:
    """Return the history of all candidates, branch by branch in the order of `tell`.

    The objective of a candidate that violates a constraint on metrics is NaN; its metrics are kept.
    """

    def column(axis: Variable) -> list[float]:
        values = [row.values[axis.name] for _, row in rows]
        if axis.type != "categorical":
            return [float(value) for value in values]
        return [float(axis.choices.index(value)) if value in axis.choices else NAN for value in values]

    names = sorted({name for _, row in rows for name in row.metrics})
    scores = [row.objectives if row.feasible else (NAN,) * objectives for _, row in rows]
    return SearchHistory(
        np.array([branch for branch, _ in rows], int),
        np.array([row.context for _, row in rows], int),
        {axis.name: np.array(column(axis), float) for axis in variables},
        np.array([STATUSES.index(row.state) for _, row in rows], int),
        np.array(scores, float).reshape(len(rows), objectives),
        {
            name: np.array([row.metrics.get(name, NAN) if row.state == OK else NAN for _, row in rows], float)
            for name in names
        },
        np.array([row.wall_s for _, row in rows], float),
    )


def best_row(rows: Iterable[Row]) -> Row | None:
    """Return the row of the lowest objective, the first of equal ones; None if no row is feasible."""
    feasible = [row for row in rows if row[1].feasible]
    return min(feasible, key=lambda row: row[1].objectives[0], default=None)


def pareto_front(rows: Iterable[Row]) -> list[Row]:
    """Return the Pareto front, each objective vector once, sorted by the first objective."""
    feasible = sorted((row for row in rows if row[1].feasible), key=lambda row: row[1].objectives)
    front: list[Row] = []
    kept = np.empty((0, len(feasible[0][1].objectives) if feasible else 0))
    for row in feasible:  # a row that dominates another precedes it
        scores = np.array(row[1].objectives)
        if not np.any(np.all(kept <= scores, axis=1)):
            front.append(row)
            kept = np.vstack([kept, scores])
    return front


def refusal_counts(rows: Iterable[Row]) -> tuple[dict[str, int], dict[str, int]]:
    """Return cause → count of the refused and of the failed candidates; the most frequent first.

    Constraints that differ in numbers are distinct; other causes that differ only in numbers are merged.
    """
    constraints: Counter[str] = Counter()
    refused, failed = list[str](), list[str]()
    for _, row in rows:
        if row.state == REFUSED and row.violation > 0:
            constraints[row.cause or "refused"] += 1
        elif row.state == REFUSED:
            refused.append(row.cause or "refused")
        elif row.state != OK:
            failed.append(row.cause or "the objective is not a number")
    constraints.update(counted(refused))
    return dict(constraints.most_common()), counted(failed)


def found_design(problem: SearchProblem, row: Row) -> FoundDesign:
    """Return a candidate as a design; `problem` is the `SearchProblem`."""
    branch, told = row
    signs = [-1.0 if maximised else 1.0 for maximised in problem.maximised]
    stated, first = (
        {name: sign * one for name, sign, one in zip(problem.objective_names, signs, found, strict=True)}
        for found in (told.objectives, told.first or told.objectives)
    )
    return FoundDesign(
        dict(problem.full(told.values)),
        changed_settings(problem, told.values, told.context),
        stated,
        dict(told.metrics),
        {name: dict(metrics) for name, metrics in told.conditions.items()},
        branch,
        told.context,
        told.number,
        first if told.first else {},
    )


def changed_settings(problem: SearchProblem, values: Mapping[str, Value], context: int) -> dict[str, Any]:
    """Return key → value that the variables set; "key [condition]" where the conditions differ."""
    conditions = problem.conditions
    numbers = range(len(conditions)) if context < 0 else (context,)
    searched = {key for variable in problem.variables for key in variable.keys}
    by_key: dict[str, dict[int, Any]] = {}
    for number in numbers:
        for key, value in problem.changes(values, number).items():
            if key in searched:
                by_key.setdefault(".".join(map(str, key)), {})[number] = value
    settings: dict[str, Any] = {}
    for name, found in by_key.items():
        if len(found) == len(numbers) and len({repr(value) for value in found.values()}) == 1:
            settings[name] = next(iter(found.values()))
        else:
            settings |= {f"{name} [{conditions[n].name}]": value for n, value in found.items()}
    return settings


NUMBERS = re.compile(r"(?<![\w.])[-+\u2212]?\d+(?:[.,]\d+)*(?:[eE][-+]?\d+)?")  # not the digit in n1
ALIKE = ", or the like"


def counted(causes: Iterable[str]) -> dict[str, int]:
    """Return cause → count, the most frequent first; causes that differ only in numbers are merged.

    "joint 1 is 35 % outside" and "joint 4 is 2 % outside" are one cause: the first, followed by `ALIKE`.
    """
    alike: dict[str, list[str]] = {}
    for cause in causes:
        alike.setdefault(NUMBERS.sub("#", cause), []).append(cause)
    order = sorted(alike.values(), key=len, reverse=True)
    return {(t[0] if len(set(t)) == 1 else t[0].rstrip(".") + ALIKE): len(t) for t in order}
