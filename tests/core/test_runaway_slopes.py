"""Least squares of a diverging model rejects steps whose slopes are so large that their squares overflow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.least_squares import Point, Steps, descend
from pliant.records.design import Array

STEPS = Steps(20, 6, 6.0, 5.0, 1e-9, 1e-12)
LIMITS = (np.array([-5.0, -5.0]), np.array([5.0, 5.0]))


@dataclass(frozen=True)
class LineProblem:
    """The model y = x₀ + x₁ t, whose second slope is reported `factor` times too large beyond x₁ = 1."""

    factor: float

    def point(self, x: Array) -> Point:
        t = np.linspace(0.0, 1.0, 9)
        assert np.isfinite(x).all()
        residual = 2.0 + 0.5 * t - x[0] - x[1] * t
        slopes = np.stack([np.ones(9), t * (self.factor if x[1] > 1.0 else 1.0)], axis=1)
        return Point(x, residual, float(residual @ residual), slopes)

    def slopes(self, point: Point) -> Array | None:
        return point.slopes


def test_a_start_with_such_slopes_stays_where_it_is() -> None:
    problem = LineProblem(1e200)
    found, _ = descend(problem, problem.point(np.array([0.0, 2.0])), STEPS, LIMITS)
    np.testing.assert_array_equal(found.x, [0.0, 2.0])


def test_other_starts_are_not_disturbed() -> None:
    problem = LineProblem(1e200)
    found, _ = descend(problem, problem.point(np.zeros(2)), STEPS, LIMITS)
    np.testing.assert_allclose(found.x, [2.0, 0.5], atol=1e-6)
