"""Weighted least squares by damped Gauss–Newton (Levenberg–Marquardt; Nocedal & Wright 2006, §10.3).

Residuals come from a black box that may refuse a trial; slopes by finite differences.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pliant.records.design import Array

Residuals = Callable[[Array], Array | None]
ITERATIONS = 60
SMALLEST_DAMPING, LARGEST_DAMPING = 1e-12, 1e12


@dataclass(frozen=True, eq=False)
class Fit:
    """A minimum of Σ r².

    Attributes:
        values: (k,) constants in SI.
        residuals: (n,) weighted residuals there.
        jacobian: (n, k) their slopes by the constants.
        converged: whether steps had become small when it ended.
    """

    values: Array
    residuals: Array
    jacobian: Array
    converged: bool


@dataclass(frozen=True, eq=False)
class Problem:
    """What is minimised.

    Attributes:
        residuals: (n,) of the constants (k,), None where they make no sense.
        scales: (k,) the size of a change that matters, for each constant.
        step: of finite differences, in scales.
        central: whether differences are taken both ways.
        tolerance: a step below this share of the scales ends the search.
        least: a step that lowers Σ r² by less than this share ends it too.
    """

    residuals: Residuals
    scales: Array
    step: float
    central: bool
    tolerance: float
    least: float = 1e-14

    def jacobian(self, values: Array, here: Array) -> Array | None:
        """∂r/∂constants (n, k); None where a neighbour is refused on both sides."""
        columns = []
        for k, scale in enumerate(self.scales):
            move = np.zeros(len(values))
            move[k] = self.step * scale
            after = self.residuals(values + move)
            before = self.residuals(values - move) if self.central or after is None else None
            if after is None and before is None:
                return None
            if after is not None and before is not None:
                columns.append((after - before) / (2 * move[k]))
            elif after is not None:
                columns.append((after - here) / move[k])
            elif before is not None:
                columns.append((here - before) / move[k])
        return np.stack(columns, axis=1)


def minimised(problem: Problem, start: Array) -> Fit | None:
    """The minimum nearest to `start`; None where the start itself is refused."""
    values, here = np.array(start, float), problem.residuals(start)
    slopes = None if here is None else problem.jacobian(values, here)
    if here is None or slopes is None:
        return None
    damping, converged = 1e-3, False
    for _ in range(ITERATIONS):
        scaled = slopes * problem.scales
        step, trial, damping = _better(problem, values, here, scaled, damping)
        if trial is None:
            converged = True  # no step of any length makes it smaller
            break
        fell = float(here @ here - trial @ trial)
        values, here = values + step * problem.scales, trial
        new = problem.jacobian(values, here)
        if new is None:
            break
        slopes = new
        if np.abs(step).max() < problem.tolerance or fell <= problem.least * float(here @ here):
            converged = True
            break
    return Fit(values, here, slopes, converged)


def _better(
    problem: Problem, values: Array, here: Array, scaled: Array, damping: float
) -> tuple[Array, Array | None, float]:
    """A damped step that makes Σ r² smaller, the residuals there, the damping for the next; None if there is none."""
    normal, gradient = scaled.T @ scaled, scaled.T @ here
    diagonal = np.maximum(np.diag(normal), 1e-12 * np.diag(normal).max())
    step: Array = np.zeros(len(values))
    while damping < LARGEST_DAMPING:
        try:
            step = np.asarray(-np.linalg.solve(normal + damping * np.diag(diagonal), gradient), float)
        except np.linalg.LinAlgError:
            damping *= 10
            continue
        trial = problem.residuals(values + step * problem.scales)
        if trial is not None and trial @ trial < here @ here:
            return step, trial, max(damping / 10, SMALLEST_DAMPING)
        if np.abs(step).max() < problem.tolerance:
            break
        damping *= 10
    return step, None, damping
