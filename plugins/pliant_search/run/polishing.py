"""Polish of a search: descents from its best candidates, side by side in workers, each kept when it is finished."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from pliant.errors import UserError
from pliant.execution.executors import Executor, InlineExecutor
from pliant.execution.jobs import JobQueue
from pliant.execution.progress import open_progress_bar
from pliant.interfaces.physics import PhysicsBackend
from pliant.interfaces.task import SceneTask
from pliant.pipeline.study import study_physics
from pliant.pipeline.workbench import RunContext
from pliant_search.config import PolishConfig
from pliant_search.evaluate.evaluator import build_search_problem
from pliant_search.optimizer import Trial, Value
from pliant_search.polish.descent import Descent, PolishedPath
from pliant_search.polish.slopes import SlopeEvaluator
from pliant_search.problem.search_problem import SearchProblem
from pliant_search.records import PolishedCandidate
from pliant_search.run.journal import Generation, Journal
from pliant_search.run.results import Row
from pliant_search.workers import Setup

APART = 0.2  # of a range: a candidate closer than this in all real variables begins in the same valley

_KEPT = threading.local()  # the evaluator of the search that this thread works for


class Polish:
    """The descents of a search.

    A finished descent is kept in a journal: an interrupted polish goes on with the next one.

    Args:
        context: plugins, store, progress.
        problem: of the search, with a `polish` block.
        executor: works on the descents.
        setup: of its workers.
        folder: of the search's journals.
    """

    def __init__(
        self, context: RunContext, problem: SearchProblem, executor: Executor, setup: Setup, folder: Path
    ) -> None:
        config = problem.config.polish
        assert config is not None
        self._context, self._problem, self._config = context, problem, config
        self._executor, self._setup = executor, setup
        self._journal = Journal(folder, f"polish-{config.steps}")

    def run(self, rows: Sequence[Row]) -> tuple[list[Row], tuple[PolishedCandidate, ...], float]:
        """Descend from the best of these rows; return the new rows, what each descent reached, and the time in s."""
        starts, begun = begins(self._problem, rows, self._config.best), time.perf_counter()
        batches = self._journal.read()
        before_s = batches[-1].wall_s if batches else 0.0
        paths = {_candidate(batch.trials[0]): _path(batch) for batch in batches}
        left = [row for _, row in starts if _candidate(row) not in paths]
        progress = self._context.progress
        with (
            open_progress_bar(progress, "polishing the best", len(starts), len(starts) - len(left)) as bar,
            JobQueue(self._executor, self._work()) as queue,
        ):
            for finished in queue.each(left):
                path = finished.unwrap()
                elapsed_s = before_s + time.perf_counter() - begun
                self._journal.append(_generation(path, self._config, elapsed_s))
                paths[_candidate(path.start)] = path
                bar.advance()
        self._journal.sync()
        ended = [(branch, paths[_candidate(row)]) for branch, row in starts]
        obstacles = dict.fromkeys(path.obstacle for _, path in ended if path.obstacle)
        for cause in obstacles:
            progress.note(f"search.polish left candidates as they are: {cause}.")
        more = [(branch, trial) for branch, path in ended for trial in path.trials]
        wall_s = before_s + time.perf_counter() - begun if left else before_s
        return more, tuple(self._record(branch, path) for branch, path in ended), wall_s

    def _work(self) -> partial[PolishedPath]:
        if isinstance(self._executor, InlineExecutor):
            return partial(descended, SlopeEvaluator(self._context, self._problem), self._config.steps)
        return partial(work, self._setup)

    def _record(self, branch: int, path: PolishedPath) -> PolishedCandidate:
        sign = -1.0 if self._problem.maximised[0] else 1.0
        return PolishedCandidate(
            branch,
            sign * path.start.objective,
            sign * path.best.objective,
            sum(trial.simulated for trial in path.trials),
            path.steps,
            path.converged,
            path.obstacle,
        )


def descended(evaluator: SlopeEvaluator, steps: int, start: Trial) -> PolishedPath:
    """Return the descent from a candidate."""
    return Descent(evaluator, start, steps).path()


def work(setup: Setup, start: Trial) -> PolishedPath:
    """Return the descent from a candidate in a worker, whose evaluator is built once and kept."""
    if getattr(_KEPT, "setup", None) != setup:
        context, study = setup.study.open()
        _KEPT.evaluator, _KEPT.setup = SlopeEvaluator(context, build_search_problem(context, study)), setup
    config = _KEPT.evaluator.problem.config.polish
    return descended(_KEPT.evaluator, config.steps, start)


def begins(problem: SearchProblem, rows: Sequence[Row], count: int) -> list[Row]:
    """Return the best feasible rows that begin in different valleys: other choices or whole numbers, or far apart."""
    found: list[Row] = []
    feasible = [row for row in rows if row[1].feasible]
    for row in sorted(feasible, key=lambda row: row[1].objectives[0]):
        if len(found) == count:
            break
        if not any(_same_valley(problem, row[1].values, better.values) for _, better in found):
            found.append(row)
    return found


def _same_valley(problem: SearchProblem, one: Mapping[str, Value], other: Mapping[str, Value]) -> bool:
    for axis in (searched.variable for searched in problem.variables):
        a, b = one[axis.name], other[axis.name]
        if axis.type != "real":
            if a != b:
                return False
        elif abs(float(a) - float(b)) > APART * (axis.high - axis.low):
            return False
    return True


def _generation(path: PolishedPath, config: PolishConfig, wall_s: float) -> Generation:
    """Return a descent as a line of a journal, the start first.

    `size` is the number of steps, `asked` 0 unless the descent converged.
    """
    start = replace(path.start, cause=path.obstacle)
    return Generation(config.steps if path.converged else 0, path.steps, (start, *path.trials), wall_s)


def _path(generation: Generation) -> PolishedPath:
    """Return the descent of a journal's line."""
    start, *trials = generation.trials
    return PolishedPath(
        replace(start, cause=""), tuple(trials), generation.size, generation.asked > 0, start.cause
    )


def _candidate(trial: Trial) -> tuple[tuple[str, Value], ...]:
    return tuple(sorted(trial.values.items()))


def require_polishable(context: RunContext, problem: SearchProblem, contextual: bool) -> None:
    """Raise `UserError` where the search cannot be polished: several objectives, scenarios, contacts, no slopes."""
    study = problem.study
    cause = ""
    if len(problem.objective_names) > 1:
        cause = "descends on one objective, and search.objective lists several"
    elif contextual:
        cause = "descends on one design, and this optimizer has one for each condition"
    elif problem.config.robust is not None:
        cause = "has no slopes over the scenarios of search.robust"
    elif not any(one.variable.type == "real" and not one.each for one in problem.variables):
        cause = "moves real variables, and this search has none"
    elif isinstance(context.build("task", study.need("task", "a search")), SceneTask):
        cause = "has no slopes through contact, which this task has"
    else:
        config = study_physics(context, study)
        engine: PhysicsBackend = context.build("physics", config)
        if not engine.capabilities.gradients:
            cause = f"follows equilibria, and physics '{config.kind}' has no gradients (use 'quasistatic')"
    if cause:
        raise UserError(f"search.polish {cause}; leave polish out.")
