"""The discrete system of one module, U and W to second order, condensed to the globals for `fem.newton`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.records.design import Array
from pliant_plugins.fem.newton import Control, Point, Reduced, SingularMatrixError
from pliant_plugins.fem.skfem.assembly import Assembler
from pliant_plugins.fem.skfem.linear import LinearSolver
from pliant_plugins.fem.skfem.pattern import Terms


@dataclass(frozen=True, eq=False)
class ModuleSystem:
    """One assembled problem and the solver of its matrix."""

    assembler: Assembler
    linear: LinearSolver

    @property
    def count(self) -> int:
        """Number G of the active globals."""
        return self.assembler.globals.count

    def evaluate(self, x: Array, actuation: float) -> Point[Terms] | None:
        """U and W to second order at x; None where a cell is inverted."""
        if not (np.all(np.isfinite(x)) and self.assembler.globals.split(x)[1] > -1):
            return None
        energy = self.assembler.elastic_energy(x)
        return None if energy is None else Point(x, actuation, energy, self.assembler.travel(x))

    def reduce(self, point: Point[Terms]) -> Reduced:
        """Factorise and condense. Raises `SingularMatrixError`."""
        potential, G = point.energy.plus(-point.actuation, point.travel), self.count
        columns = np.column_stack([potential.gradient, potential.border, point.travel.gradient])
        reduced = self.assembler.pattern.reduce(columns[:-G])
        solved = self.linear.solve(potential.matrix, reduced)
        if not np.all(np.isfinite(solved)):
            raise SingularMatrixError("the tangent stiffness is singular")
        full = columns[-G:] - reduced[:, 1:-1].T @ solved
        return Reduced(solved, full[:, 1:-1], full[:, 0], full[:, -1])

    def step(self, inner: Array, globals_: Array) -> Array:
        """The change of x."""
        return np.concatenate([self.assembler.pattern.expand(inner), globals_])

    def work(self, point: Point[Terms], step: tuple[Array, Array], control: Control) -> float:
        """|residual · step| over the unknowns; multipliers count with the other sign."""
        residual, G = point.residual, self.count
        residual[-G:] = np.where(control.held, 0.0, residual[-G:] + control.effort)
        residual[self.assembler.pressures] *= -1
        return abs(float(residual @ self.step(*step)))
