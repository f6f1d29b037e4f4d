"""A candidate with its slopes: objective, margins of constraints and least-squares residuals by the real variables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
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
        self._scaled = "", 1.0  # metric of the residuals, and the objective per metric
        self.free = tuple(
            one.variable for one in problem.variables if one.variable.type == "real" and not one.each
        )

    def shares(self, values: Mapping[str, Value]) -> Array:
        """Return (k,) the free variables as shares of their ranges."""
        return np.array([(float(values[v.name]) - v.low) / (v.high - v.low) for v in self.free])

    def with_shares(self, values: Mapping[str, Value], x: Array) -> dict[str, Value]:
        """Return the values with the free variables at shares x (k,) of their ranges, within them."""
        found = {
            v.name: v.low + share * (v.high - v.low) for v, share in zip(self.free, x.tolist(), strict=True)
        }
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
            factors = [[linalg.lu_factor(K) for K in run.stiffnesses()] for run in at.runs]
        except (linalg.LinAlgError, ValueError):
            return None

        def settled(condition: int, level: int, residual: Array) -> Array:
            """Return the equilibrium of the changed chain by one Newton step."""
            q = at.runs[condition].q[level]
            step = linalg.lu_solve(factors[condition][level], residual.ravel())
            return np.asarray(q + step.reshape(q.shape))

        def row(values: Mapping[str, Value]) -> Array | None:
            found = self.shown(values, at.runs, settled)
            return None if found is None else found.row()

        base = self.shown(at.trial.values, at.runs, settled)
        if base is None:
            return None
        table = self.differences(at.trial.values, base.row(), row)
        count = len(base.margins)
        return Slopes(table[0], table[1 : 1 + count], table[1 + count :])

    def differences(
        self, values: Mapping[str, Value], here: Array, row: Callable[[Mapping[str, Value]], Array | None]
    ) -> Array:
        """Return (len(row), k) slopes of a row of numbers by the free variables; see `slopes` for refused designs."""
        x, columns = self.shares(values), []
        for k in range(len(x)):
            column = np.zeros(len(here))
            for step in (STEP, -STEP) if x[k] <= 0.5 else (-STEP, STEP):
                moved = x.copy()
                moved[k] += step
                there = row(self.with_shares(values, moved))
                if there is not None and np.isfinite(there).all():
                    column = (there - here) / step
                    break
            columns.append(column)
        return np.array(columns).reshape(len(x), len(here)).T

    def obstacle(self, at: Recorded) -> str:
        """Return why a candidate has no slopes, as part of a sentence; empty if it has them."""
        return next((cause for run in at.runs if (cause := run.obstacle())), "")

    def shown(
        self,
        values: Mapping[str, Value],
        runs: Sequence[TaskRun],
        placed: Callable[[int, int, Array], Array],
    ) -> Outcome | None:
        """Return the outcome of values near recorded runs; None for a design that is refused.

        Args:
            values: of the candidate.
            runs: one for each condition.
            placed: from condition, level and residual to the joint coordinates there (`followed.Placed`).
        """
        try:
            found = tuple(
                self._path.followed(self.problem.apply(values, c), run, partial(placed, c))
                for c, run in enumerate(runs)
            )
            return self._outcome(values, found)
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
        found = run.task.residuals(run.chain, run.result)
        if name not in found:
            return None
        # as scaled by the formula, if it is proportional to the metric
        once, twice = (
            self.problem.objective_values(values, {**metrics, name: factor * metrics[name]})[0]
            for factor in (1.0, 2.0)
        )
        if not np.isclose(twice, 2.0 * once, rtol=1e-9, atol=0.0) or not once > 0.0:
            return None
        self._scaled = name, once / metrics[name]
        return self.scaled(found)

    def scaled(self, residuals: Mapping[str, Array]) -> Array:
        """Return those of a task's residuals whose norm is the objective, where the last outcome has such residuals."""
        name, factor = self._scaled
        return factor * np.asarray(residuals[name], float)
