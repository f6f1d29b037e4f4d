"""Equilibria of a whole body: the same assembly in the frame of the base, θ = e = 0, where F = I + ∇v.

Π(v) = U − p V − f·Σ s_n v_n over half of the body; V takes the cavity's closed surface, the cap included. Newton's
method goes along the straight way in (p, f), pressure, force and displacements moving together.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.fem import StateNotConvergedError, StructureSolver
from pliant.interfaces.material import Material
from pliant.records.design import Array
from pliant.records.fem import ModuleProblem
from pliant.records.structure import StructureProblem, StructureState
from pliant_plugins.fem.config import SkfemConfig
from pliant_plugins.fem.iteration import (
    DivergedError,
    Iteration,
    SingularMatrixError,
    Tolerance,
    in_load_steps,
)
from pliant_plugins.fem.skfem.assembly import Assembler
from pliant_plugins.fem.skfem.linear import linear_solver
from pliant_plugins.fem.skfem.pattern import Terms

Load = Array  # (4,) pressure and the dead force on the whole body


@dataclass(frozen=True, eq=False)
class BodyPoint:
    """A trial state x with U and V to second order."""

    x: Array
    energy: Terms
    cavity: Terms


class SkfemStructure(StructureSolver):
    """Newton's method for one body; a state's `solution` contains the displacements (m) node by node."""

    def __init__(self, config: SkfemConfig, problem: StructureProblem, material: Material) -> None:
        self.problem, self.config = problem, config
        self.share = 0.5 if problem.symmetric else 1.0
        span = float(np.ptp(problem.mesh.nodes_m[:, 0]))
        as_module = ModuleProblem(
            mesh=problem.mesh,
            span_m=span,
            reference_z_m=0.0,
            deformation_scale=1.0,
            energy_scale=1 / self.share,
            fixed=problem.fixed,
            axes=(),
            stretches=False,
        )
        self.assembler = Assembler(as_module, material, config.dilatation)
        self.linear = linear_solver(config.linear_solver, self.assembler.pattern)
        unit = material.shear_modulus_pa * self.assembler.volume_m3
        self.tolerance = Tolerance(unit, config.tolerance, config.max_iterations, config.max_halvings)
        self._spread = np.zeros((self.assembler.size, 3))
        for component in range(3):
            self._spread[3 * problem.tip + component, component] = self.share * problem.tip_shares

    def rest(self) -> StructureState:
        """Return the undeformed state."""
        point = self.point(np.zeros(self.assembler.size))
        assert point is not None  # the mesh is sound
        return self._state(point, np.zeros(4), 0, time.perf_counter())

    def equilibrium(self, pressure_pa: float, tip_force_n: Array, start: StructureState) -> StructureState:
        """Load steps from `start`, halved where Newton's method fails. Raises `StateNotConvergedError`."""
        begun = time.perf_counter()
        if start.solution.shape != (self.assembler.size,):
            raise UserError("the start state belongs to another body: its number of unknowns differs.")
        target, before = (
            np.array([pressure_pa, *tip_force_n]),
            np.array([start.pressure_pa, *start.tip_force_n]),
        )
        here = self.point(start.solution)
        assert here is not None

        def step(
            state: tuple[BodyPoint, Load], goal: float, patient: bool
        ) -> tuple[tuple[BodyPoint, Load], int]:
            load = target if goal == 1.0 else before + goal * (target - before)
            point, count = self._step(*state, load, goal == 1.0, patient)
            return (point, load), count

        try:
            (end, _), count = in_load_steps((here, before), step, self.tolerance.max_halvings)
        except DivergedError as error:
            raise StateNotConvergedError(
                f"no equilibrium of the body at {pressure_pa:.6g} Pa and "
                f"{np.round(tip_force_n, 4).tolist()} N: {error}."
            ) from error
        return self._state(end, target, count, begun)

    def deformed_nodes(self, state: StructureState) -> Array:
        """Return (n, 3) node positions in m."""
        return self.assembler.positions(state.solution)

    def _step(
        self, start: BodyPoint, before: Load, load: Load, final: bool, patient: bool
    ) -> tuple[BodyPoint, int]:
        """Predict along the tangent, then correct."""
        rise = self.push(start, load) - self.push(start, before)
        predicted = self.point(start.x - self.solve(start, before, self.residual(start, before) - rise))
        return _ToLoad(self, load).converged(predicted, self.tolerance, final, patient)

    def push(self, point: BodyPoint, load: Load) -> Array:
        """Return generalised force of the loads at a point."""
        return np.asarray(load[0] * point.cavity.gradient + self._spread @ load[1:])

    def residual(self, point: BodyPoint, load: Load) -> Array:
        """Return gradient ∂Π/∂v (n,) of the potential by the displacements, N."""
        return point.energy.gradient - self.push(point, load)

    def solve(self, point: BodyPoint, load: Load, right: Array) -> Array:
        """Return K⁻¹ right on the free displacements, zero on the others."""
        pattern = self.assembler.pattern
        potential = point.energy.plus(-load[0], point.cavity)
        out = pattern.expand(self.linear.solve(potential.matrix, pattern.reduce(right[:, None]))[:, 0])
        if not np.all(np.isfinite(out)):
            raise SingularMatrixError("the tangent stiffness is singular")
        return out

    def point(self, x: Array) -> BodyPoint | None:
        """Return U and V to second order at x; None where a cell is inverted."""
        if not np.all(np.isfinite(x)):
            return None
        energy = self.assembler.strain_energy(x)
        return None if energy is None else BodyPoint(x, energy, self.assembler.cavity(x))

    def _state(self, point: BodyPoint, load: Load, iterations: int, begun: float) -> StructureState:
        nodes = self.assembler.positions(point.x)
        across = np.array([nodes[section[-1]] - nodes[section[0]] for section in self.problem.sections])
        markers = nodes[self.problem.markers]
        markers[-1] = self.problem.tip_shares @ nodes[self.problem.tip]
        return StructureState(
            pressure_pa=float(load[0]),
            tip_force_n=load[1:],
            markers_m=markers,
            turns_rad=np.arctan2(across[:, 0], across[:, 2]),
            energy_j=point.energy.value / self.share,
            volume_m3=point.cavity.value / self.share,
            iterations=iterations,
            wall_s=time.perf_counter() - begun,
            solution=point.x,
        )


@dataclass(frozen=True, eq=False)
class _ToLoad(Iteration[BodyPoint, Array]):
    """The iteration to one load; a step is a change of all displacements."""

    body: SkfemStructure
    load: Load

    def correction(self, point: BodyPoint) -> Array:
        return -self.body.solve(point, self.load, self.body.residual(point, self.load))

    def work(self, point: BodyPoint, step: Array) -> float:
        return abs(float(self.body.residual(point, self.load) @ step))

    def moved(self, point: BodyPoint, step: Array, length: float) -> BodyPoint | None:
        return self.body.point(point.x + length * step)
