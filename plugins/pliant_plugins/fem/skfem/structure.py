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
from pliant_plugins.fem.skfem.assembly import Assembler, Terms
from pliant_plugins.fem.skfem.config import SkfemConfig
from pliant_plugins.fem.skfem.linear import SingularMatrixError, linear_solver
from pliant_plugins.fem.skfem.newton import ON_THE_WAY, SHORTEST, TOO_LONG, DivergedError


@dataclass(frozen=True, eq=False)
class Load:
    """Pressure and the dead force on the whole body."""

    pressure: float
    force: Array

    def towards(self, other: Load, fraction: float) -> Load:
        """The load on the straight way to another."""
        if fraction == 1.0:
            return other
        return Load(
            self.pressure + fraction * (other.pressure - self.pressure),
            self.force + fraction * (other.force - self.force),
        )


@dataclass(frozen=True, eq=False)
class Point:
    """A trial state x with U and V to second order."""

    x: Array
    energy: Terms
    cavity: Terms


class SkfemStructure(StructureSolver):
    """Newton's method for one body; a state's `solution` holds the displacements (m) node by node."""

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
        self._unit = material.shear_modulus_pa * self.assembler.volume_m3
        self._spread = np.zeros((self.assembler.size, 3))
        for component in range(3):
            self._spread[3 * problem.tip + component, component] = self.share * problem.tip_shares

    def rest(self) -> StructureState:
        """The body as it was made."""
        point = self._point(np.zeros(self.assembler.size))
        assert point is not None  # the mesh is sound
        return self._state(point, Load(0.0, np.zeros(3)), 0, time.perf_counter())

    def equilibrium(self, pressure_pa: float, tip_force_n: Array, start: StructureState) -> StructureState:
        """Load steps from `start`, halved where Newton's method fails. Raises `StateNotConvergedError`."""
        begun = time.perf_counter()
        if start.solution.shape != (self.assembler.size,):
            raise UserError("the start state belongs to another body: its number of unknowns differs.")
        target = Load(pressure_pa, np.asarray(tip_force_n, float))
        here, load = self._point(start.solution), Load(start.pressure_pa, start.tip_force_n)
        assert here is not None
        reached, length, count, first = 0.0, 1.0, 0, load
        while reached < 1.0:
            goal = min(reached + length, 1.0)
            patient = length <= 0.5**self.config.max_halvings
            try:
                there = first.towards(target, goal)
                here, steps = self._step(here, load, there, goal == 1.0, patient)
            except (DivergedError, SingularMatrixError) as error:
                length /= 2
                if length < 0.5**self.config.max_halvings:
                    raise StateNotConvergedError(
                        f"no equilibrium of the body at {pressure_pa:.6g} Pa and "
                        f"{np.round(tip_force_n, 4).tolist()} N: {error}; stopped after {reached:.0%} of the load step."
                    ) from error
                continue
            reached, count, length, load = goal, count + steps, 2 * length, there
        return self._state(here, target, count, begun)

    def deformed_nodes(self, state: StructureState) -> Array:
        """(n, 3) node positions in m."""
        return self.assembler.positions(state.solution)

    def _step(self, start: Point, before: Load, load: Load, final: bool, patient: bool) -> tuple[Point, int]:
        """Tangent predictor and Newton with a line search; a step that is not `final` ends near equilibrium."""
        enough = self.config.tolerance**2 * self._unit
        if not final:
            enough = max(enough, ON_THE_WAY**2 * self._unit)
        rise = self._push(start, load) - self._push(start, before)
        point = self._point(start.x - self._solve(start, before, self._residual(start, before) - rise))
        for iteration in range(1, self.config.max_iterations + 1):
            if point is None:
                raise DivergedError("the tangent predictor inverts cells")
            residual = self._residual(point, load)
            step = -self._solve(point, load, residual)
            decrement = abs(float(residual @ step))
            if decrement <= enough:
                found = self._point(point.x + step)
                if found is None:
                    raise DivergedError("the last step inverts cells")
                return found, iteration
            if iteration == 1 and not patient and decrement > TOO_LONG**2 * self._unit:
                raise DivergedError("the load step is too long")
            point = self._search(point, step, decrement, load)
        raise DivergedError(f"no convergence in {self.config.max_iterations} Newton steps")

    def _search(self, point: Point, step: Array, decrement: float, load: Load) -> Point:
        length = 1.0
        while length >= SHORTEST:
            trial = self._point(point.x + length * step)
            if trial is not None and abs(float(self._residual(trial, load) @ step)) <= 0.9 * decrement:
                return trial
            length /= 2
        raise DivergedError("the line search found no better point")

    def _push(self, point: Point, load: Load) -> Array:
        """Generalised force of the loads at a point."""
        force: Array = load.pressure * point.cavity.gradient + self._spread @ load.force
        return force

    def _residual(self, point: Point, load: Load) -> Array:
        """∂Π/∂v."""
        return point.energy.gradient - self._push(point, load)

    def _solve(self, point: Point, load: Load, right: Array) -> Array:
        """K⁻¹ right on the free displacements, zero on the others."""
        pattern = self.assembler.pattern
        potential = point.energy.plus(-load.pressure, point.cavity)
        out = pattern.expand(self.linear.solve(potential.matrix, pattern.reduce(right[:, None]))[:, 0])
        if not np.all(np.isfinite(out)):
            raise SingularMatrixError("the tangent stiffness is singular")
        return out

    def _point(self, x: Array) -> Point | None:
        if not np.all(np.isfinite(x)):
            return None
        energy = self.assembler.strain_energy(x)
        return None if energy is None else Point(x, energy, self.assembler.cavity(x))

    def _state(self, point: Point, load: Load, iterations: int, begun: float) -> StructureState:
        nodes = self.assembler.positions(point.x)
        across = np.array([nodes[section[-1]] - nodes[section[0]] for section in self.problem.sections])
        markers = nodes[self.problem.markers]
        markers[-1] = self.problem.tip_shares @ nodes[self.problem.tip]
        return StructureState(
            pressure_pa=load.pressure,
            tip_force_n=load.force,
            markers_m=markers,
            turns_rad=np.arctan2(across[:, 0], across[:, 2]),
            energy_j=point.energy.value / self.share,
            volume_m3=point.cavity.value / self.share,
            iterations=iterations,
            wall_s=time.perf_counter() - begun,
            solution=point.x,
        )
