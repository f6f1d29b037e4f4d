"""Evaluation of a search's candidate: its study is simulated in every condition and every scenario."""

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
from pliant.execution.jobs import Failure
from pliant.pipeline.workbench import RunContext
from pliant.records.rollout import TaskResult
from pliant_search.evaluate.fast_path import FastPath, Timer, untimed
from pliant_search.evaluate.scenarios import Scenario, draw_scenarios, measure
from pliant_search.evaluate.solid_metrics import solid_metrics
from pliant_search.optimizer import FAILED, NOT_A_NUMBER, OK, REFUSED, State, Trial, Value
from pliant_search.problem.search_problem import SearchProblem, reevaluation_problem
from pliant_search.problem.study_setter import StudySetter

OF_EVERY_TASK = ("converged", "outside_domain")


class Evaluates(Protocol):
    """Interface of an evaluator that a search uses."""

    def evaluate(self, values: Mapping[str, Value], context: int = -1) -> Trial:
        """Return the evaluated trial of one candidate."""
        ...


def evaluated(evaluator: Evaluates, trial: Trial) -> Trial:
    """Return the trial with its result; raise only an error that every trial would meet (`PliantError`)."""
    try:
        found = evaluator.evaluate(trial.values, trial.context)
    except PliantError:
        raise
    except Exception as error:  # a plugin may fail in any way
        if interrupted(error):
            raise KeyboardInterrupt from None
        return trial.failed(Failure.from_exception(error).cause)
    return replace(found, number=trial.number, values=trial.values, context=trial.context)


class _EndedError(Exception):
    """Signal that the evaluation of a candidate ends early."""

    def __init__(self, state: State, cause: str, violation: float = 0.0) -> None:
        super().__init__(cause)
        self.state: State = state
        self.violation = violation


class Evaluator:
    """Evaluator of one candidate after another; objects that candidates share are built once and kept.

    Objectives are computed in each condition from that condition's metrics and combined as the mean or worst, as the
    study states. A robust search does so in every scenario; the measure over scenarios is the candidate's objective.
    Metrics and constraints on metrics are evaluated without scenarios.

    Args:
        context: plugins and store.
        problem: the search.
        scenarios: of a robust search.
        timed: measures parts of the work; see `pliant_search.evaluate.fast_path`.

    Raises:
        UserError: the study lacks a block, or a scenario varies what the meta-model cannot follow.
    """

    def __init__(
        self,
        context: RunContext,
        problem: SearchProblem,
        scenarios: Sequence[Scenario] = (),
        timed: Timer[Any] = untimed,
    ) -> None:
        for block in ("chain", "task"):
            problem.study.need(block, "a search")
        self.context, self.problem, self.scenarios = context, problem, tuple(scenarios)
        self.path = FastPath(context, problem.study, timed)
        self._setter = StudySetter(problem.study, context.registry)
        self._timed = timed
        self._measured: dict[str, Mapping[str, Any]] = {}  # of the present candidate, in each condition
        self._simulations = 0
        self._looked_up = False  # whether the metrics that the formulas name were checked
        deviations = [one for one, _ in scenarios[0].deviations] if scenarios else []
        self.path.laws.check_varied({one.parameter: one.key for one in deviations if one.parameter})

    def evaluate(self, values: Mapping[str, Value], context: int = -1) -> Trial:
        """Evaluate a candidate and return a trial without a number; refusals and failures set `Trial.state`.

        Args:
            values: one per variable.
            context: index of the single condition to evaluate; −1: all conditions.

        Raises:
            UserError: a mistake that affects every candidate: a metric that the task does not have, a missing package.
        """
        started, trial = time.perf_counter(), Trial(-1, values, context)
        self._measured, self._simulations = {}, 0
        try:
            found = self._evaluated(trial)
        except _EndedError as end:
            found = replace(trial, state=end.state, cause=str(end), violation=end.violation)
        conditions = {name: numbers(metrics) for name, metrics in self._measured.items()}
        return replace(
            found,
            metrics=shared_means(list(conditions.values())) if found.state == OK else {},
            conditions=conditions,
            simulations=self._simulations,
            wall_s=time.perf_counter() - started,
        )

    def _evaluated(self, trial: Trial) -> Trial:
        """Evaluate the conditions, then the scenarios; raise `_EndedError` if the evaluation ends early."""
        problem, values, context = self.problem, trial.values, trial.context
        broken = problem.violated(values, context)
        if broken:
            raise _EndedError(REFUSED, "; ".join(broken), float(sum(broken.values())))
        studies = {c: self._study(values, c) for c in range(len(problem.conditions)) if context in (-1, c)}
        rows = []
        for c, study in studies.items():
            metrics = self._metrics(study, None, self._label(c))
            self._measured[problem.conditions[c].name] = metrics
            rows.append(self._objectives(values, metrics, self._label(c)))
        violations: dict[str, float] = {}  # the largest violation over the conditions
        for metrics in self._measured.values():
            for text, amount in problem.metric_violations(values, metrics).items():
                violations[text] = max(amount, violations.get(text, 0.0))
        objectives, scenarios = self._over_conditions(rows), list[tuple[float, ...]]()
        for scenario in self.scenarios:
            rows = []
            for c, study in studies.items():
                label = f"{scenario.name}{f', {name}' if (name := self._label(c)) else ''}"
                varied = self._varied(values, scenario, study, c, label)
                rows.append(self._objectives(values, self._metrics(varied, scenario, label), label))
            if not scenario.deviations and not self.path.laws.drawn:
                raise UserError(
                    "search.robust varies nothing: no law of this chain states an error (laws of given coefficients "
                    "have none); name keys in 'vary'."
                )
            scenarios.append(self._over_conditions(rows))
        if scenarios:
            assert problem.config.robust is not None
            objectives = tuple(
                measure(column, problem.config.robust) for column in zip(*scenarios, strict=True)
            )
        return replace(
            trial,
            state=OK,
            objectives=objectives,
            cause="; ".join(violations),
            violation=float(sum(violations.values())),
            scenarios=tuple(row[0] for row in scenarios),
        )

    def _label(self, condition: int) -> str:
        """Return the name of a condition in messages; a single condition that the study does not name has ""."""
        return self.problem.conditions[condition].name if self.problem.config.conditions else ""

    def _study(self, values: Mapping[str, Value], condition: int) -> Study:
        """Return the candidate's study in one condition; refuse an impossible candidate."""
        try:
            return self._timed("apply", lambda: self.problem.apply(values, condition))
        except MissingDependencyError:
            raise
        except UserError as error:
            raise _EndedError(REFUSED, str(error)) from None

    def _varied(
        self, values: Mapping[str, Value], scenario: Scenario, study: Study, condition: int, label: str
    ) -> Study:
        """Return the candidate's study in a scenario."""
        if not scenario.deviations:
            return study
        try:
            return self._setter.study({**self.problem.changes(values, condition), **scenario.changes(study)})
        except UserError as error:
            raise _EndedError(FAILED, f"{label}: {error}") from None

    def _metrics(self, study: Study, scenario: Scenario | None, label: str) -> Mapping[str, Any]:
        """Return the metrics of task and solid; `label` names condition and scenario in the cause of a failure."""
        at = f"{label}: " if label else ""
        self._simulations += 1
        try:
            result = self.path.result(study, scenario.law if scenario else None)
            solid = {} if scenario else solid_metrics(self.context, self.problem, study)
        except MissingDependencyError:
            raise
        except (UserError, NotReachedError) as error:
            state: State = REFUSED if isinstance(error, InvalidDesignError) and not scenario else FAILED
            self._simulations -= state == REFUSED
            raise _EndedError(state, at + str(error)) from None
        except Exception as error:  # an engine may fail in any way
            if interrupted(error):
                raise KeyboardInterrupt from None
            raise _EndedError(FAILED, at + Failure.from_exception(error).cause) from error
        if result.not_reached:
            raise _EndedError(FAILED, at + result.not_reached)
        if not result.final.converged:
            raise _EndedError(FAILED, f"{at}the chain did not settle (residual {result.final.residual:.2g}).")
        return {**solid, **measured(result)}

    def _objectives(
        self, values: Mapping[str, Value], metrics: Mapping[str, Any], label: str
    ) -> tuple[float, ...]:
        if not self._looked_up:
            self.problem.require_metrics(metrics)
        self._looked_up = True
        found = self.problem.objective_values(values, metrics)
        for name, value in zip(self.problem.objective_names, found, strict=True):
            if not math.isfinite(value):
                at = f"{label}: " if label else ""
                raise _EndedError(NOT_A_NUMBER, f"{at}the objective '{name}' is {value}.")
        return found

    def _over_conditions(self, rows: Sequence[tuple[float, ...]]) -> tuple[float, ...]:
        table = np.array(rows, float)
        worst = self.problem.config.over_conditions == "worst"
        return tuple(float(one) for one in (table.max(axis=0) if worst else table.mean(axis=0)))


def measured(result: TaskResult) -> dict[str, Any]:
    """Return a task's metrics with convergence and the number of joints outside their law's data."""
    own = (result.final.converged, len(result.final.outside_domain))
    return {**result.metrics, **dict(zip(OF_EVERY_TASK, own, strict=True))}


def numbers(metrics: Mapping[str, Any]) -> dict[str, float]:
    """Return the metrics that are single numbers, Booleans as 0 and 1; texts and lists are omitted."""
    kinds = (bool, int, float, np.bool_, np.integer, np.floating)
    return {str(name): float(value) for name, value in metrics.items() if isinstance(value, kinds)}


def shared_means(listed: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Return the means of the metrics that all mappings have, in the order of the first; empty for no mappings."""
    names = [name for name in (listed[0] if listed else ()) if all(name in one for one in listed)]
    return {name: float(np.mean([one[name] for one in listed])) for name in names}


def build_search_problem(context: RunContext, study: Study) -> SearchProblem:
    """Return the study's `SearchProblem`; raise `UserError` for mistakes in its `search` block."""
    return SearchProblem.from_study(study, context.registry)


def evaluator_from_study(context: RunContext, study: Study, confirm: bool = False) -> Evaluator:
    """Return the evaluator of a study with the scenarios of a robust search; `confirm`: that of the re-evaluation."""
    problem = build_search_problem(context, study)
    robust = study.need("search", "a search").robust
    scenarios = draw_scenarios(problem, context.registry, robust) if robust is not None else ()
    return Evaluator(context, reevaluation_problem(problem) if confirm else problem, scenarios)
