"""The search itself, from a study to a `SearchResult` without the check of its winner."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pliant.config.study import Study
from pliant.errors import NotReachedError
from pliant.execution.executors import Executor, InlineExecutor
from pliant.execution.jobs import JobQueue
from pliant.interfaces.optimizer import Trial, Variable
from pliant.pipeline.workbench import Workbench
from pliant.records.search import STATUSES, FoundDesign, SearchResult
from pliant.search.analyse.post_analysis import Evaluators, post_analysis
from pliant.search.evaluate.evaluator import Evaluator, evaluated, evaluator_of_study
from pliant.search.problem.search_problem import SearchProblem
from pliant.search.run.branch import BUDGET, EXHAUSTED, REFUSED_PER_EVALUATION, UNTIL, Branch
from pliant.search.run.halving import Halving
from pliant.search.run.journal import Journal, keep_journals, take_journals
from pliant.search.run.loop import Loop
from pliant.search.run.reevaluation import reevaluated
from pliant.search.run.results import best_of, counts_of, design_of, front_of, history_of
from pliant.search.run.warm_start import untried_nominal, warm_started
from pliant.search.workers import Setup, queue_of

EXPORT = "export"


@dataclass(frozen=True)
class Search:
    """Everything that a search needs.

    Attributes:
        bench, study: surroundings, and what is searched; with an `optimizer` block.
        problem: the study's `SearchProblem`.
        evaluator: of this process.
        executor: who evaluates.
        contextual: whether every candidate is tried in one condition only.
        nominal: of a robust search: the finished nominal one where it begins, and that it is compared with.
    """

    bench: Workbench
    study: Study
    problem: SearchProblem
    evaluator: Evaluator
    executor: Executor
    contextual: bool = False
    nominal: SearchResult | None = None

    def setup(self) -> Setup:
        """What workers get."""
        return Setup.of(self.bench, self.study, self.executor)

    def evaluators(self) -> Evaluators:
        """Who looks about the best design: without the scenarios of a robust search."""

        config = self.study.need("search", "a search")
        plain, setup = self.evaluator, self.setup()
        if config.robust is not None:
            plain = Evaluator(self.bench, self.problem, ())
            nominal = self.study.model_copy(update={"search": config.model_copy(update={"robust": None})})
            setup = Setup.of(self.bench, nominal, self.executor)
        alone = isinstance(self.executor, InlineExecutor)
        return Evaluators(plain, self.evaluator, None if alone else queue_of(self.executor, setup, plain))

    def run(self, partial: Path, kept: Path, files: Path) -> SearchResult:
        """Search.

        Args:
            partial: holds journals; what stands there is gone on from.
            kept: journals of the same search with another budget, taken and left.
            files: where the optimizer's own files go.
        """
        if take_journals(kept, partial):
            self.bench.progress.note("going on from the journal of the same search with another budget.")
        run = _Run(self, partial)
        result = run.result()
        result = replace(result, files=_moved(partial / EXPORT, files))
        keep_journals(partial, kept)
        return result


class _Run:
    """One search under way."""

    def __init__(self, search: Search, partial: Path) -> None:
        self.search, self.problem, self.partial = search, search.problem, partial
        self.config = search.study.need("search", "a search")
        self.space = warm_started(search.nominal, self.problem, self.problem.space(search.contextual))
        self.values = self.problem.branches()
        self.recommendations: dict[int, list[Trial]] = {}
        self.exported = float("inf")
        config = self.config
        factor = config.halving.factor if config.halving is not None else None
        self.halving = Halving(partial, len(self.values), factor, (config.budget, config.generations))
        self.branches = [self._branch(index) for index in range(len(self.values))]

    def _branch(self, index: int) -> Branch:
        bench, optimizer = self.search.bench, self.search.study.optimizer
        times, generations = self.halving.times(index), self.config.generations
        return Branch(
            index,
            self.values[index],
            lambda: bench.build("optimizer", optimizer),  # type: ignore[arg-type]
            self.problem,
            self.space,
            Journal(self.partial, f"branch-{index:04d}"),
            self.config.seed,
            times * self.config.budget,
            times * generations if generations is not None else None,
            whole=self.config.halving is not None,
        )

    def result(self) -> SearchResult:
        """Run it, then look about the best design."""
        search = self.search
        with queue_of(search.executor, search.setup(), search.evaluator) as queue:
            wall_s = self._all_rungs(queue)
            self._try_nominal()
            again, more_s = self._reevaluated()
            result = self._found(wall_s + more_s, again)
            return post_analysis(self.problem, search.evaluators(), result, search.nominal)

    def _all_rungs(self, queue: JobQueue[Trial, Trial]) -> float:
        """Every branch, then those that go on; returns the wall time in s."""
        progress, wall_s, active = self.search.bench.progress, 0.0, self.branches
        title = "searching" if self.config.robust is None else "searching, robust"
        while True:
            loop = Loop(active, queue, progress, title, self._ended, self._shown, wall_s)
            loop.run()
            wall_s = loop.wall_s
            before = len(self.halving.left)
            if not self.halving.go_on([self._score(branch) for branch in self.branches]):
                return wall_s
            for index in self.halving.left:
                self.branches[index] = self._branch(index)
            active = [self.branches[index] for index in self.halving.left]
            times = self.halving.times(active[0].index)
            progress.note(f"{len(active)} of {before} searches go on, to {times} times the budget.")

    def _score(self, branch: Branch) -> float:
        """The best objective of a branch."""
        rows = (*branch.trials, *self.recommendations.get(branch.index, ()))
        best = best_of((branch.index, row) for row in rows)
        return best[1].objectives[0] if best else float("inf")

    @property
    def recommended(self) -> list[tuple[int, Trial]]:
        """What the optimizers recommend beyond what they tried, and nominal designs, with branches."""
        return [(branch, row) for branch, rows in self.recommendations.items() for row in rows]

    def _try_nominal(self) -> None:
        """The nominal designs take part in the choice."""
        for branch, task in untried_nominal(self.search.nominal, self._rows()):
            self.recommendations.setdefault(branch, []).append(evaluated(self.search.evaluator, task))

    def _reevaluated(self) -> tuple[list[tuple[int, Trial]], float]:
        """The best candidates once more, and the time of it in s; none where the study does not ask for it."""
        search = self.search
        if self.config.confirm is None:
            return [], 0.0
        setup = Setup.of(search.bench, search.study, search.executor, confirm=True)
        evaluator = evaluator_of_study(search.bench, search.study, confirm=True)
        rows = [*self._rows(), *self.recommended]
        queue = queue_of(search.executor, setup, evaluator)
        return reevaluated(self.problem, rows, queue, search.bench.progress, self.partial)

    def _rows(self) -> list[tuple[int, Trial]]:
        return [(branch.index, row) for branch in self.branches for row in branch.trials]

    def _found(self, wall_s: float, again: Sequence[tuple[int, Trial]]) -> SearchResult:
        """What the branches come to; `again` are the candidates among which the best is chosen."""
        search = self.search
        rows = self._rows()
        best = self._best(again or [*rows, *self.recommended])
        refused, failed = counts_of(rows)
        self._say_exhausted(refused)
        designs = tuple(design_of(self.problem, row) for row in best)
        everything = [told for _, told in (*rows, *self.recommended, *again)]
        return SearchResult(
            optimizer=search.study.optimizer.kind if search.study.optimizer else "",
            seed=self.config.seed,
            variables=tuple(self.problem.records(search.contextual)),
            objectives=tuple(self.problem.objective_names),
            maximised=tuple(self.problem.maximised),
            conditions=tuple(c.name for c in self.problem.conditions if self.config.conditions),
            branches=tuple(dict(values) for values in self.values),
            history=history_of(self._variables(), self._stated(rows), self.space.objectives),
            best=designs,
            evaluations=sum(told.simulated for told in everything),
            simulations=sum(told.simulations for told in everything),
            refused=refused,
            failed=failed,
            stopped=self._stopped(designs),
            wall_s=wall_s,
        )

    def _stated(self, rows: Sequence[tuple[int, Trial]]) -> Sequence[tuple[int, Trial]]:
        """Rows in which variables that are one have the value of the row's own condition instead of a share."""
        if not (self.search.contextual and self.problem.shared):
            return rows
        return [(b, replace(r, values=self.problem.stated(r.values, r.context))) for b, r in rows]

    def _ended(self, branch: Branch) -> None:
        """What only a branch's optimizer knows: what it recommends, and its files where it is the best so far."""
        rows = [evaluated(self.search.evaluator, task) for task in branch.recommended()]
        self.recommendations[branch.index] = rows
        score = self._score(branch)
        folder = self.partial / EXPORT
        if score < self.exported or not folder.exists():
            self.exported = score
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            branch.optimizer.export(folder)

    def _best(self, everything: Sequence[tuple[int, Trial]]) -> list[tuple[int, Trial]]:
        """The best, the front of several objectives, or the best of each condition."""
        if self.search.contextual:
            contexts = range(len(self.space.contexts))
            found = [best_of(row for row in everything if row[1].context == c) for c in contexts]
            return [row for row in found if row is not None]
        if self.space.objectives > 1:
            return front_of(everything)
        best = best_of(everything)
        return [] if best is None else [best]

    def _variables(self) -> tuple[Variable, ...]:
        """The columns of the history: of the branches, then of the space."""
        each = [one.variable for one in self.problem.variables if one.each]
        return (*each, *self.space.variables)

    def _stopped(self, best: Sequence[FoundDesign]) -> str:
        """Why the search of the best design ended; of several, or of none, what tells most."""
        reasons = {self.branches[design.branch].stopped for design in best}
        reasons = reasons or {branch.stopped for branch in self.branches}
        return next((reason for reason in (UNTIL, BUDGET, EXHAUSTED) if reason in reasons), BUDGET)

    def _say_exhausted(self, refused: dict[str, int]) -> None:
        spent = [branch for branch in self.branches if branch.stopped == EXHAUSTED]
        if not spent:
            return
        cause = next(iter(refused), "") if any(branch.gave_up for branch in spent) else ""
        of_all = f" in {len(spent)} of {len(self.branches)} searches" if len(self.branches) > 1 else ""
        self.search.bench.progress.note(
            f"stopped early{of_all}: more than {REFUSED_PER_EVALUATION} candidates were refused for each one of the "
            f"budget, most by '{cause}' ({refused[cause]} times)."
            if cause
            else f"stopped early{of_all}: the optimizer proposes nothing more."
        )

    def _shown(self, value: float) -> str:
        return f"{-value if self.problem.maximised[0] else value:.4g}"


def _moved(folder: Path, files: Path) -> tuple[str, ...]:
    """The optimizer's files where they stay; names relative to that folder."""
    names = sorted(file.relative_to(folder).as_posix() for file in folder.rglob("*") if file.is_file())
    shutil.rmtree(files, ignore_errors=True)
    if names:
        files.parent.mkdir(parents=True, exist_ok=True)
        shutil.copytree(folder, files)
    return tuple(names)


def nothing_found(result: SearchResult) -> NotReachedError:
    """The error of a search without a feasible candidate: what went wrong most."""
    history = result.history
    simulated = (history.status == STATUSES.index("ok")) & ~np.isfinite(history.objectives[:, 0])
    causes = {**result.refused, **result.failed}
    if simulated.any():
        causes["a constraint on metrics is broken"] = int(simulated.sum())
        causes = {cause: count for cause, count in causes.items() if cause not in result.refused}
    most = max(causes, key=lambda cause: causes[cause], default="")
    why = f"; most often: {most} ({causes[most]} of {len(result.history)} candidates)" if most else ""
    return NotReachedError(f"nothing feasible was found in {result.evaluations} evaluations{why}.")
