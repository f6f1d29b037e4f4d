"""Equilibria of one module under control of actuation and joint axes; see `pliant_plugins.fem.newton`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.records.design import Array
from pliant_plugins.fem.newton import DivergedError, Iteration, SingularMatrixError, Tolerance, in_load_steps
from pliant_plugins.fem.skfem.assembly import Assembler
from pliant_plugins.fem.skfem.condense import Control, Point, Reduced, newton_step
from pliant_plugins.fem.skfem.config import SkfemConfig
from pliant_plugins.fem.skfem.linear import LinearSolver


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A converged point with its reduced system, ready to be left again."""

    point: Point
    reduced: Reduced
    iterations: int


class Newton:
    """Solves the equilibria of one assembled problem."""

    def __init__(self, assembler: Assembler, solver: LinearSolver, config: SkfemConfig) -> None:
        self.assembler, self.solver = assembler, solver
        shear = assembler.material.evaluate(np.eye(3)).tangent[0, 1, 0, 1]
        # a uniform shear of 1 stores this much: the natural scale of a correction's work
        unit = float(shear * assembler.volume_m3)
        self.tolerance = Tolerance(unit, config.tolerance, config.max_iterations, config.max_halvings)

    def at(self, x: Array, actuation: float) -> Equilibrium:
        """The system at x, which the caller knows to be an equilibrium."""
        point = self.evaluate(x, actuation)
        if point is None:
            raise DivergedError("the state to start from has inverted cells")
        return Equilibrium(point, self.reduce(point), 0)

    def advance(self, start: Equilibrium, target: Control) -> Equilibrium:
        """Equilibrium at `target`. Raises `DivergedError`."""

        def step(here: Equilibrium, goal: float, patient: bool) -> tuple[Equilibrium, int]:
            return self._step(here, _between(start.point, target, goal), goal == 1.0, patient)

        end, count = in_load_steps(start, step, self.tolerance.max_halvings)
        return Equilibrium(end.point, end.reduced, count)

    def _step(
        self, start: Equilibrium, target: Control, final: bool, patient: bool
    ) -> tuple[Equilibrium, int]:
        """One load step: tangent predictor, then corrections."""
        step = newton_step(start.point, start.reduced, self.assembler.pattern, target)
        predicted = self.evaluate(start.point.x + step, target.actuation)
        point, count = _ToControl(self, target).converged(predicted, self.tolerance, final, patient)
        return Equilibrium(point, self.reduce(point), count + 1), count + 1

    def evaluate(self, x: Array, actuation: float) -> Point | None:
        """U and W to second order at x; None where a cell is inverted."""
        if not (np.all(np.isfinite(x)) and self.assembler.globals.split(x)[1] > -1):
            return None
        energy = self.assembler.elastic_energy(x)
        return None if energy is None else Point(x, actuation, energy, self.assembler.travel(x))

    def reduce(self, point: Point) -> Reduced:
        """The point's system in the globals. Raises `SingularMatrixError`."""
        reduced = point.reduce(self.assembler.pattern, self.solver)
        if not np.all(np.isfinite(reduced.solved)):
            raise SingularMatrixError("the tangent stiffness is singular")
        return reduced


@dataclass(frozen=True, eq=False)
class _ToControl(Iteration[Point, Array]):
    """The iteration to one control."""

    newton: Newton
    target: Control

    def correction(self, point: Point) -> Array:
        return newton_step(point, self.newton.reduce(point), self.newton.assembler.pattern, self.target)

    def work(self, point: Point, step: Array) -> float:
        """|residual · step| over the unknowns; multipliers count with the other sign."""
        residual, G = point.residual, point.globals
        residual[-G:] = np.where(self.target.held, 0.0, residual[-G:] + self.target.effort)
        residual[self.newton.assembler.pressures] *= -1
        return abs(float(residual @ step))

    def moved(self, point: Point, step: Array, length: float) -> Point | None:
        return self.newton.evaluate(point.x + length * step, self.target.actuation)


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
