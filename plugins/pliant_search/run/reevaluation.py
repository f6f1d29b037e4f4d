"""Re-evaluation of the best candidates of a noisy search, before one of them is chosen.

The best of thousands of single noisy trials is biased by selection (the optimizer's curse: Smith and Winkler,
Management Science 52, 2006). The choice is made by other and more trials of the few best candidates. A converged
search has many near duplicates of its best candidate, which share its bias; only the best of them is tried.
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
from pliant.execution.progress import Progress, open_progress_bar
from pliant_search.optimizer import Trial, Value, Variable
from pliant_search.problem.search_problem import SearchProblem
from pliant_search.run.journal import Generation, Journal
from pliant_search.run.results import Row
from pliant_search.workers import finished_trial

TWINS = 0.05  # of each variable's range: candidates closer than this in all variables are near duplicates


def reevaluated(
    problem: SearchProblem,
    rows: Sequence[Row],
    queue: JobQueue[Trial, Trial],
    progress: Progress,
    folder: Path,
) -> tuple[list[Row], float]:
    """Re-evaluate the `best` feasible candidates of each context, without near duplicates of better ones.

    Args:
        problem: of the search, with a `confirm` block.
        rows: all trials.
        queue: evaluates in the `reevaluation_problem`.
        progress: shows one bar.
        folder: of the search's journals; re-evaluations under the same change are reused from it.

    Returns:
        The candidates with their new results, in the order of the search's ranking; and the time of the
        re-evaluation, s, summed over sessions.
    """
    config = problem.config.confirm
    assert config is not None
    axes = [*(one.variable for one in problem.variables), *(one.variable for one in problem.shared)]
    contexts = sorted({row.context for _, row in rows})
    chosen = [row for context in contexts for row in best_apart(axes, rows, context, config.best)]
    # Depends on the change, not on the number of re-evaluated candidates.
    change = json.dumps(config.model_dump(mode="json")["change"], sort_keys=True)
    journal = Journal(folder, f"confirm-{hashlib.sha256(change.encode()).hexdigest()[:16]}")
    batches, begun = journal.read(), time.perf_counter()
    before_s = batches[-1].wall_s if batches else 0.0
    known = {_candidate(told): told for batch in batches for told in batch.trials}
    left = [row for _, row in chosen if _candidate(row) not in known]
    with open_progress_bar(progress, "the best once more", len(chosen), len(chosen) - len(left)) as bar:
        for one in queue.each([Trial(k, row.values, row.context) for k, row in enumerate(left)]):
            told = finished_trial(one)
            journal.append(Generation(1, 1, (told,), before_s + time.perf_counter() - begun))
            known[_candidate(told)] = told
            bar.advance()
    found = [
        (branch, replace(known[_candidate(row)], number=row.number, first=row.objectives))
        for branch, row in chosen
    ]
    return found, before_s + time.perf_counter() - begun


def best_apart(axes: Sequence[Variable], rows: Sequence[Row], context: int, count: int) -> list[Row]:
    """Return the best of a context that differ from all better ones by 5 % of a variable's range or in a choice.

    Args:
        axes: the variables, including merged ones.
        rows: all trials.
        context: of the candidates.
        count: largest number of candidates.
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
