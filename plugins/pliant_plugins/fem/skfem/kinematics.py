"""The rod frame: kinematics of a piece whose end sections are turned relative to each other by the rotation vector Θ.

    x = r(s₁) + R(s₁) (0, ρ),  R' = R [k]×,  k = Θ / ((1 + e) L)      the line is a helix, k constant
    s₁ = (1 + e) X + v_x,  ρ = (Y + v_y, Z + v_z − z₀)                section coordinates of a material point
    F = S + g ⊗ S₁,  S = I + ∇v + e e₁⊗e₁,  g = k × ρ                 deformation gradient, less the rotation R

With v_x = 0 on both end planes they stay plane, and the end section is turned by exactly Θ; Θ and e are unknowns in
addition to v. The section's rotation cancels in any objective energy. S₁ is the first row of S.

At a point everything depends on S, ρ, k and e (`Variables`): this module gives a density's value, gradient and
Hessian in them; `assembly` carries those to the nodes, `Globals.chain` from k to Θ.
Source: Antman, Nonlinear Problems of Elasticity (2005), ch. 8 (rod-theoretic frames); ours: k constant.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.records.design import Array
from pliant.records.fem import IntArray
from pliant_plugins.fem.skfem.unknowns import Globals

# ∂²g_i/∂a∂b with a, b among (ρ_y, ρ_z, k_x, k_y, k_z): g = k × ρ is bilinear, ρ = (0, ρ_y, ρ_z).
CROSS = np.zeros((3, 5, 5))
for _i, _a, _b, _sign in ((0, 1, 3, 1.0), (0, 0, 4, -1.0), (1, 1, 2, -1.0), (2, 0, 2, 1.0)):
    CROSS[_i, _a, _b] = CROSS[_i, _b, _a] = _sign


@dataclass(frozen=True, eq=False)
class Pointwise:
    """A density at quadrature points (m, q): value (m, q), gradient (m, q, n), Hessian (m, q, n, n)."""

    value: Array
    gradient: Array
    hessian: Array


@dataclass(frozen=True, eq=False)
class Variables:
    """Order of the variables (S₁ | S₂, ρ_y | S₃, ρ_z | ϑ | q | k, e), without those that a problem does not need.

    Attributes:
        S: (9,) places of S, row by row.
        frame: places of those of (ρ_y, ρ_z, k_x, k_y, k_z) that are used; `used` their indices there.
        lateral: whether ρ_y, ρ_z are used.
        rows: rows of F that the frame changes in addition to S: 1 without twist, else 3.
        volume: place of the mixed element's ϑ, its q the next, or None.
        strain: place of e, or None.
        count: number of variables.
    """

    S: IntArray
    frame: IntArray
    used: IntArray
    lateral: tuple[bool, bool]
    rows: int
    volume: int | None
    strain: int | None
    count: int

    @staticmethod
    def from_globals(active: Globals, mixed: bool = False) -> Variables:
        """Return the variables that the active globals and, if it is `mixed`, the element need."""
        twist, up, side = (i in active.turns for i in range(3))
        y, z = twist or side, twist or up
        S = np.array([0, 1, 2, 3, 4, 5, 6 + y, 7 + y, 8 + y])
        first = 9 + y + z + 2 * mixed
        frame = [6] * y + [9 + y] * z + list(range(first, first + len(active.turns)))
        used = [0] * y + [1] * z + [2 + i for i in active.turns]
        count = first + active.count
        return Variables(
            S=S,
            frame=np.array(frame, int),
            used=np.array(used, int),
            lateral=(y, z),
            rows=3 if twist else 1,
            volume=first - 2 if mixed else None,
            strain=count - 1 if active.stretches else None,
            count=count,
        )


@dataclass(frozen=True, eq=False)
class RodMotion:
    """F (m, q, 3, 3) with what it is made of: g and ∂g (m, q, rows[, used]), S₁ (m, q, 3), ∂²g (rows, used, used)."""

    F: Array
    g: Array
    dg: Array
    first: Array
    bilinear: Array


def motion(variables: Variables, S: Array, rho: Array, k: Array, strain: float) -> RodMotion:
    """Return F at S (m, q, 3, 3), without e, and ρ (m, q, 2)."""
    rows = variables.rows
    bilinear = CROSS[:rows][:, variables.used][:, :, variables.used]
    point = np.concatenate([rho, np.broadcast_to(k, (*rho.shape[:-1], 3))], axis=-1)[..., variables.used]
    dg = np.tensordot(point, bilinear, axes=(-1, 2))
    g = 0.5 * np.einsum("mqia,mqa->mqi", dg, point)
    first = S[..., 0, :] + strain * np.array([1.0, 0.0, 0.0])
    F = S.copy()
    F[..., 0, :] = first
    F[..., :rows, :] += g[..., None] * first[..., None, :]
    return RodMotion(F, g, dg, first, bilinear)
