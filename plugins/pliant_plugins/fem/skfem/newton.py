"""Newton's method from one equilibrium to a neighbouring one, under control of actuation and joint axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.records.design import Array
from pliant_plugins.fem.skfem.assembly import Assembler
from pliant_plugins.fem.skfem.condense import Control, Point, Reduced, newton_step
from pliant_plugins.fem.skfem.linear import LinearSolver, SingularMatrixError

TOO_LONG = 0.05  # strain (root mean square) of the first correction: beyond, two half steps are cheaper
ON_THE_WAY = 1e-3  # strain at which an intermediate step is good enough to go on from
SHORTEST = 1 / 32  # fraction of a Newton step below which the line search gives up


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A converged point with its reduced system, ready to be left again."""

    point: Point
    reduced: Reduced
    iterations: int


class DivergedError(ArithmeticError):
    """Newton's method did not converge, even in the smallest load steps."""


class Newton:
    """Solves the equilibria of one assembled problem."""

    def __init__(
        self,
        assembler: Assembler,
        solver: LinearSolver,
        tolerance: float,
        max_iterations: int,
        max_halvings: int,
    ) -> None:
        self.assembler, self.solver = assembler, solver
        self.max_iterations, self.max_halvings = max_iterations, max_halvings
        shear = assembler.material.evaluate(np.eye(3)).tangent[0, 1, 0, 1]
        # a uniform shear of that size stores this much: the decrement's natural scale
        self._unit = float(shear * assembler.volume_m3)
        self._enough = tolerance**2 * self._unit

    def at(self, x: Array, actuation: float) -> Equilibrium:
        """The system at x, which the caller knows to be an equilibrium."""
        point = self._evaluate(x, actuation)
        if point is None:
            raise DivergedError("the state to start from has inverted cells")
        return Equilibrium(point, self._reduce(point), 0)

    def advance(self, start: Equilibrium, target: Control) -> Equilibrium:
        """Equilibrium at `target`, in one step or, where that fails or is too long, in shorter ones.

        Raises `DivergedError`.
        """
        here, reached, length, count = start, 0.0, 1.0, 0
        while reached < 1.0:
            goal = min(reached + length, 1.0)
            try:
                last = length <= 0.5**self.max_halvings
                here = self._step(here, _between(start.point, target, goal), goal == 1.0, last)
            except (DivergedError, SingularMatrixError, np.linalg.LinAlgError) as error:
                length /= 2
                if length < 0.5**self.max_halvings:
                    raise DivergedError(f"{error}; stopped after {reached:.0%} of the load step") from error
                continue
            reached, count, length = goal, count + here.iterations, 2 * length
        return Equilibrium(here.point, here.reduced, count)

    def _step(self, start: Equilibrium, target: Control, final: bool, patient: bool) -> Equilibrium:
        """One load step: tangent predictor, then Newton with a line search.

        A step that is not `final` ends near equilibrium. Unless `patient`, a step is given up at once where the
        predictor leaves much to correct.
        """
        enough = self._enough if final else max(self._enough, ON_THE_WAY**2 * self._unit)
        step = newton_step(start.point, start.reduced, self.assembler.pattern, target)
        point = self._evaluate(start.point.x + step, target.actuation)
        for iteration in range(1, self.max_iterations + 1):
            if point is None:
                raise DivergedError("the tangent predictor inverts cells")
            reduced = self._reduce(point)
            step = newton_step(point, reduced, self.assembler.pattern, target)
            decrement = self._work(point, step, target)
            if decrement <= enough:
                found = self._evaluate(point.x + step, target.actuation)
                if found is None:
                    raise DivergedError("the last step inverts cells")
                return Equilibrium(found, self._reduce(found), iteration + 1)
            if iteration == 1 and not patient and decrement > TOO_LONG**2 * self._unit:
                raise DivergedError("the load step is too long")
            point = self._search(point, step, decrement, target)
        raise DivergedError(f"no convergence in {self.max_iterations} Newton steps")

    def _search(self, point: Point, step: Array, decrement: float, target: Control) -> Point:
        """The first of 1, ½, ¼ … of the step after which the residual works less along it."""
        length = 1.0
        while length >= SHORTEST:
            trial = self._evaluate(point.x + length * step, target.actuation)
            if trial is not None and self._work(trial, step, target) <= 0.9 * decrement:
                return trial
            length /= 2
        raise DivergedError("the line search found no better point")

    def _work(self, point: Point, step: Array, target: Control) -> float:
        """|residual · step| over the unknowns, in J; multipliers count with the other sign."""
        residual, G = point.residual, point.globals
        residual[-G:] = np.where(target.held, 0.0, residual[-G:] + target.effort)
        residual[self.assembler.pressures] *= -1
        return abs(float(residual @ step))

    def _evaluate(self, x: Array, actuation: float) -> Point | None:
        if not (np.all(np.isfinite(x)) and self.assembler.globals.split(x)[1] > -1):
            return None
        energy = self.assembler.elastic_energy(x)
        return None if energy is None else Point(x, actuation, energy, self.assembler.travel(x))

    def _reduce(self, point: Point) -> Reduced:
        reduced = point.reduce(self.assembler.pattern, self.solver)
        if not np.all(np.isfinite(reduced.solved)):
            raise SingularMatrixError("the tangent stiffness is singular")
        return reduced


def _between(start: Point, target: Control, fraction: float) -> Control:
    """The control on the straight way from `start` to `target`."""
    if fraction == 1.0:
        return target
    here = start.x[-start.globals :]
    return Control(
        start.actuation + fraction * (target.actuation - start.actuation),
        target.held,
        here + fraction * (target.goal - here),
        np.where(target.held, 0.0, start.effort + fraction * (target.effort - start.effort)),
    )
