"""The system at one point, reduced to its globals.

With v the free displacements, g = (θ, e), Π = U − p V, and K = Π_vv factorised once, four back-substitutions
Z = K⁻¹ [r_v, Π_vθ, Π_ve, V_v] give everything else: Newton's step under either control,

    S ΔG = −ρ + b Δp,    S = Π_gg − Π_gv K⁻¹ Π_vg,   ρ = r_g − Π_gv K⁻¹ r_v,   b = V_g − Π_gv K⁻¹ V_v

and, at equilibrium, the exact slopes of the reaction to θ.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.records.design import Array
from pliant_plugins.fem.skfem.assembly import Pattern, Terms
from pliant_plugins.fem.skfem.linear import LinearSolver


@dataclass(frozen=True, eq=False)
class Reduced:
    """Back-substitutions Z (n, 4) and the reduced system in (θ, e)."""

    solved: Array
    stiffness: Array  # S (2, 2)
    residual: Array  # ρ (2,)
    actuation: Array  # b (2,)


@dataclass(frozen=True, eq=False)
class Point:
    """A trial state x at pressure p: U and V to second order there."""

    x: Array
    pressure: float
    energy: Terms
    cavity: Terms

    @property
    def residual(self) -> Array:
        """∂Π/∂x over all dofs; its place of θ is minus the external moment on the piece."""
        return self.energy.gradient - self.pressure * self.cavity.gradient

    @property
    def moment(self) -> float:
        """External moment (N·m) on the piece that opposes θ: −∂Π/∂θ."""
        return float(-self.residual[-2])

    def reduce(self, pattern: Pattern, solver: LinearSolver) -> Reduced:
        """Factorise and condense. Raises `SingularMatrixError`."""
        potential = self.energy.minus(self.pressure, self.cavity)
        free = pattern.free
        columns = np.column_stack([potential.gradient, potential.border, self.cavity.gradient])
        solved = solver.solve(potential.matrix, columns[free])
        border = potential.border[free]
        full = columns[-2:] - border.T @ solved
        return Reduced(solved, full[:, 1:3], full[:, 0], full[:, 3])


def newton_step(
    point: Point,
    reduced: Reduced,
    pattern: Pattern,
    pressure: float,
    theta: float | None,
    moment: float,
) -> Array:
    """Newton's step towards `pressure` and an angle or, where `theta` is None, an opposing moment.

    Pressure, angle and all dofs move together along the tangent, so that no part is left behind.
    """
    rise = pressure - point.pressure
    right = -reduced.residual + reduced.actuation * rise
    S = reduced.stiffness
    if theta is None:
        right[0] -= moment
        globals_ = np.linalg.solve(S, right)
    else:
        turn = theta - point.x[-2]
        globals_ = np.array([turn, (right[1] - S[1, 0] * turn) / S[1, 1]])
    step = np.zeros_like(point.x)
    Z = reduced.solved
    step[pattern.free] = -Z[:, 0] - Z[:, 1:3] @ globals_ + Z[:, 3] * rise
    step[-2:] = globals_
    return step


def slopes(reduced: Reduced) -> tuple[float, float]:
    """(∂M/∂p, ∂M/∂θ) of the opposing moment M on the piece, all else at equilibrium."""
    S, b = reduced.stiffness, reduced.actuation
    by_pressure = b[0] - S[0, 1] * b[1] / S[1, 1]
    by_theta = -(S[0, 0] - S[0, 1] ** 2 / S[1, 1])
    return float(by_pressure), float(by_theta)
