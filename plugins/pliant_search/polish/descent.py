"""Descents from one candidate: Levenberg–Marquardt on residuals, sequential quadratic programming on anything else.

Both stay within the variables' ranges. Levenberg–Marquardt (`equilibria`) takes no candidate that breaks a constraint;
where a constraint holds it up, SLSQP (Kraft 1988, by SciPy) goes on along the constraint.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from pliant.records.design import Array
from pliant_search.optimizer import POLISHED, Trial, Value
from pliant_search.polish.equilibria import Equilibria
from pliant_search.polish.slopes import Recorded, SlopeEvaluator, Slopes

TRIES = 8  # dampings of one step
FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-5, 1e-12, 1e3  # of the curvature of the residuals
HARDER, EASIER = 5.0, 5.0
LEAST_GAIN = 1e-5  # of the sum of squares, and of the objective: a step that gains less is the last
NEAR = 0.02  # margin of a constraint, of its terms, that may hold a descent up
TOLERANCE = 1e-6  # of SLSQP: of the objective in first moves over a range, and of margins
BACK_OFF = 5 * TOLERANCE  # margin that is kept, so that the end breaks no constraint
FIRST_MOVE = 0.1  # of a range: the first step of SLSQP along the steepest variable
AT_BOUND = 1e-9  # of a range
WORSE = 10.0  # penalty of a candidate without a result, in first moves


@dataclass(frozen=True, eq=False)
class PolishedPath:
    """A descent.

    Attributes:
        start: the candidate that it began from.
        trials: evaluated on the way, in order.
        steps: number of slopes that were found.
        converged: whether its steps had become small.
        obstacle: why it could not begin, as part of a sentence; "" where it could.
    """

    start: Trial
    trials: tuple[Trial, ...]
    steps: int
    converged: bool
    obstacle: str = ""

    @property
    def best(self) -> Trial:
        """The best feasible candidate, at worst the start."""
        feasible = [trial for trial in self.trials if trial.feasible]
        return min((self.start, *feasible), key=lambda trial: trial.objective)


class Descent:
    """One descent; candidates are evaluated once."""

    def __init__(self, evaluator: SlopeEvaluator, start: Trial, steps: int) -> None:
        self._evaluator, self._start, self._most = evaluator, start, steps
        self._origin = evaluator.shares(start.values)
        self._known: dict[bytes, Recorded] = {}
        self._slopes: dict[bytes, Slopes | None] = {}
        self._trials: list[Trial] = []
        self.steps = 0

    def path(self) -> PolishedPath:
        """Descend; return everything that was evaluated."""
        start, origin = self._start, self._origin
        at = self._at(origin)
        obstacle = (
            self._evaluator.obstacle(at) if at.outcome is not None else "it could not be simulated again"
        )
        slopes = None if obstacle else self._slopes_at(origin)
        if slopes is None:
            return self._path(False, obstacle or "its stiffness is singular")
        assert at.outcome is not None
        smooth = np.flatnonzero(np.any(slopes.margins != 0.0, axis=1))
        if at.outcome.residuals is None:
            return self._path(self._by_programming(origin, smooth))
        converged = self._by_squares(origin)
        best = self._path(converged).best
        held = self._at(self._evaluator.shares(best.values)).outcome if best is not start else at.outcome
        if held is not None and np.any(held.margins[smooth] < NEAR):
            converged = self._by_programming(self._evaluator.shares(best.values), smooth)
        return self._path(converged)

    def _path(self, converged: bool, obstacle: str = "") -> PolishedPath:
        return PolishedPath(self._start, tuple(self._trials), self.steps, converged, obstacle)

    def _at(self, x: Array) -> Recorded:
        key = x.tobytes()
        if key not in self._known:
            first = np.array_equal(x, self._origin)
            values: Mapping[str, Value] = (
                self._start.values if first else self._evaluator.with_shares(self._start.values, x)
            )
            self._known[key] = found = self._evaluator.evaluate(values)
            if not first:
                self._trials.append(replace(found.trial, number=POLISHED, values=values))
        return self._known[key]

    def _slopes_at(self, x: Array) -> Slopes | None:
        key = x.tobytes()
        if key not in self._slopes:
            at = self._at(x)
            self._slopes[key] = None if self._evaluator.obstacle(at) else self._evaluator.slopes(at)
            self.steps += 1
        return self._slopes[key]

    def _by_squares(self, x: Array) -> bool:
        """Run Levenberg–Marquardt over the equilibria from shares x; return whether its steps had become small."""
        at, damping = self._at(x), FIRST_DAMPING
        for _ in range(self._most):
            equilibria, cost = Equilibria(self._evaluator, at), at.trial.objective**2
            self.steps += 1
            for _ in range(TRIES):
                step = equilibria.step(damping)
                if step.gain < LEAST_GAIN * cost:
                    return True
                landed = equilibria.landed(step)
                if landed is not None and landed.cost < cost:
                    trial = self._at(landed.x)
                    if trial.trial.feasible and trial.outcome is not None and trial.trial.objective**2 < cost:
                        break
                damping = min(damping * HARDER, MOST_DAMPING)
            else:
                return True  # no step of any length lowers the objective
            at, damping = trial, max(damping / EASIER, LEAST_DAMPING)
            if cost - at.trial.objective**2 < LEAST_GAIN * cost:
                return True
        return False

    def _by_programming(self, x: Array, smooth: NDArray[np.intp]) -> bool:
        """Run SLSQP from shares x; `smooth`: the comparisons that change with the variables."""
        first = self._slopes_at(x)
        steepest = 0.0 if first is None else float(np.abs(first.objective).max(initial=0.0))
        if first is None or steepest == 0.0:
            return first is not None
        scale = FIRST_MOVE / steepest
        begun = self._at(x).trial.objective

        def objective(x: Array) -> float:
            at = self._at(_inside(x))
            return WORSE * FIRST_MOVE if at.outcome is None else scale * (at.outcome.objective - begun)

        def objective_slopes(x: Array) -> Array:
            found = self._slopes_at(_inside(x))
            return np.zeros(len(x)) if found is None else scale * found.objective

        def margins(x: Array) -> Array:
            at = self._at(_inside(x))
            found = self._evaluator.margins(at.trial.values) if at.outcome is None else at.outcome.margins
            return np.asarray(found[smooth] - BACK_OFF)

        def margin_slopes(x: Array) -> Array:
            found = self._slopes_at(_inside(x))
            return np.zeros((len(smooth), len(x))) if found is None else found.margins[smooth]

        held = [{"type": "ineq", "fun": margins, "jac": margin_slopes}] if len(smooth) else []
        done = optimize.minimize(
            objective,
            x,
            jac=objective_slopes,
            method="SLSQP",
            bounds=[(0.0, 1.0)] * len(x),
            constraints=held,
            options={"maxiter": self._most, "ftol": TOLERANCE},
        )
        return bool(done.success)


def _inside(x: Array) -> Array:
    """Return shares within the ranges; those at a bound but for rounding are on it."""
    inside = np.clip(np.asarray(x, float), 0.0, 1.0)
    return np.where(inside < AT_BOUND, 0.0, np.where(inside > 1.0 - AT_BOUND, 1.0, inside))
