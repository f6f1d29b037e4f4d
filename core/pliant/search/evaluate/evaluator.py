"""What a candidate of a search comes to: its study simulated in every condition, and in every scenario."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from pliant.config.study import Study
from pliant.errors import (
    InvalidDesignError,
    MissingDependencyError,
    NotReachedError,
    PliantError,
    UserError,
    interrupted,
)
from pliant.interfaces.optimizer import FAILED, NOT_A_NUMBER, OK, REFUSED, State, Trial, Value
from pliant.pipeline.workbench import Workbench
from pliant.records.rollout import TaskResult
from pliant.search.evaluate.fast_path import FastPath, Timer, untimed
from pliant.search.evaluate.scenarios import Scenario, draw_scenarios, measure
from pliant.search.problem.reevaluation_problem import reevaluation_problem
from pliant.search.problem.search_problem import SearchProblem
from pliant.search.problem.study_setter import StudySetter

Metrics = Mapping[str, float]
OF_EVERY_TASK = ("converged", "outside_domain")


class Evaluates(Protocol):
    """What a search asks of an evaluator."""

    def evaluate(self, values: Mapping[str, Value], context: int = -1) -> Trial:
        """What becomes of one candidate."""
        ...


def evaluated(evaluator: Evaluates, trial: Trial) -> Trial:
    """The trial with its result; only what every trial would meet (`PliantError`) is raised."""
    try:
        found = evaluator.evaluate(trial.values, trial.context)
    except PliantError:
        raise
    except Exception as error:  # a plugin may fail in any way
        if interrupted(error):
            raise KeyboardInterrupt from None
        text = " ".join(str(error).split())
        return trial.failed(f"{type(error).__name__}: {text}" if text else type(error).__name__)
    return replace(found, number=trial.number, values=trial.values, context=trial.context)


class _EndedError(Exception):
    """A candidate is done before its end."""

    def __init__(self, state: State, cause: str, violation: float = 0.0) -> None:
        super().__init__(cause)
        self.state: State = state
        self.violation = violation


class Evaluator:
    """Evaluates candidates one after another; what they share is made once and kept.

    Objectives are computed in each condition from that condition's metrics, then their mean or worst is taken as the
    study says; in a robust search that is done in every scenario, and its measure is the candidate's objective.
    Metrics, and constraints on them, are those without scenarios.

    Args:
        bench: plugins and store.
        problem: what is searched.
        scenarios: of a robust search.
        timed: measures parts of the work; see `pliant.search.evaluate.fast_path`.

    Raises:
        UserError: the study lacks a block, or a scenario varies what the meta-model cannot follow.
    """

    def __init__(
        self,
        bench: Workbench,
        problem: SearchProblem,
        scenarios: Sequence[Scenario] = (),
        timed: Timer[Any] = untimed,
    ) -> None:
        for block in ("chain", "task"):
            problem.study.need(block, "a search")
        self.bench, self.problem, self.scenarios = bench, problem, tuple(scenarios)
        self.path = FastPath(bench, problem.study, timed)
        self._setter = StudySetter(problem.study, bench.registry)
        self._timed = timed
        self.looked_up = False  # whether the task gives what the formulas name
        self.path.laws.check_varied(_law_parameters(self.scenarios))

    def result(self, study: Study) -> TaskResult:
        """The task of a study, in its own engine; raises as `simulate_study`."""
        return self.path.result(study)

    def evaluate(self, values: Mapping[str, Value], context: int = -1) -> Trial:
        """What a candidate comes to: a trial without a number; a bad one has a state that says so, and raises nothing.

        Args:
            values: one per variable.
            context: index of the one condition to try it in; −1: all of them.

        Raises:
            UserError: what every candidate would meet: a metric that the task does not have, a missing package.
        """
        started = time.perf_counter()
        run = _Run(self, values, context)
        try:
            found = run.evaluated()
        except _EndedError as end:
            found = replace(run.trial, state=end.state, cause=str(end), violation=end.violation)
        conditions = {name: numbers(metrics) for name, metrics in run.measured.items()}
        return replace(
            found,
            metrics=_mean(list(conditions.values())) if found.state == OK else {},
            conditions=conditions,
            simulations=run.simulations,
            wall_s=time.perf_counter() - started,
        )


class _Run:
    """One candidate under way."""

    def __init__(self, evaluator: Evaluator, values: Mapping[str, Value], context: int) -> None:
        self.evaluator, self.values, self.context = evaluator, values, context
        self.trial = Trial(-1, values, context)
        self.problem = evaluator.problem
        self.measured: dict[str, Mapping[str, Any]] = {}
        self.simulations = 0

    def evaluated(self) -> Trial:
        """Conditions first, then scenarios; raises `_EndedError` where it goes no further."""
        broken = self.problem.violated(self.values, self.context)
        if broken:
            raise _EndedError(REFUSED, "; ".join(broken), float(sum(broken.values())))
        everywhere = range(len(self.problem.conditions))
        conditions = list(everywhere) if self.context < 0 else [self.context]
        studies = {c: self._study(c) for c in conditions}
        nominal = []
        for c, study in studies.items():
            name = self.problem.conditions[c].name
            self.measured[name] = self._metrics(study, None, self._said(c))
            nominal.append(self._objectives(self.measured[name], self._said(c)))
        violations = self._violations()
        if not self.evaluator.scenarios:
            return self._done(self._over_conditions(nominal), violations)
        rows = [self._in_scenario(scenario, studies) for scenario in self.evaluator.scenarios]
        robust = self.problem.config.robust
        assert robust is not None
        objectives = tuple(measure(column, robust) for column in zip(*rows, strict=True))
        return self._done(objectives, violations, tuple(row[0] for row in rows))

    def _done(
        self,
        objectives: tuple[float, ...],
        violations: Mapping[str, float],
        scenarios: tuple[float, ...] = (),
    ) -> Trial:
        return replace(
            self.trial,
            state=OK,
            objectives=objectives,
            cause="; ".join(violations),
            violation=float(sum(violations.values())),
            scenarios=scenarios,
        )

    def _study(self, condition: int) -> Study:
        """The candidate in one condition; one that is not possible is refused."""
        try:
            return self.evaluator._timed("apply", lambda: self.problem.apply(self.values, condition))
        except MissingDependencyError:
            raise
        except UserError as error:
            raise _EndedError(REFUSED, str(error)) from None

    def _in_scenario(self, scenario: Scenario, studies: Mapping[int, Study]) -> tuple[float, ...]:
        """Objectives over the conditions in one scenario."""
        rows = []
        for c, study in studies.items():
            said = f"{scenario.name}{f', {name}' if (name := self._said(c)) else ''}"
            metrics = self._metrics(self._changed(scenario, study, c, said), scenario, said)
            rows.append(self._objectives(metrics, said))
        if not scenario.deviations and not self.evaluator.path.laws.drawn:
            raise UserError(
                "search.robust varies nothing: no law of this chain states an error (laws of given coefficients have "
                "none); name keys in 'vary'."
            )
        return self._over_conditions(rows)

    def _changed(self, scenario: Scenario, study: Study, condition: int, said: str) -> Study:
        """The candidate's study in a scenario."""
        if not scenario.deviations:
            return study
        try:
            changes = {**self.problem.changes(self.values, condition), **scenario.changes(study)}
            return self.evaluator._setter.study(changes)
        except UserError as error:
            raise _EndedError(FAILED, f"{said}: {error}") from None

    def _metrics(self, study: Study, scenario: Scenario | None, said: str) -> Mapping[str, Any]:
        """What the task measures; `said` names condition and scenario in the cause of a failure."""
        at = f"{said}: " if said else ""
        self.simulations += 1
        try:
            result = self.evaluator.path.result(study, scenario.law if scenario else None)
        except MissingDependencyError:
            raise
        except (UserError, NotReachedError) as error:
            state: State = REFUSED if isinstance(error, InvalidDesignError) and not scenario else FAILED
            self.simulations -= state == REFUSED
            raise _EndedError(state, at + str(error)) from None
        except Exception as error:  # an engine may fail in any way
            if interrupted(error):
                raise KeyboardInterrupt from None
            text = " ".join(str(error).split())
            raise _EndedError(FAILED, f"{at}{type(error).__name__}{f': {text}' if text else ''}") from error
        if result.not_reached:
            raise _EndedError(FAILED, at + result.not_reached)
        if not result.final.converged:
            raise _EndedError(FAILED, f"{at}the chain did not settle (residual {result.final.residual:.2g}).")
        return measured(result)

    def _objectives(self, metrics: Mapping[str, Any], said: str) -> tuple[float, ...]:
        at = f"{said}: " if said else ""
        if not self.evaluator.looked_up:
            self.problem.require_metrics(metrics)
        self.evaluator.looked_up = True
        found = self.problem.objective_values(self.values, metrics)
        for name, value in zip(self.problem.objective_names, found, strict=True):
            if not math.isfinite(value):
                raise _EndedError(NOT_A_NUMBER, f"{at}the objective '{name}' is {value}.")
        return found

    def _over_conditions(self, rows: Sequence[tuple[float, ...]]) -> tuple[float, ...]:
        table = np.array(rows, float)
        worst = self.problem.config.over_conditions == "worst"
        return tuple(float(one) for one in (table.max(axis=0) if worst else table.mean(axis=0)))

    def _violations(self) -> dict[str, float]:
        """Constraints on metrics that a condition breaks, by the most that any of them does."""
        found: dict[str, float] = {}
        for metrics in self.measured.values():
            for text, amount in self.problem.metric_violations(self.values, metrics).items():
                found[text] = max(amount, found.get(text, 0.0))
        return found

    def _said(self, condition: int) -> str:
        """How messages name a condition; one alone has no name in the study."""
        return self.problem.conditions[condition].name if self.problem.config.conditions else ""


def measured(result: TaskResult) -> dict[str, Any]:
    """What a task measured, and whether it settled and how often a law was used outside its data, of every task."""
    own = (result.final.converged, len(result.final.outside_domain))
    return {**result.metrics, **dict(zip(OF_EVERY_TASK, own, strict=True))}


def numbers(metrics: Mapping[str, Any]) -> dict[str, float]:
    """Metrics that are one number, truths as 0 and 1; texts and lists are left out."""
    kinds = (bool, int, float, np.bool_, np.integer, np.floating)
    return {str(name): float(value) for name, value in metrics.items() if isinstance(value, kinds)}


def _mean(measured: Sequence[Metrics]) -> dict[str, float]:
    """Means of what every condition measures."""
    if not measured:
        return {}
    names = [name for name in measured[0] if all(name in one for one in measured)]
    return {name: float(np.mean([one[name] for one in measured])) for name in names}


def _law_parameters(scenarios: Sequence[Scenario]) -> dict[str, str]:
    """Parameters of a meta-model that scenarios vary → the key as the study writes it."""
    deviations = [one for one, _ in scenarios[0].deviations] if scenarios else []
    return {one.parameter: one.key for one in deviations if one.parameter}


def problem_of(bench: Workbench, study: Study) -> SearchProblem:
    """The study's `SearchProblem`; raises `UserError` for mistakes of its `search`."""
    return SearchProblem.of(study, bench.registry)


def evaluator_of_study(bench: Workbench, study: Study, confirm: bool = False) -> Evaluator:
    """The evaluator of a study, with the scenarios of a robust search; or the one that tries the best once more."""
    problem = problem_of(bench, study)
    robust = study.need("search", "a search").robust
    scenarios = draw_scenarios(problem, bench.registry, robust) if robust is not None else ()
    return Evaluator(bench, reevaluation_problem(problem) if confirm else problem, scenarios)
