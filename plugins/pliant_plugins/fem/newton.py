"""Newton's method from one equilibrium to a neighbouring one, in load steps that are halved where one fails.

What is iterated, its correction and the measure of a correction are the backend's (`Iteration`); the way is the same:
a predictor, corrections with a line search, and a first correction that is too long gives the load step up at once,
because two half steps are cheaper.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Generic, TypeVar

import numpy as np

Point = TypeVar("Point")
Step = TypeVar("Step")
State = TypeVar("State")

ON_THE_WAY = 1e-3  # strain at which an intermediate step is good enough to go on from


class SingularMatrixError(ArithmeticError):
    """The matrix could not be factorised."""


class DivergedError(ArithmeticError):
    """Newton's method did not converge, even in the smallest load steps."""


@dataclass(frozen=True)
class Tolerance:
    """When a correction is small enough. Work is measured against `unit_j`, the energy of a uniform shear of 1.

    Attributes:
        strain: root mean square of the strain that the last correction adds.
        max_iterations: corrections before a load step is halved.
        max_halvings: how often a load step may be halved.
    """

    unit_j: float
    strain: float
    max_iterations: int
    max_halvings: int

    def enough_j(self, final: bool) -> float:
        """Work of the last correction; a load step that is not `final` may end near equilibrium."""
        enough = self.strain**2 * self.unit_j
        return enough if final else max(enough, ON_THE_WAY**2 * self.unit_j)


class Iteration(ABC, Generic[Point, Step]):
    """Newton's iteration to one load level."""

    too_long: ClassVar[float] = 0.05  # strain (root mean square) of a first correction that ends a load step
    shortest: ClassVar[float] = 1 / 32  # fraction of a correction below which the line search gives up
    progress: ClassVar[float] = 0.9  # share of its work below which a shortened correction must come

    @abstractmethod
    def correction(self, point: Point) -> Step:
        """Newton's step at a point. Raises `SingularMatrixError`."""

    @abstractmethod
    def work(self, point: Point, step: Step) -> float:
        """Work (J) of the point's residual along a step, ≥ 0."""

    @abstractmethod
    def moved(self, point: Point, step: Step, length: float) -> Point | None:
        """The point after a share of a step; None where a cell is inverted."""

    def converged(
        self, point: Point | None, tolerance: Tolerance, final: bool, patient: bool
    ) -> tuple[Point, int]:
        """The equilibrium that a predicted point leads to, and the corrections that it took.

        A step that is not `final` ends near equilibrium. Unless `patient`, a load step is given up at once where the
        predictor leaves much to correct.

        Raises:
            DivergedError: there is none within the iterations.
            SingularMatrixError: the stiffness on the way.
        """
        enough = tolerance.enough_j(final)
        for number in range(1, tolerance.max_iterations + 1):
            if point is None:
                raise DivergedError("the tangent predictor inverts cells")
            step = self.correction(point)
            work = self.work(point, step)
            if work <= enough:
                last = self.moved(point, step, 1.0)
                if last is None:
                    raise DivergedError("the last step inverts cells")
                return last, number
            if number == 1 and not patient and work > self.too_long**2 * tolerance.unit_j:
                raise DivergedError("the load step is too long")
            point = self._searched(point, step, work)
        raise DivergedError(f"no convergence in {tolerance.max_iterations} Newton steps")

    def _searched(self, point: Point, step: Step, work: float) -> Point:
        """The first of 1, ½, ¼ … of the step after which the residual works less along it."""
        length = 1.0
        while length >= self.shortest:
            trial = self.moved(point, step, length)
            if trial is not None and self.work(trial, step) < self.progress * work:
                return trial
            length /= 2
        raise DivergedError("the line search found no better point")


def in_load_steps(
    start: State, step: Callable[[State, float, bool], tuple[State, int]], max_halvings: int
) -> tuple[State, int]:
    """Go from `start` to the whole load, in one step or, where that fails or is too long, in shorter ones.

    Args:
        start: where the way begins.
        step: from a state to a share of the load, and whether to be patient; the state there, and iterations.
        max_halvings: how often a load step may be halved.

    Raises:
        DivergedError: the smallest step failed; says how far it came.
    """
    here, reached, length, count = start, 0.0, 1.0, 0
    smallest = 0.5**max_halvings
    while reached < 1.0:
        goal = min(reached + length, 1.0)
        try:
            here, iterations = step(here, goal, length <= smallest)
        except (DivergedError, SingularMatrixError, np.linalg.LinAlgError) as error:
            length /= 2
            if length < smallest:
                raise DivergedError(f"{error}; stopped after {reached:.0%} of the load step") from error
            continue
        reached, count, length = goal, count + iterations, 2 * length
    return here, count
