"""Least squares with costly slopes: secants stand for slopes where first order foresaw the change."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pliant.least_squares import Point, Steps, descend
from pliant.records.design import Array

STEPS = Steps(20, 6, 6.0, 5.0, 1e-9, 1e-8)
LIMITS = (np.array([-5.0, -5.0]), np.array([5.0, 5.0]))


@dataclass
class DecayProblem:
    """The model y = x₀ exp(−x₁ t) of data with x = (2, 1), whose slopes are counted."""

    asked: int = 0

    def at(self, x: Array) -> tuple[Array, Array]:
        t = np.linspace(0.0, 2.0, 30)
        shape = np.exp(-x[1] * t)
        return 2.0 * np.exp(-t) - x[0] * shape, np.stack([shape, -x[0] * t * shape], axis=1)

    def point(self, x: Array) -> Point:
        residual = self.at(x)[0]
        return Point(x, residual, float(residual @ residual))

    def slopes(self, point: Point) -> Array | None:
        self.asked += 1
        return self.at(point.x)[1]


def test_secants_need_fewer_slopes_and_end_at_the_same_minimum() -> None:
    asked = []
    for secant in (0.0, 0.1):
        problem = DecayProblem()
        start = problem.point(np.array([1.0, 0.5]))
        start = Point(start.x, start.residual, start.cost, problem.slopes(start))
        found, _ = descend(problem, start, replace(STEPS, secant=secant), LIMITS)
        np.testing.assert_allclose(found.x, [2.0, 1.0], atol=1e-4)
        assert found.slopes is not None
        np.testing.assert_allclose(found.slopes, problem.at(found.x)[1], atol=0.05 if secant else 1e-12)
        asked.append(problem.asked)
    assert asked[1] < asked[0]
