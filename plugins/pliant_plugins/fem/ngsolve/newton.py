"""Equilibria along a path of loads and held numbers; see `pliant_plugins.fem.newton`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pliant.records.design import Array
from pliant_plugins.fem.newton import DivergedError, Iteration, Tolerance, in_load_steps
from pliant_plugins.fem.ngsolve.system import Point, Reduced, System


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


@dataclass(frozen=True)
class _Goal:
    """Where a load step ends: actuation, held numbers, efforts (k,) on the free ones."""

    actuation: float
    held: Mapping[int, float]
    effort: Array


class Newton:
    """Solves equilibria of one system."""

    def __init__(self, system: System, tolerance: Tolerance) -> None:
        self.system, self.tolerance = system, tolerance

    def at(self, x: Array, actuation: float) -> Equilibrium:
        """The system at x, which the caller knows to be an equilibrium."""
        point = self.system.evaluate(x, actuation)
        if point is None:
            raise DivergedError("the state to start from has inverted cells")
        return Equilibrium(point, self.system.reduce(point), 0)

    def advance(self, start: Equilibrium, target: Target) -> Equilibrium:
        """Equilibrium at `target`. Raises `DivergedError`."""

        def step(here: Equilibrium, goal: float, patient: bool) -> tuple[Equilibrium, int]:
            level = _on_the_way(start, target, goal, self.system.numbers)
            return self._step(here, level, goal == 1.0, patient)

        end, count = in_load_steps(start, step, self.tolerance.max_halvings)
        return Equilibrium(end.point, end.reduced, count)

    def _step(self, start: Equilibrium, goal: _Goal, final: bool, patient: bool) -> tuple[Equilibrium, int]:
        """One load step: predictor along the tangent, then corrections."""
        iteration = _ToGoal(self.system, goal)
        predicted = iteration.moved(start.point, iteration.towards(start.point, start.reduced), 1.0)
        point, count = iteration.converged(predicted, self.tolerance, final, patient)
        return Equilibrium(point, self.system.reduce(point), count + 1), count + 1


@dataclass(frozen=True, eq=False)
class _ToGoal(Iteration[Point, tuple[Array, Array]]):
    """The iteration to one goal; a step is (Δy, Δg), its work Σ |r_i Δ_i| over what is free."""

    too_long: ClassVar[float] = 0.1
    shortest: ClassVar[float] = 1 / 16
    progress: ClassVar[float] = 1.0

    system: System
    goal: _Goal

    def correction(self, point: Point) -> tuple[Array, Array]:
        return self.towards(point, self.system.reduce(point))

    def towards(self, point: Point, reduced: Reduced) -> tuple[Array, Array]:
        """Newton's step: actuation, numbers and fields move together along the tangent."""
        goal, k = self.goal, self.system.numbers
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

    def work(self, point: Point, step: tuple[Array, Array]) -> float:
        n = self.system.elimination.size
        residual = point.residual
        efforts = residual[n:] - self.goal.effort
        free = [place for place in range(len(efforts)) if place not in self.goal.held]
        return float(np.abs(residual[:n] * step[0]).sum() + np.abs(efforts[free] * step[1][free]).sum())

    def moved(self, point: Point, step: tuple[Array, Array], length: float) -> Point | None:
        return self.system.evaluate(point.x + length * self.system.step(*step), self.goal.actuation)


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
