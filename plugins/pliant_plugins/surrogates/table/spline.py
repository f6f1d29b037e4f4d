"""Uniform cubic B-splines on [0, 1]: cell and weights of points, slopes, antiderivative.

On cell k of n, at t ∈ [0, 1], a spline is Σ_{m=0..3} w_m(t) c_{k+m}; it has n + 3 coefficients and is C²
(de Boor, A Practical Guide to Splines, 1978).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array

ORDER = 4  # weights per point and coordinate
Cells = NDArray[np.int64]


def place(x: Array, cells: int) -> tuple[Cells, Array]:
    """(n,) cell and (n,) place in it of points x in [0, 1]."""
    scaled = x * cells
    cell = np.clip(np.floor(scaled), 0, cells - 1).astype(np.int64)
    return cell, scaled - cell


def weights(t: Array) -> Array:
    """(n, 4) weights of the values."""
    s = 1 - t
    outer = (s**3 / 6, t**3 / 6)
    inner = ((4 - 6 * t**2 + 3 * t**3) / 6, (4 - 6 * s**2 + 3 * s**3) / 6)
    return np.stack([outer[0], inner[0], inner[1], outer[1]], axis=-1)


def slope_weights(t: Array) -> Array:
    """(n, 4) weights of the derivative by t; times the number of cells, by x."""
    s = 1 - t
    return np.stack([-(s**2) / 2, -2 * t + 1.5 * t**2, 2 * s - 1.5 * s**2, t**2 / 2], axis=-1)


def area_weights(t: Array) -> Array:
    """(n, 5) weights of the quartic spline, for the antiderivative's coefficients."""
    s = 1 - t
    ends = (s**4 / 24, t**4 / 24)
    beside = (
        (1 + 4 * s + 6 * s**2 + 4 * s**3 - 4 * s**4) / 24,
        (1 + 4 * t + 6 * t**2 + 4 * t**3 - 4 * t**4) / 24,
    )
    middle = 1 - ends[0] - ends[1] - beside[0] - beside[1]
    return np.stack([ends[0], beside[0], middle, beside[1], ends[1]], axis=-1)


def antiderivative(coefficients: Array) -> Array:
    """(r, n + 4) coefficients of the quartic splines whose derivatives by x are the cubic ones, (r, n + 3)."""
    cells = coefficients.shape[1] - (ORDER - 1)
    return np.pad(np.cumsum(coefficients, axis=1), ((0, 0), (1, 0))) / cells


def rows(x: Array, cells: int, slopes: bool = False) -> Array:
    """(n, cells + 3) the matrix that turns coefficients into values, or into derivatives by x."""
    cell, t = place(x, cells)
    matrix = np.zeros((len(x), cells + ORDER - 1))
    each = slope_weights(t) * cells if slopes else weights(t)
    matrix[np.arange(len(x))[:, None], cell[:, None] + np.arange(ORDER)] = each
    return matrix
