"""Ribbons at the height of the reference line: energies of the rod's globals alone."""

from __future__ import annotations

import numpy as np

from pliant.records.design import Array
from pliant.records.fem import Ribbon
from pliant_plugins.fem.skfem.unknowns import STRAIN


def ribbon_energy(ribbon: Ribbon, span_m: float, turn: Array, strain: float) -> tuple[float, Array, Array]:
    """½ EA L ⟨ε²⟩ with its gradient (4,) and Hessian (4, 4) in (Θ_x, Θ_y, Θ_z, e).

    A fibre at y has the strain ε = e − a y + b y², a = Θ_z / L, b = Θ_x² / (2 L²); with the width's moments
    m₂ = w²/12 and m₄ = w⁴/80, ⟨ε²⟩ = e² + a² m₂ + b² m₄ + 2 e b m₂.
    """
    second, fourth = ribbon.width_m**2 / 12, ribbon.width_m**4 / 80
    a, b = turn[2] / span_m, turn[0] ** 2 / (2 * span_m**2)
    da, db, ddb = 1 / span_m, turn[0] / span_m**2, 1 / span_m**2
    mean = strain**2 + a**2 * second + b**2 * fourth + 2 * strain * b * second
    by_b = 2 * (b * fourth + strain * second)
    gradient, hessian = np.zeros(4), np.zeros((4, 4))
    gradient[0], gradient[2] = by_b * db, 2 * a * da * second
    gradient[STRAIN] = 2 * (strain + b * second)
    hessian[0, 0] = 2 * fourth * db**2 + by_b * ddb
    hessian[0, STRAIN] = hessian[STRAIN, 0] = 2 * second * db
    hessian[2, 2], hessian[STRAIN, STRAIN] = 2 * da**2 * second, 2.0
    half = 0.5 * ribbon.stiffness_n * span_m
    return half * mean, half * gradient, half * hessian
