"""Newton's iteration to a neighbouring equilibrium, in load steps that are halved where one fails.

What is iterated, its correction and the measure of a correction are an `Iteration`'s; the way is the same: a
predictor, corrections with a line search, and a first correction that is too long gives the load step up at once,
because two half steps are cheaper. Near the equilibrium corrections come from the matrix that was factorised last, as
long as each is far smaller than the one before (chord steps: Kelley, Iterative Methods for Linear and Nonlinear
Equations, 1995, ch. 5.4).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

Trial = TypeVar("Trial")
Step = TypeVar("Step")
State = TypeVar("State")

ON_THE_WAY = 1e-3  # strain below which an intermediate step is accurate enough to continue from
CHORD = 0.02  # strain of a correction below which the factorised matrix is used once more
MOST_CHORDS = 5  # about as many cost a factorisation
SHRINK = 0.15  # share of the one before that a chord step may be


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
        too_long: strain (root mean square) of a first correction that ends a load step.
        shortest: fraction of a correction below which the line search gives up.
        progress: share of its work below which a shortened correction must come.
    """

    unit_j: float
    strain: float
    max_iterations: int
    max_halvings: int
    too_long: float = 0.05
    shortest: float = 1 / 32
    progress: float = 0.9


class Iteration(ABC, Generic[Trial, Step]):
    """Newton's iteration to one load level."""

    @abstractmethod
    def correction(self, point: Trial) -> Step:
        """Return Newton's step at a point. Raises `SingularMatrixError`."""

    def again(self, point: Trial) -> Step | None:
        """Return a step at a point with the matrix of the last `correction`; None if that is not kept."""
        return None

    @abstractmethod
    def work(self, point: Trial, step: Step) -> float:
        """Return the work (J) of the point's residual along a step, ≥ 0."""

    @abstractmethod
    def moved(self, point: Trial, step: Step, length: float) -> Trial | None:
        """Return the point after a share of a step; None if a cell is inverted."""

    def converged(
        self, point: Trial | None, tolerance: Tolerance, final: bool, patient: bool
    ) -> tuple[Trial, int]:
        """Iterate from a predicted point to equilibrium; return it and the number of corrections.

        A step that is not `final` ends near equilibrium. Unless `patient`, a load step is given up immediately if the
        predictor leaves a large correction.

        Raises:
            DivergedError: no equilibrium was found within the iterations.
            SingularMatrixError: the stiffness is singular at an iterate.
        """
        enough = tolerance.strain**2 * tolerance.unit_j
        enough = enough if final else max(enough, ON_THE_WAY**2 * tolerance.unit_j)
        chords = 0
        for number in range(1, tolerance.max_iterations + 1):
            if point is None:
                raise DivergedError("the predictor inverts cells")
            step = self.correction(point)
            work = self.work(point, step)
            if work <= enough:
                last = self.moved(point, step, 1.0)
                if last is None:
                    raise DivergedError("the last step inverts cells")
                return last, number + chords
            if number == 1 and not patient and work > tolerance.too_long**2 * tolerance.unit_j:
                raise DivergedError("the load step is too long")
            point = self._searched(point, step, work, tolerance)
            point, more, done = self._by_chords(point, work, tolerance.unit_j, enough)
            chords += more
            if done:
                return point, number + chords
        raise DivergedError(f"no convergence in {tolerance.max_iterations} Newton steps")

    def _by_chords(self, point: Trial, before: float, unit: float, enough: float) -> tuple[Trial, int, bool]:
        """Take chord steps after a correction that worked `before`; return the point, their number and success.

        It is when a step is small `enough` and what it leaves, itself times its share of the step before, is as small
        as what a step of Newton's that is small enough would leave, its square.
        """
        count, least = 0, enough * enough / unit
        while before <= CHORD**2 * unit and (step := self.again(point)) is not None:
            work = self.work(point, step)
            if not 0 < work <= SHRINK**2 * before:
                break
            done = work <= enough and work * work / before <= least
            if not done and np.log(least / work) / np.log(work / before) > MOST_CHORDS:
                break
            moved = self.moved(point, step, 1.0)
            if moved is None:
                break
            point, count, before = moved, count + 1, work
            if done:
                return point, count, True
        return point, count, False

    def _searched(self, point: Trial, step: Step, work: float, tolerance: Tolerance) -> Trial:
        """Return the first of 1, ½, ¼ … of the step after which the residual works less along it."""
        length = 1.0
        while length >= tolerance.shortest:
            trial = self.moved(point, step, length)
            if trial is not None and self.work(trial, step) < tolerance.progress * work:
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
        DivergedError: the smallest step failed; the message states the share reached.
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
