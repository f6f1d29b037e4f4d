"""The system at one point, reduced to its globals.

With v the unknown displacements, q the globals, Π = U − a W (actuation a, what it works on W), and K = Π_vv
factorised once, back-substitutions Z = K⁻¹ [r_v, Π_vq, W_v] give everything else: Newton's step under any control,

    S Δq = −ρ + b Δa,    S = Π_qq − Π_qv K⁻¹ Π_vq,   ρ = r_q − Π_qv K⁻¹ r_v,   b = W_q − Π_qv K⁻¹ W_v

and, at equilibrium, the exact slopes of the reactions to the joint's axes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array
from pliant_plugins.fem.skfem.linear import LinearSolver
from pliant_plugins.fem.skfem.pattern import Pattern, Terms


@dataclass(frozen=True, eq=False)
class Control:
    """What is prescribed.

    Attributes:
        actuation: Pa or N.
        held: (G,) which globals are held.
        goal: (G,) values of those that are held.
        effort: (G,) external efforts on the piece that oppose the others; zero at a target.
    """

    actuation: float
    held: NDArray[np.bool_]
    goal: Array
    effort: Array


@dataclass(frozen=True, eq=False)
class Reduced:
    """Back-substitutions Z (n, G + 2) and the reduced system in the globals."""

    solved: Array
    stiffness: Array  # S (G, G)
    residual: Array  # ρ (G,)
    actuation: Array  # b (G,)


@dataclass(frozen=True, eq=False)
class Point:
    """A trial state x at one actuation: U and W to second order there."""

    x: Array
    actuation: float
    energy: Terms
    travel: Terms

    @property
    def globals(self) -> int:
        """Number G of the active globals."""
        return int(self.energy.border.shape[1])

    @property
    def residual(self) -> Array:
        """∂Π/∂x over all dofs; its last G are minus the external efforts on the piece."""
        return self.energy.gradient - self.actuation * self.travel.gradient

    @property
    def effort(self) -> Array:
        """External efforts (G,) on the piece that oppose its globals: −∂Π/∂q."""
        return -self.residual[-self.globals :]

    def reduce(self, pattern: Pattern, solver: LinearSolver) -> Reduced:
        """Factorise and condense. Raises `SingularMatrixError`."""
        potential, G = self.energy.plus(-self.actuation, self.travel), self.globals
        columns = np.column_stack([potential.gradient, potential.border, self.travel.gradient])
        reduced = pattern.reduce(columns[:-G])
        solved = solver.solve(potential.matrix, reduced)
        full = columns[-G:] - reduced[:, 1:-1].T @ solved
        return Reduced(solved, full[:, 1:-1], full[:, 0], full[:, -1])


def newton_step(point: Point, reduced: Reduced, pattern: Pattern, control: Control) -> Array:
    """Newton's step towards a control.

    Actuation, held globals and all dofs move together along the tangent, so that no part is left behind.
    """
    rise, held, free = control.actuation - point.actuation, control.held, ~control.held
    globals_ = np.zeros(point.globals)
    globals_[held] = (control.goal - point.x[-point.globals :])[held]
    right = -reduced.residual + reduced.actuation * rise - control.effort - reduced.stiffness @ globals_
    globals_[free] = np.linalg.solve(reduced.stiffness[np.ix_(free, free)], right[free])
    Z = reduced.solved
    inner = -Z[:, 0] - Z[:, 1:-1] @ globals_ + Z[:, -1] * rise
    return np.concatenate([pattern.expand(inner), globals_])


def slopes(reduced: Reduced, axes: tuple[int, ...]) -> tuple[Array, Array]:
    """(∂M/∂a (k,), ∂M/∂q (k, k)) of the efforts M that oppose the globals `axes`, all others at equilibrium."""
    S, b, joint = reduced.stiffness, reduced.actuation, np.array(axes)
    others = np.setdiff1d(np.arange(len(b)), joint)
    lever = np.asarray(np.linalg.solve(S[np.ix_(others, others)], S[np.ix_(others, joint)]), float)
    by_actuation = b[joint] - lever.T @ b[others]
    by_axes = S[np.ix_(joint, others)] @ lever - S[np.ix_(joint, joint)]
    return by_actuation, by_axes
