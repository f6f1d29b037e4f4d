"""A candidate with its slopes: objective, margins of constraints and least-squares residuals by the real variables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy import linalg

from pliant.errors import MissingDependencyError, PliantError
from pliant.pipeline.workbench import RunContext
from pliant.records.design import Array
from pliant_search.evaluate.evaluator import Evaluator, evaluated, measured
from pliant_search.evaluate.solid_metrics import solid_metrics
from pliant_search.optimizer import OK, Trial, Value
from pliant_search.polish.followed import RecordedPath, TaskRun
from pliant_search.problem.names import metric_name
from pliant_search.problem.search_problem import SearchProblem

STEP = 3e-8  # of a variable's range: one-sided differences of laws, masses and geometry, whose curvature may be strong


@dataclass(frozen=True, eq=False)
class Outcome:
    """Numbers of a candidate: the objective as minimised, signed margins (m,), residuals (r,), None without them."""

    objective: float
    margins: Array
    residuals: Array | None

    def row(self) -> Array:
        """Return all numbers in a row."""
        more = np.empty(0) if self.residuals is None else self.residuals
        return np.concatenate([[self.objective], self.margins, more])


@dataclass(frozen=True, eq=False)
class Slopes:
    """Slopes by the free variables as shares of their ranges: objective (k,), margins (m, k), residuals (r, k)."""

    objective: Array
    margins: Array
    residuals: Array


@dataclass(frozen=True, eq=False)
class Recorded:
    """An evaluated candidate with its runs, one for each condition; `outcome` is None unless it is evaluated."""

    trial: Trial
    runs: Sequence[TaskRun] = field(default_factory=tuple)
    outcome: Outcome | None = None


class SlopeEvaluator:
    """Evaluator of candidates and of their slopes.

    Args:
        context: plugins and store.
        problem: of the search; its objective is one.
    """

    def __init__(self, context: RunContext, problem: SearchProblem) -> None:
        self.problem, self._evaluator = problem, Evaluator(context, problem)
        self._context, self._path = context, RecordedPath(context, problem.study)
        self._path.runs = []
        self._evaluator.path = self._path
        self.free = tuple(
            one.variable for one in problem.variables if one.variable.type == "real" and not one.each
        )

    def shares(self, values: Mapping[str, Value]) -> Array:
        """Return (k,) the free variables as shares of their ranges."""
        return np.array([(float(values[v.name]) - v.low) / (v.high - v.low) for v in self.free])

    def with_shares(self, values: Mapping[str, Value], x: Array) -> dict[str, Value]:
        """Return the values with the free variables at shares x (k,) of their ranges, within them."""
        found = {v.name: v.low + share * (v.high - v.low) for v, share in zip(self.free, x.tolist(), strict=True)}
        return {**values, **{v.name: min(max(found[v.name], v.low), v.high) for v in self.free}}

    def evaluate(self, values: Mapping[str, Value]) -> Recorded:
        """Evaluate a candidate as the search does."""
        self._path.runs = []
        trial = evaluated(self._evaluator, Trial(-1, values))
        runs = tuple(self._path.runs)
        return Recorded(trial, runs, self._outcome(values, runs) if trial.state == OK else None)

    def margins(self, values: Mapping[str, Value]) -> Array:
        """Return (m,) margins of a candidate without simulation; −1 for comparisons of metrics."""
        return np.tile(self.problem.margins(values, {}), len(self.problem.conditions))

    def slopes(self, at: Recorded) -> Slopes | None:
        """Return the slopes at an evaluated candidate; None where no equilibrium can be followed.

        A variable that can be moved to neither side, since its design is refused there, has zero slopes.
        """
        try:
            stiffnesses = [run.stiffnesses() for run in at.runs]
        except linalg.LinAlgError:
            return None
        base = self._followed(at.trial.values, at, stiffnesses)
        if base is None:
            return None
        x, here, columns = self.shares(at.trial.values), base.row(), []
        for k in range(len(x)):
            column = np.zeros(len(here))
            sides = (STEP, -STEP) if x[k] <= 0.5 else (-STEP, STEP)
            for step in sides:
                moved = x.copy()
                moved[k] += step
                there = self._followed(self.with_shares(at.trial.values, moved), at, stiffnesses)
                if there is not None and np.isfinite(there.row()).all():
                    column = (there.row() - here) / step
                    break
            columns.append(column)
        table = np.array(columns).reshape(len(x), len(here)).T
        count = len(base.margins)
        return Slopes(table[0], table[1 : 1 + count], table[1 + count :])

    def obstacle(self, at: Recorded) -> str:
        """Return why a candidate has no slopes, as part of a sentence; empty if it has them."""
        return next((cause for run in at.runs if (cause := run.obstacle())), "")

    def _followed(
        self, values: Mapping[str, Value], at: Recorded, stiffnesses: Sequence[Any]
    ) -> Outcome | None:
        """Return the outcome of values close to a recorded candidate; None for a design that is refused."""
        try:
            runs = tuple(
                self._path.followed(self.problem.apply(values, c), run, factors)
                for c, (run, factors) in enumerate(zip(at.runs, stiffnesses, strict=True))
            )
            return self._outcome(values, runs)
        except MissingDependencyError:
            raise
        except PliantError:
            return None

    def _outcome(self, values: Mapping[str, Value], runs: Sequence[TaskRun]) -> Outcome:
        objectives, margins, residuals = [], [], None
        for condition, run in enumerate(runs):
            assert run.result is not None
            study = self.problem.apply(values, condition)
            metrics = {**solid_metrics(self._context, self.problem, study), **measured(run.result)}
            objectives.append(self.problem.objective_values(values, metrics)[0])
            margins.append(self.problem.margins(values, metrics))
            if len(runs) == 1:
                residuals = self._residuals(values, run, metrics)
        worst = self.problem.config.over_conditions == "worst"
        objective = float(np.max(objectives) if worst else np.mean(objectives))
        return Outcome(objective, np.concatenate(margins), residuals)

    def _residuals(
        self, values: Mapping[str, Value], run: TaskRun, metrics: Mapping[str, Any]
    ) -> Array | None:
        """Return residuals whose norm is the objective, where the objective is a metric that the task gives so."""
        (objective,) = self.problem.objectives
        if self.problem.maximised[0] or len(objective.names) != 1 or objective.names[0].role != "metric":
            return None
        assert run.task is not None and run.chain is not None and run.result is not None
        name = metric_name(objective.names[0].name, metrics) or ""
        found = run.task.residuals(run.chain, run.result).get(name)
        if found is None:
            return None
        # as scaled by the formula, if it is proportional to the metric
        once, twice = (
            self.problem.objective_values(values, {**metrics, name: factor * metrics[name]})[0]
            for factor in (1.0, 2.0)
        )
        if not np.isclose(twice, 2.0 * once, rtol=1e-9, atol=0.0) or not once > 0.0:
            return None
        return np.asarray(found, float) * (once / metrics[name])
