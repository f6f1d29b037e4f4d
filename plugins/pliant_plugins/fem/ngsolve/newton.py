"""Newton's method along a path of loads and held numbers, from one equilibrium to another."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pliant.records.design import Array
from pliant_plugins.fem.ngsolve.system import Point, Reduced, SingularMatrixError, System

LONG = 0.1  # strain of a predictor's correction beyond which the load step is halved
PASSING = 1e-3  # strain at which an intermediate equilibrium is good enough to go on from
SHORTEST = 1 / 16  # fraction of a Newton step below which the line search gives up


@dataclass(frozen=True)
class Target:
    """An actuation, and the numbers that are held, by their place; the others are free of effort."""

    actuation: float
    held: Mapping[int, float]


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A converged point with its reduced system."""

    point: Point
    reduced: Reduced
    iterations: int


class DivergedError(ArithmeticError):
    """Newton's method did not converge, even in the smallest load steps."""


@dataclass(frozen=True)
class _Goal:
    """Where a load step ends: actuation, held numbers, efforts (k,) on the free ones."""

    actuation: float
    held: Mapping[int, float]
    effort: Array


class Newton:
    """Solves equilibria of one system.

    A step's size is the work Σ |r_i Δ_i| against `unit_j`, the energy of a uniform shear of 1.
    """

    def __init__(
        self, system: System, unit_j: float, tolerance: float, max_iterations: int, max_halvings: int
    ) -> None:
        self.system, self.unit_j, self.tolerance = system, unit_j, tolerance
        self.max_iterations, self.max_halvings = max_iterations, max_halvings

    def at(self, x: Array, actuation: float) -> Equilibrium:
        """The system at x, which the caller knows to be an equilibrium."""
        point = self.system.evaluate(x, actuation)
        if point is None:
            raise DivergedError("the state to start from has inverted cells")
        return Equilibrium(point, self.system.reduce(point), 0)

    def advance(self, start: Equilibrium, target: Target) -> Equilibrium:
        """Equilibrium at `target`, the way there halved where a step fails. Raises `DivergedError`."""
        here, reached, length, count = start, 0.0, 1.0, 0
        smallest = 0.5**self.max_halvings
        while reached < 1.0:
            until = min(reached + length, 1.0)
            try:
                goal = _on_the_way(start, target, until, self.system.numbers)
                here = self._step(here, goal, final=until == 1.0, patient=length <= smallest)
            except (DivergedError, SingularMatrixError) as error:
                length /= 2
                if length < smallest:
                    raise DivergedError(f"{error}; stopped after {reached:.0%} of the load step") from error
                continue
            reached, count, length = until, count + here.iterations, 2 * length
        return Equilibrium(here.point, here.reduced, count)

    def _step(self, start: Equilibrium, goal: _Goal, final: bool, patient: bool) -> Equilibrium:
        """Predictor along the tangent, then Newton. Unless `patient`, a long correction ends it at once."""
        enough = (self.tolerance if final else max(PASSING, self.tolerance)) ** 2 * self.unit_j
        step = self._towards(start, goal)
        point = self.system.evaluate(start.point.x + self.system.step(*step), goal.actuation)
        for iteration in range(1, self.max_iterations + 1):
            if point is None:
                raise DivergedError("the step inverts cells")
            here = Equilibrium(point, self.system.reduce(point), iteration)
            step = self._towards(here, goal)
            work = self._work(point, step, goal)
            if work <= enough:
                found = self.system.evaluate(point.x + self.system.step(*step), goal.actuation)
                if found is None:
                    raise DivergedError("the last step inverts cells")
                return Equilibrium(found, self.system.reduce(found), iteration + 1)
            if iteration == 1 and not patient and work > LONG**2 * self.unit_j:
                raise DivergedError("the load step is too long")
            point = self._search(point, step, work, goal)
        raise DivergedError(f"no convergence in {self.max_iterations} Newton steps")

    def _search(self, point: Point, step: tuple[Array, Array], work: float, goal: _Goal) -> Point:
        """The first of 1, ½, ¼ … of the step after which the residual works less along it."""
        length, change = 1.0, self.system.step(*step)
        while length >= SHORTEST:
            trial = self.system.evaluate(point.x + length * change, goal.actuation)
            if trial is not None and self._work(trial, step, goal) < work:
                return trial
            length /= 2
        raise DivergedError("the line search found no better point")

    def _towards(self, here: Equilibrium, goal: _Goal) -> tuple[Array, Array]:
        """Newton's step (Δy, Δg): actuation, numbers and fields move together along the tangent."""
        point, reduced, k = here.point, here.reduced, self.system.numbers
        rise = goal.actuation - point.actuation
        change = np.zeros(k)
        for place, value in goal.held.items():
            change[place] = value - point.x[self.system.fields + place]
        free = [place for place in range(k) if place not in goal.held]
        if free:
            right = goal.effort - reduced.residual + reduced.actuation * rise - reduced.stiffness @ change
            change[free] = np.linalg.solve(reduced.stiffness[np.ix_(free, free)], right[free])
        Z = reduced.solved
        return -Z[:, 0] - Z[:, 1:-1] @ change + Z[:, -1] * rise, change

    def _work(self, point: Point, step: tuple[Array, Array], goal: _Goal) -> float:
        """Σ |r_i Δ_i| over what is free, in J."""
        n = self.system.elimination.size
        residual = point.residual
        efforts = residual[n:] - goal.effort
        free = [place for place in range(len(efforts)) if place not in goal.held]
        return float(np.abs(residual[:n] * step[0]).sum() + np.abs(efforts[free] * step[1][free]).sum())


def _on_the_way(start: Equilibrium, target: Target, fraction: float, numbers: int) -> _Goal:
    """The controls on the straight way from `start` to `target`; efforts that held a number fade out."""
    point = start.point

    def mix(a: float, b: float) -> float:
        return b if fraction == 1.0 else a + fraction * (b - a)

    values = point.x[len(point.x) - numbers :]
    efforts = point.residual[len(point.residual) - numbers :]
    return _Goal(
        mix(point.actuation, target.actuation),
        {place: mix(float(values[place]), value) for place, value in target.held.items()},
        np.array([mix(float(effort), 0.0) for effort in efforts]),
    )
