"""Run of a search, from a study to a `SearchResult` without the check of its best design."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pliant.config.study import Study
from pliant.errors import NotReachedError
from pliant.execution.executors import Executor
from pliant.execution.jobs import JobQueue
from pliant.pipeline.workbench import RunContext
from pliant.store.store import write_atomically
from pliant_search.analyse.limits import limits
from pliant_search.analyse.sensitivity import slopes
from pliant_search.evaluate.evaluator import Evaluator, evaluated, evaluator_from_study
from pliant_search.optimizer import Space, Trial
from pliant_search.problem.search_problem import SearchProblem
from pliant_search.records import (
    STATUSES,
    FoundDesign,
    PolishedCandidate,
    Robustness,
    SearchResult,
    Slope,
)
from pliant_search.run.journal import Journal
from pliant_search.run.loop import BUDGET, EXHAUSTED, REFUSED_PER_EVALUATION, UNTIL, Branch, Loop
from pliant_search.run.polishing import Polish
from pliant_search.run.reevaluation import reevaluated
from pliant_search.run.results import Row, best_row, build_history, found_design, pareto_front, refusal_counts
from pliant_search.workers import Setup, finished_trial, trial_queue

EXPORT = "export"
# A robust search starts within a tenth of every range around the nominal design: deviations shift an optimum little,
# while a first guess may be anywhere.
SPREAD = 0.1


def warm_started(before: Sequence[FoundDesign], problem: SearchProblem, space: Space) -> Space:
    """Return the space with the first known design, the best nominal one, as its starting point.

    The nominal optimum is mostly good under deviations and costs a fraction of the runs. A robust search therefore
    starts from it and includes the nominal designs in its choice, so that its result is never worse than the nominal
    design; if it finds no better one, the nominal design is the most robust that is known.

    The space is unchanged without a nominal design, if the study starts `anywhere`, and with contexts, which have one
    best design each.
    """
    if not before or space.contexts or problem.config.start != "study":
        return space
    values = before[0].values
    return replace(space, start={one.name: values[one.name] for one in space.variables}, spread=SPREAD)


class Halving:
    """Successive halving over the searches of a study: the best of them continue with a multiple of the budget.

    Every search gets the budget first; the best 1/`factor` of them get `factor` times as many candidates each, and
    so on until one remains. Each step costs about as much as the first (Jamieson, Talwalkar, AISTATS 2016,
    whose "arms" are our branches). The choices are recorded, so that an interrupted search makes the same ones.

    Args:
        folder: of the journals; contains the recorded choices.
        count: number of branches.
        factor: of the study; None: no halving.
        of: content that the choices depend on; choices recorded for other content are discarded.

    Attributes:
        left: the branches that continue.
    """

    def __init__(self, folder: Path, count: int, factor: int | None, of: Sequence[int | None]) -> None:
        self._file, self._factor, self._of = folder / "halving.json", factor, [count, factor, *of]
        self._chosen: list[list[int]] = []
        try:
            plain = json.loads(self._file.read_text(encoding="utf-8"))
            self._chosen = plain["chosen"] if factor is not None and plain["of"] == self._of else []
        except (OSError, ValueError, KeyError, TypeError):
            pass  # choices are made again
        self.left = self._chosen[-1] if self._chosen else list(range(count))

    def times(self, branch: int) -> int:
        """Return the present budget of a branch as a multiple of the first budget."""
        return int((self._factor or 1) ** sum(branch in chosen for chosen in self._chosen))

    def go_on(self, scores: Sequence[float]) -> bool:
        """Select the branches that continue by their best objectives; return whether any continues."""
        if self._factor is None or len(self.left) == 1:
            return False
        ranked = sorted(self.left, key=lambda branch: (scores[branch], branch))
        self.left = sorted(ranked[: -(-len(self.left) // self._factor)])
        self._chosen.append(self.left)
        write_atomically(self._file, json.dumps({"of": self._of, "chosen": self._chosen}))
        return True


class Search:
    """State of one running search.

    Args:
        context: surroundings.
        study: the searched study, with an `optimizer` block.
        problem: the study's `SearchProblem`.
        executor: evaluates the trials.
        folder: contains journals, from which the search resumes.
        nominal: of a robust search: the finished nominal search that it starts from and is compared with.
        earlier: of a later round: designs of the previous round; it starts at the first, and the choice includes all.
    """

    def __init__(
        self,
        context: RunContext,
        study: Study,
        problem: SearchProblem,
        executor: Executor,
        folder: Path,
        nominal: SearchResult | None = None,
        earlier: Sequence[FoundDesign] = (),
    ) -> None:
        self.context, self.study, self.problem, self.executor = context, study, problem, executor
        self.folder, self.nominal, self.config = folder, nominal, study.need("search", "a search")
        self.evaluator = evaluator_from_study(context, study)
        optimizer = type(context.build("optimizer", study.need("optimizer", "a search")))
        # Whether every candidate is evaluated in one condition only.
        self.contextual = bool(optimizer.capabilities.contexts and self.config.conditions)
        begun = tuple(nominal.best) if nominal is not None else ()
        self.before = (*begun, *earlier)
        self.space = warm_started(self.before, problem, problem.space(self.contextual))
        self.recommendations: dict[int, list[Trial]] = {}  # also designs of the search before; by branch
        self.polished_rows: list[Row] = []
        self.polished: tuple[PolishedCandidate, ...] = ()
        self.exported = float("inf")
        factor = self.config.halving.factor if self.config.halving is not None else None
        of = (self.config.budget, self.config.generations)
        self.halving = Halving(folder, len(problem.branches()), factor, of)
        self.branches = [self._branch(index) for index in range(len(problem.branches()))]

    def _branch(self, index: int) -> Branch:
        return Branch(
            index,
            self.problem,
            lambda: self.context.build("optimizer", self.study.need("optimizer", "a search")),
            self.space,
            Journal(self.folder, f"branch-{index:04d}"),
            self.halving.times(index),
        )

    def result(self) -> SearchResult:
        """Run the search, then analyse its best design."""
        setup = Setup.from_study(self.context, self.study, self.executor)
        with trial_queue(self.executor, setup, self.evaluator) as queue:
            wall_s = self._all_rungs(queue)
            self._try_before()
            polish_s = self._polish(setup)
            again, more_s = self._reevaluated()
            result = self._found(wall_s + polish_s + more_s, again)
            return self._analysed(result, setup) if result.best else result

    def _all_rungs(self, queue: JobQueue[Trial, Trial]) -> float:
        """Run every branch, then those that halving continues; return the wall time in s."""
        progress, wall_s, active = self.context.progress, 0.0, self.branches
        title = "searching" if self.config.robust is None else "searching, robust"
        sign = -1 if self.problem.maximised[0] else 1
        while True:
            loop = Loop(
                active, queue, progress, title, self._ended, lambda value: f"{sign * value:.4g}", wall_s
            )
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
        """Return the best objective of a branch."""
        rows = (*branch.trials, *self.recommendations.get(branch.index, ()))
        best = best_row((branch.index, row) for row in rows)
        return best[1].objectives[0] if best else float("inf")

    def _ended(self, branch: Branch) -> None:
        """Keep a branch's recommendations, and export its optimizer's files if the branch is the best so far."""
        rows = [evaluated(self.evaluator, task) for task in branch.recommended()]
        self.recommendations[branch.index] = rows
        score, folder = self._score(branch), self.folder / EXPORT
        if score < self.exported or not folder.exists():
            self.exported = score
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            branch.optimizer.export(folder)

    def _rows(self, recommended: bool = False) -> list[Row]:
        """Return all trials with their branches, those of descents last; with `recommended` also the recommendations
        and earlier designs.
        """
        rows = [(branch.index, row) for branch in self.branches for row in branch.trials]
        more = self.recommendations.items() if recommended else ()
        return rows + self.polished_rows + [(branch, row) for branch, listed in more for row in listed]

    def _try_before(self) -> None:
        """Evaluate designs of the previous search that this one has not tried, and add them to the choice."""

        def key(branch: int, one: Trial | FoundDesign) -> tuple[object, ...]:
            return branch, one.context, tuple(sorted(one.values.items()))

        tried = {key(branch, row) for branch, row in self._rows()}
        for one in self.before:
            if key(one.branch, one) not in tried:
                told = evaluated(self.evaluator, Trial(-1, one.values, one.context))
                self.recommendations.setdefault(one.branch, []).append(told)

    def _polish(self, setup: Setup) -> float:
        """Descend from the best candidates, if the study requests it; return the time in s."""
        if self.config.polish is None:
            return 0.0
        polish = Polish(self.context, self.problem, self.executor, setup, self.folder)
        self.polished_rows, self.polished, wall_s = polish.run(self._rows(recommended=True))
        return wall_s

    def _reevaluated(self) -> tuple[list[Row], float]:
        """Return the re-evaluated best candidates and the time in s; empty if the study does not request it."""
        if self.config.confirm is None:
            return [], 0.0
        setup = Setup.from_study(self.context, self.study, self.executor, confirm=True)
        queue = trial_queue(
            self.executor, setup, evaluator_from_study(self.context, self.study, confirm=True)
        )
        rows = self._rows(recommended=True)
        return reevaluated(self.problem, rows, queue, self.context.progress, self.folder)

    def _found(self, wall_s: float, again: Sequence[Row]) -> SearchResult:
        """Return the result of the branches; `again` are the re-evaluated candidates among which the best is chosen."""
        problem, rows, everything = self.problem, self._rows(), self._rows(recommended=True)
        refused, failed = refusal_counts(rows)
        self._say_exhausted(refused)
        designs = tuple(found_design(problem, row) for row in self._best(again or everything))
        told = [row for _, row in (*everything, *again)]
        if self.contextual and problem.shared:
            # Merged variables have the value of the row's own condition instead of a share.
            rows = [(b, replace(row, values=problem.stated(row.values, row.context))) for b, row in rows]
        axes = (*(one.variable for one in problem.variables if one.each), *self.space.variables)
        return SearchResult(
            optimizer=self.study.need("optimizer", "a search").kind,
            seed=self.config.seed,
            variables=problem.records(self.contextual),
            objectives=problem.objective_names,
            maximised=problem.maximised,
            conditions=tuple(c.name for c in problem.conditions if self.config.conditions),
            branches=tuple(dict(values) for values in problem.branches()),
            history=build_history(axes, rows, self.space.objectives),
            best=designs,
            evaluations=sum(row.simulated for row in told),
            simulations=sum(row.simulations for row in told),
            refused=refused,
            failed=failed,
            stopped=self._stopped(designs),
            wall_s=wall_s,
            polished=self.polished,
        )

    def _best(self, everything: Sequence[Row]) -> list[Row]:
        """Return the best row, the front of several objectives, or the best row of each condition."""
        if self.space.objectives > 1 and not self.contextual:
            return pareto_front(everything)
        contexts: Iterable[int | None] = range(len(self.space.contexts)) if self.contextual else [None]
        found = [best_row(row for row in everything if c in (None, row[1].context)) for c in contexts]
        return [row for row in found if row is not None]

    def _stopped(self, best: Sequence[FoundDesign]) -> str:
        """Return why the search of the best design ended; of several reasons `until`, then budget, comes first."""
        reasons = {self.branches[design.branch].stopped for design in best}
        reasons = reasons or {branch.stopped for branch in self.branches}
        return next((reason for reason in (UNTIL, BUDGET, EXHAUSTED) if reason in reasons), BUDGET)

    def _say_exhausted(self, refused: Mapping[str, int]) -> None:
        spent = [branch for branch in self.branches if branch.stopped == EXHAUSTED]
        if not spent:
            return
        cause = next(iter(refused), "") if any(branch.gave_up for branch in spent) else ""
        of_all = f" in {len(spent)} of {len(self.branches)} searches" if len(self.branches) > 1 else ""
        self.context.progress.note(
            f"stopped early{of_all}: more than {REFUSED_PER_EVALUATION} candidates were refused for each one of the "
            f"budget, most by '{cause}' ({refused[cause]} times)."
            if cause
            else f"stopped early{of_all}: the optimizer proposes nothing more."
        )

    def _analysed(self, result: SearchResult, setup: Setup) -> SearchResult:
        """Return the result with slopes, limits and, of a robust search, the cost of robustness."""
        best, plain, config = result.best[0], self.evaluator, self.config
        if config.robust is not None:  # slopes are evaluated without scenarios
            plain = Evaluator(self.context, self.problem, ())
            nominal = self.study.model_copy(update={"search": config.model_copy(update={"robust": None})})
            setup = Setup.from_study(self.context, nominal, self.executor)
        queue = trial_queue(self.executor, setup, plain)
        found: tuple[Slope, ...] = ()
        if config.sensitivity:
            found = slopes(
                self.problem, best, lambda t: map(finished_trial, queue.each(t)), self.context.progress
            )
        said = limits(self.problem, best, found, result.history, {**result.refused, **result.failed})
        robust, beside = config.robust, self.nominal
        if robust is None or beside is None or not beside.best:
            return replace(result, slopes=found, limits=said)
        sign = -1.0 if self.problem.maximised[0] else 1.0
        alone, together = (
            [evaluated(judge, Trial(one.number, one.values, one.context)) for one in (beside.best[0], best)]
            for judge in (plain, self.evaluator)
        )
        varied = [
            f"{key}, standard deviation {amount.get('sd')}"
            if isinstance(amount, Mapping)
            else f"{key} ± {amount}"
            for key, amount in robust.vary.items()
        ]
        spread = [sign * np.array(told.scenarios, float) for told in together]
        price = Robustness(
            measure=robust.measure,
            level=robust.level,
            samples=robust.samples,
            sources=(*(["laws within their error bars"] if robust.laws else []), *varied),
            nominal_of_nominal=sign * alone[0].objective,
            robust_of_nominal=sign * together[0].objective,
            nominal_of_robust=sign * alone[1].objective,
            robust_of_robust=sign * together[1].objective,
            spread=dict(zip(("nominal", "robust"), spread, strict=True)),
            nominal=beside.best[0],
        )
        return replace(result, slopes=found, limits=said, robustness=price)


def nothing_found(result: SearchResult) -> NotReachedError:
    """Return the error of a search without a feasible candidate, with the most frequent cause."""
    history = result.history
    simulated = (history.status == STATUSES.index("ok")) & ~np.isfinite(history.objectives[:, 0])
    causes = {**result.refused, **result.failed}
    if simulated.any():
        causes["a constraint on metrics is broken"] = int(simulated.sum())
        causes = {cause: count for cause, count in causes.items() if cause not in result.refused}
    most = max(causes, key=causes.__getitem__, default="")
    why = f"; most often: {most} ({causes[most]} of {len(result.history)} candidates)" if most else ""
    return NotReachedError(f"nothing feasible was found in {result.evaluations} evaluations{why}.")
