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

from pliant.execution.jobs import JobQueue
from pliant.execution.progress import Progress, bar_of
from pliant.interfaces.optimizer import Trial, Value, Variable
from pliant.search.problem.search_problem import SearchProblem
from pliant.search.run.journal import Generation, Journal
from pliant.search.run.results import Row
from pliant.search.workers import told_of

TWINS = 0.05  # of each variable's range: candidates that are closer than that in all of them


def reevaluated(
    problem: SearchProblem,
    rows: Sequence[Row],
    queue: JobQueue[Trial, Trial],
    progress: Progress,
    folder: Path,
) -> tuple[list[Row], float]:
    """The `best` feasible candidates of each context that are no near twins of better ones, tried again.

    Args:
        problem: of the search, with a `confirm` block.
        rows: everything that was tried.
        queue: evaluates in the `reevaluation_problem`.
        progress: one bar.
        folder: of the search's journals; what was tried again under the same change is known from there.

    Returns:
        The same candidates with what they come to now, in the order in which the search had ranked them; and the
        time of that, s, all sessions together.
    """
    config = problem.config.confirm
    assert config is not None
    axes = [*(one.variable for one in problem.variables), *(one.variable for one in problem.shared)]
    contexts = sorted({row.context for _, row in rows})
    chosen = [row for context in contexts for row in best_apart(axes, rows, context, config.best)]
    # Of what is changed; how many are tried again does not matter to any of them.
    change = json.dumps(config.model_dump(mode="json")["change"], sort_keys=True)
    journal = Journal(folder, f"confirm-{hashlib.sha256(change.encode()).hexdigest()[:16]}")
    batches, begun = journal.read(), time.perf_counter()
    before_s = batches[-1].wall_s if batches else 0.0
    known = {_candidate(told): told for batch in batches for told in batch.trials}
    left = [row for _, row in chosen if _candidate(row) not in known]
    with bar_of(progress, "the best once more", len(chosen), len(chosen) - len(left)) as bar:
        for one in queue.each([Trial(k, row.values, row.context) for k, row in enumerate(left)]):
            told = told_of(one)
            journal.append(Generation(1, 1, (told,), before_s + time.perf_counter() - begun))
            known[_candidate(told)] = told
            bar.advance()
    found = [
        (branch, replace(known[_candidate(row)], number=row.number, first=row.objectives))
        for branch, row in chosen
    ]
    return found, before_s + time.perf_counter() - begun


def best_apart(axes: Sequence[Variable], rows: Sequence[Row], context: int, count: int) -> list[Row]:
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
        twins = any(_twins(axes, row[1].values, better.values) for _, better in found)
        if len(found) < count and not twins:
            found.append(row)
    return found


def _twins(axes: Sequence[Variable], one: Mapping[str, Value], other: Mapping[str, Value]) -> bool:
    for axis in axes:
        if axis.name in one and axis.name in other:
            a, b = one[axis.name], other[axis.name]
            choice = axis.type == "categorical"
            if a != b if choice else not abs(float(a) - float(b)) <= TWINS * (axis.high - axis.low):
                return False
    return True


def _candidate(trial: Trial) -> tuple[Any, ...]:
    return trial.context, tuple(sorted(trial.values.items()))
