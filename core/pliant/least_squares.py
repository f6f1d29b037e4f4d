"""Weighted nonlinear least squares within bounds: Levenberg–Marquardt (Moré 1978; Nocedal & Wright 2006, §10.3).

Minimises  Σ wᵢ rᵢ(x)² + Σ λⱼ xⱼ²  over low ≤ x ≤ high. The residuals r = data − model (n,) come from a black box that
may refuse an x; slopes are those of the model, ∂model/∂x = −∂r/∂x (n, k). x should be of order 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pliant.records.design import Array

FIRST_DAMPING = 1e-3
LEAST_CURVATURE = 1e-9  # added to the diagonal of the normal matrix where the damping scales it
PROVEN = 0.25  # a prediction to first order has proven right where the gain differs from it by less than this share


@dataclass(frozen=True, eq=False)
class Point:
    """A point: x (k,), residual (n,), the cost there, slopes (n, k) if they are known already."""

    x: Array
    residual: Array
    cost: float
    slopes: Array | None = None


class Problem(Protocol):
    """A nonlinear least-squares problem: residuals and cost at any point."""

    def point(self, x: Array) -> Point | None:
        """Return residuals and cost at x; None, or an infinite cost, for an inadmissible x."""
        ...

    def slopes(self, point: Point) -> Array | None:
        """Return (n, k) slopes of the model at a point; None where they are not available."""
        ...


@dataclass(frozen=True)
class Steps:
    """Settings of the damping and of the stopping criteria.

    Attributes:
        most: largest number of accepted steps.
        tries: largest number of dampings for one step.
        harder, easier: factor and divisor of the damping after a refused and an accepted step.
        least_damping: the smallest.
        least_gain: an accepted step that lowers the cost by a smaller share of it is the last.
        least_step: a step no longer than this in any x is the last.
        least_promise: a step whose predicted gain is a smaller share of the cost is taken to first order, without the
            black box.
        proven_promise: the same where the last step gained about as much as predicted (`PROVEN`).
        enough: where the predicted gain is a smaller share of the cost, the descent ends without the step.
        secant: slopes follow from the last step (Broyden, Math. Comp. 19, 1965) where first order foresaw the change
            of the residuals up to this share; otherwise the problem is asked for them. 0: it is always asked.
    """

    most: int
    tries: int
    harder: float
    easier: float
    least_damping: float
    least_gain: float
    least_step: float = 0.0
    least_promise: float = 0.0
    proven_promise: float = 0.0
    enough: float = 0.0
    secant: float = 0.0


def descend(
    problem: Problem,
    point: Point,
    steps: Steps,
    bounds: tuple[Array, Array],
    weights: Array | None = None,
    pulls: Array | None = None,
) -> tuple[Point, bool]:
    """Return the nearest minimum from a point with known slopes, and whether the steps had become small at the end.

    Args:
        problem: the residuals and their slopes.
        point: where to begin; within the bounds.
        steps: damping and ends.
        bounds: low and high (k,).
        weights: w (n,); 1 by default.
        pulls: λ (k,) of a prior about x = 0; 0 by default. The problem's cost must include it.
    """
    low, high = bounds
    damping, least_promise = FIRST_DAMPING, steps.least_promise
    for _ in range(steps.most):
        slopes = point.slopes
        assert slopes is not None
        weighted = slopes if weights is None else slopes * weights[:, None]
        with np.errstate(over="ignore", invalid="ignore"):
            normal, gradient = weighted.T @ slopes, weighted.T @ point.residual
        if pulls is not None:
            normal, gradient = normal + np.diag(pulls), gradient - pulls * point.x
        for _ in range(steps.tries):
            damped = normal + damping * np.diag(np.diag(normal) + LEAST_CURVATURE)
            free = _free_step(damped, gradient, point.x, low, high)
            if free is None:
                damping *= steps.harder
                continue
            step = np.clip(point.x + free, low, high) - point.x
            promise = float(step @ (2.0 * gradient - normal @ step))
            if 0.0 <= promise < steps.enough * point.cost:
                return point, False
            if 0.0 <= promise < least_promise * point.cost:
                residual = point.residual - slopes @ step
                return Point(point.x + step, residual, point.cost - promise, slopes), True
            trial = problem.point(np.clip(point.x + step, low, high))
            if trial is not None and trial.cost < point.cost:
                break
            if np.abs(step).max(initial=0.0) < steps.least_step:
                return point, True
            damping *= steps.harder
        else:
            return point, True  # no step of any length lowers the cost
        gain, before, point = point.cost - trial.cost, point, trial
        proven = abs(gain - promise) < PROVEN * promise
        least_promise = max(steps.least_promise, steps.proven_promise if proven else 0.0)
        damping = max(damping / steps.easier, steps.least_damping)
        if point.slopes is None:
            found = _secant_slopes(before, point, steps.secant)
            found = problem.slopes(point) if found is None else found
            if found is None:
                return point, False
            point = Point(point.x, point.residual, point.cost, found)
        if gain < steps.least_gain * point.cost or np.abs(step).max(initial=0.0) < steps.least_step:
            return point, True
    return point, False


def _secant_slopes(before: Point, after: Point, share: float) -> Array | None:
    """Return the slopes of before, corrected along the step; None where they foresaw its change too badly."""
    assert before.slopes is not None
    step, change = after.x - before.x, before.residual - after.residual
    missed = change - before.slopes @ step
    if not float(missed @ missed) < share**2 * float(change @ change):
        return None
    return np.asarray(before.slopes + np.outer(missed, step / float(step @ step)))


def _free_step(normal: Array, gradient: Array, x: Array, low: Array, high: Array) -> Array | None:
    """Return the damped step of the x that are free or move off their bound; None if it is not finite.

    The squares of a diverging model's slopes overflow.
    """
    if not (np.isfinite(normal).all() and np.isfinite(gradient).all()):
        return None
    free = ~(((x <= low) & (gradient < 0)) | ((x >= high) & (gradient > 0)))
    step = np.zeros_like(x)
    try:
        step[free] = np.linalg.solve(normal[np.ix_(free, free)], gradient[free])
    except np.linalg.LinAlgError:
        return None
    return step if np.isfinite(step).all() else None
