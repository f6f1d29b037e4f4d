"""Least squares (`pliant.least_squares`) of a black box that may refuse a trial; slopes by finite differences."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pliant.least_squares import Point, Steps, descend
from pliant.records.design import Array

Residuals = Callable[[Array], Array | None]
# A step may be refused until its damping is 1e12.
STEPS = Steps(most=60, tries=16, harder=10.0, easier=10.0, least_damping=1e-12, least_gain=1e-14)


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

    def point(self, x: Array) -> Point | None:
        """The residuals, model − data turned to data − model, at x in units of the scales."""
        found = self.residuals(x * self.scales)
        return None if found is None else Point(x, -found, float(found @ found))

    def slopes(self, point: Point) -> Array | None:
        """∂residuals/∂x of a point."""
        found = self.jacobian(point.x * self.scales, -point.residual)
        return None if found is None else found * self.scales


def minimised(problem: Problem, start: Array) -> Fit | None:
    """The minimum nearest to `start`; None where the start itself is refused."""
    first = problem.point(np.asarray(start, float) / problem.scales)
    slopes = None if first is None else problem.slopes(first)
    if first is None or slopes is None:
        return None
    steps = replace(STEPS, least_gain=problem.least, least_step=problem.tolerance)
    free = np.full(len(start), np.inf)
    found, converged = descend(problem, replace(first, slopes=slopes), steps, (-free, free))
    assert found.slopes is not None or not converged
    known = slopes if found.slopes is None else found.slopes
    return Fit(found.x * problem.scales, -found.residual, known / problem.scales, converged)
