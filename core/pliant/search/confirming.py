"""The best candidates of a noisy search once more, before one of them is chosen.

The best of thousands of single noisy trials was lucky, too (the optimizer's curse: Smith and Winkler, Management
Science 52, 2006). What counts in the end is what each of the few best comes to under other trials, and more of them.
A search that has converged has many near twins of its best, which share its luck: of those, the best one is tried.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pliant.config.search import ConfirmConfig
from pliant.config.study_keys import KeyPath
from pliant.errors import UserError
from pliant.execution.jobs import JobQueue
from pliant.execution.progress import Progress
from pliant.interfaces.optimizer import Value, Variable
from pliant.search.changes import changed
from pliant.search.found import Row
from pliant.search.journal import Batch, Journal
from pliant.search.keys import study_key
from pliant.search.outcome import Task, Told
from pliant.search.problem import SearchProblem
from pliant.search.workers import told_of

PLACE = "search.confirm.change"
TWINS = 0.05  # of each variable's range: candidates that are closer than that in all of them


def confirming_problem(problem: SearchProblem) -> SearchProblem:
    """The problem in which the best candidates are tried again; conditions give way to what `confirm.change` sets.

    Raises:
        UserError: a key that the study does not have, or a value that it does not allow.
    """
    config = problem.config.confirm
    assert config is not None
    paths = _paths(problem, config)
    conditions = tuple(
        replace(one, changes={path: value for path, value in one.changes.items() if path not in paths})
        for one in problem.conditions
    )
    study = changed(problem.registry, problem.study, config.change, PLACE)
    return replace(problem, study=study, conditions=conditions)


def require_confirming(problem: SearchProblem) -> None:
    """Raise `UserError` where one best cannot be chosen, or where the change is wrong."""
    if problem.config.confirm is None:
        return
    if len(problem.objective_names) > 1:
        raise UserError(
            "search.confirm chooses by one objective, and search.objective lists several; leave confirm out, or write "
            "one expression of them."
        )
    confirming_problem(problem)
    set_twice = {path for one in problem.variables for path in one.keys} & _paths(
        problem, problem.config.confirm
    )
    if set_twice:
        names = ", ".join(".".join(map(str, path)) for path in sorted(set_twice, key=str))
        raise UserError(f"search.confirm.change sets {names}, which the search varies; leave it out there.")


def confirmed(
    problem: SearchProblem, rows: Sequence[Row], queue: JobQueue[Task, Told], progress: Progress, folder: Path
) -> tuple[list[Row], float]:
    """The `best` feasible candidates of each context that are no near twins of better ones, tried again.

    Args:
        problem: of the search, with a `confirm` block.
        rows: everything that was tried.
        queue: evaluates in the `confirming_problem`.
        progress: one bar.
        folder: of the search's journals; what was tried again under the same change is known from there.

    Returns:
        The same candidates with what they come to now, in the order in which the search had ranked them; and the
        time of that, s, all sessions together.
    """
    config = problem.config.confirm
    assert config is not None
    axes = [*(one.variable for one in problem.variables), *(one.variable for one in problem.shared)]
    chosen = [row for context in _contexts(rows) for row in first_apart(axes, rows, context, config.best)]
    journal = Journal(folder, f"confirm-{_digest(config)}")
    batches, begun = journal.read(), time.perf_counter()
    before_s = batches[-1].wall_s if batches else 0.0
    known = {_candidate(told): told for batch in batches for told in batch.rows}
    left = [row for _, row in chosen if _candidate(row) not in known]
    bar = progress.begin("the best once more", len(chosen), len(chosen) - len(left))
    try:
        for one in queue.each([Task(k, row.values, row.context) for k, row in enumerate(left)]):
            told = told_of(one)
            journal.append(Batch(1, 1, before_s + time.perf_counter() - begun, (told,)))
            known[_candidate(told)] = told
            bar.advance()
    finally:
        bar.finish()
    found = [
        (branch, replace(known[_candidate(row)], number=row.number, first=row.objectives))
        for branch, row in chosen
    ]
    return found, before_s + time.perf_counter() - begun


def _paths(problem: SearchProblem, config: ConfirmConfig) -> set[KeyPath]:
    return {study_key(problem.study, problem.registry, written, PLACE).path for written in config.change}


def _contexts(rows: Sequence[Row]) -> list[int]:
    return sorted({row.context for _, row in rows})


def first_apart(axes: Sequence[Variable], rows: Sequence[Row], context: int, count: int) -> list[Row]:
    """The best of a context, each of which differs from all better ones by 5 % of a variable's range or in a choice.

    Args:
        axes: the variables, merged ones too.
        rows: everything that was tried.
        context: of the candidates.
        count: at most so many.
    """
    feasible = [row for row in rows if row[1].feasible and row[1].context == context]
    found: list[Row] = []
    for row in sorted(feasible, key=lambda row: row[1].objectives[0]):
        if len(found) == count:
            break
        if not any(_twins(axes, row[1].values, better.values) for _, better in found):
            found.append(row)
    return found


def _twins(axes: Sequence[Variable], one: Mapping[str, Value], other: Mapping[str, Value]) -> bool:
    both = [axis for axis in axes if axis.name in one and axis.name in other]
    return all(_close(axis, one[axis.name], other[axis.name]) for axis in both)


def _close(axis: Variable, one: Value, other: Value) -> bool:
    if axis.type == "categorical":
        return one == other
    return abs(float(one) - float(other)) <= TWINS * (axis.high - axis.low)


def _candidate(told: Told) -> tuple[Any, ...]:
    return told.context, _values(told)


def _digest(config: ConfirmConfig) -> str:
    """Of what is changed; how many are tried again does not matter to any of them."""
    plain = config.model_dump(mode="json")["change"]
    return hashlib.sha256(json.dumps(plain, sort_keys=True).encode()).hexdigest()[:16]


def _values(told: Told) -> tuple[Any, ...]:
    return tuple(sorted(told.values.items()))
