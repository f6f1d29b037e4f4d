"""The search itself, from a study to a `SearchResult` without the check of its winner."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pliant.config.search import RobustConfig
from pliant.config.study import Study
from pliant.errors import NotReachedError
from pliant.interfaces.optimizer import Variable
from pliant.pipeline.crews import Crew, Given, Processes, checked_workers, cpus
from pliant.pipeline.workbench import Workbench
from pliant.records.search import FoundDesign, Robustness, SearchResult, Slope
from pliant.search.branch import BUDGET, EXHAUSTED, REFUSED_PER_EVALUATION, UNTIL, Branch
from pliant.search.found import best_of, counts_of, design_of, front_of, history_of
from pliant.search.journal import Journal, keep_journals, take_journals
from pliant.search.loop import Loop
from pliant.search.outcome import Evaluates, Task, Told, evaluated
from pliant.search.team import Team
from pliant.search.workers import Inline, Setup, work
from pliant.store.fingerprint import code_fingerprint

# The code that a search depends on; what it imports counts too.
MODULES = ("pliant.search.searching", "pliant.search.evaluation", "pliant.search.problem")
EXPORT = "export"


@dataclass(frozen=True)
class Hands:
    """Who evaluates: an executor, or processes of our own (None: one for each CPU)."""

    executor: Executor | None = None
    workers: int | None = None

    def crew(self, evaluator: Evaluates) -> Crew:
        """Begin; one worker is this process."""
        if self.executor is not None:
            return Given(self.executor, work)
        count = checked_workers(cpus() if self.workers is None else self.workers)
        return Processes(count, work) if count > 1 else Inline(evaluator)

    def setup(self, bench: Workbench, study: Study) -> Setup:
        """What workers get; those of a cluster compare their code with ours."""
        return Setup.of(bench, study, code_fingerprint(MODULES) if self.executor is not None else "")


def problem_of(bench: Workbench, study: Study) -> Any:
    """The study's `SearchProblem`; raises `UserError` for mistakes of its `search`."""
    from pliant.search.problem import SearchProblem

    return SearchProblem.of(study, bench.registry)


def evaluator_of_study(bench: Workbench, study: Study) -> Any:
    """The evaluator of a study, with the scenarios of a robust search."""
    from pliant.search.evaluation import Evaluator
    from pliant.search.scenarios import draw_scenarios

    problem = problem_of(bench, study)
    robust = study.need("search", "a search").robust
    scenarios = draw_scenarios(problem, bench.registry, robust) if robust is not None else ()
    return Evaluator(bench, problem, scenarios)


@dataclass(frozen=True)
class Search:
    """Everything that a search needs.

    Attributes:
        bench, study: surroundings, and what is searched; with an `optimizer` block.
        problem: the study's `SearchProblem`.
        evaluator: of this process.
        hands: who evaluates.
        contextual: whether every candidate is tried in one condition only.
        nominal: of a robust search: the finished nominal one that it is compared with.
    """

    bench: Workbench
    study: Study
    problem: Any
    evaluator: Any
    hands: Hands
    contextual: bool = False
    nominal: SearchResult | None = None

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
        self.space = self.problem.space(search.contextual)
        self.values = self.problem.branches()
        self.recommended: list[tuple[int, Told]] = []
        self.exported = float("inf")
        self.branches = [self._branch(index) for index in range(len(self.values))]

    def _branch(self, index: int) -> Branch:
        bench, optimizer = self.search.bench, self.search.study.optimizer
        return Branch(
            index,
            self.values[index],
            lambda: bench.build("optimizer", optimizer),  # type: ignore[arg-type]
            self.problem,
            self.space,
            Journal(self.partial, f"branch-{index:04d}"),
            self.config.seed,
            self.config.budget,
            self.config.generations,
        )

    def result(self) -> SearchResult:
        """Run it, then look about the best design."""
        search = self.search
        hands, bench = search.hands, search.bench
        team = Team(hands.crew(search.evaluator), hands.setup(bench, search.study))
        title = "searching" if self.config.robust is None else "searching, robust"
        loop = Loop(self.branches, team, bench.progress, title, self._ended, self._shown)
        loop.run()
        rows = [(branch.index, row) for branch in self.branches for row in branch.rows]
        best = self._best(rows)
        refused, failed = counts_of(rows)
        self._say_exhausted(refused)
        designs = tuple(design_of(self.problem, row) for row in best)
        everything = [told for _, told in (*rows, *self.recommended)]
        result = SearchResult(
            optimizer=search.study.optimizer.kind if search.study.optimizer else "",
            seed=self.config.seed,
            variables=tuple(self.problem.records()),
            objectives=tuple(self.problem.objective_names),
            maximised=tuple(self.problem.maximised),
            conditions=tuple(c.name for c in self.problem.conditions if self.config.conditions),
            branches=tuple(dict(values) for values in self.values),
            history=history_of(self._variables(), rows, self.space.objectives),
            best=designs,
            evaluations=sum(told.simulated for told in everything),
            simulations=sum(told.simulations for told in everything),
            refused=refused,
            failed=failed,
            stopped=self._stopped(designs),
            wall_s=loop.wall_s,
        )
        return _about_the_best(search, result)

    def _ended(self, branch: Branch) -> None:
        """What only a branch's optimizer knows: what it recommends, and its files where it is the best so far."""
        rows = [evaluated(self.search.evaluator, task) for task in branch.recommended()]
        self.recommended += [(branch.index, row) for row in rows]
        best = best_of((branch.index, row) for row in (*branch.rows, *rows))
        score = best[1].objectives[0] if best else float("inf")
        folder = self.partial / EXPORT
        if score < self.exported or not folder.exists():
            self.exported = score
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            branch.optimizer.export(folder)

    def _best(self, rows: Sequence[tuple[int, Told]]) -> list[tuple[int, Told]]:
        """The best, the front of several objectives, or the best of each condition."""
        everything = [*rows, *self.recommended]
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
        cause = next(iter(refused), "")
        of_all = f" in {len(spent)} of {len(self.branches)} searches" if len(self.branches) > 1 else ""
        self.search.bench.progress.note(
            f"stopped early{of_all}: more than {REFUSED_PER_EVALUATION} candidates were refused for each one of the "
            f"budget, most by '{cause}' ({refused[cause]} times)."
            if cause
            else f"stopped early{of_all}: the optimizer proposes nothing more."
        )

    def _shown(self, value: float) -> str:
        return f"{-value if self.problem.maximised[0] else value:.4g}"


def _about_the_best(search: Search, result: SearchResult) -> SearchResult:
    """Slopes, limits, and what robustness costs."""
    if not result.best:
        return result
    from pliant.search.limits import limits
    from pliant.search.sensitivity import slopes

    best, plain = result.best[0], _nominal_evaluator(search)
    found: tuple[Slope, ...] = tuple(slopes(plain, search.problem, best))
    causes = {**result.refused, **result.failed}
    told = tuple(limits(search.problem, best, found, result.history, causes))
    return replace(result, slopes=found, limits=told, robustness=_robustness(search, plain, best))


def _nominal_evaluator(search: Search) -> Any:
    """Without the scenarios of a robust search."""
    if search.study.need("search", "a search").robust is None:
        return search.evaluator
    from pliant.search.evaluation import Evaluator

    return Evaluator(search.bench, search.problem, ())


def _robustness(search: Search, plain: Evaluates, best: FoundDesign) -> Robustness | None:
    """Both best designs, nominal and robust, undisturbed and in the same scenarios."""
    robust = search.study.need("search", "a search").robust
    if robust is None or search.nominal is None or not search.nominal.best:
        return None
    nominal = search.nominal.best[0]
    designs = {"nominal": nominal, "robust": best}
    alone = {name: _score(plain, design) for name, design in designs.items()}
    together = {name: _score(search.evaluator, design) for name, design in designs.items()}
    sign = -1.0 if search.problem.maximised[0] else 1.0
    return Robustness(
        measure=robust.measure,
        level=robust.level,
        samples=robust.samples,
        sources=_sources(robust),
        nominal_of_nominal=sign * _first(alone["nominal"]),
        robust_of_nominal=sign * _first(together["nominal"]),
        nominal_of_robust=sign * _first(alone["robust"]),
        robust_of_robust=sign * _first(together["robust"]),
        spread={name: sign * np.array(told.scenarios, float) for name, told in together.items()},
        nominal=nominal,
    )


def _sources(robust: RobustConfig) -> tuple[str, ...]:
    """What was varied, in words."""
    varied = [
        f"{key}, standard deviation {said.get('sd')}" if isinstance(said, Mapping) else f"{key} ± {said}"
        for key, said in robust.vary.items()
    ]
    return (*(["laws within their error bars"] if robust.laws else []), *varied)


def _score(evaluator: Evaluates, design: FoundDesign) -> Told:
    return evaluated(evaluator, Task(design.number, design.values, design.context))


def _first(told: Told) -> float:
    return told.objectives[0] if told.objectives else float("nan")


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
    causes = {**result.refused, **result.failed}
    most = max(causes, key=lambda cause: causes[cause], default="")
    why = f"; most often: {most} ({causes[most]} of {len(result.history)} candidates)" if most else ""
    return NotReachedError(f"nothing feasible was found in {result.evaluations} evaluations{why}.")
