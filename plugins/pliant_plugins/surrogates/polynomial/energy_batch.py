"""The bare polynomial of an energy law for many points of its box at once, compiled.

The terms stand outside the loop over points, so that points go through them side by side. Nothing of other files is
called here: numba's cache on disk looks only at the file of a function. No operation is reordered or fused.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pliant.records.design import Array

# Points that go through the terms together: their powers stay in the first-level cache.
BLOCK = 64
COLUMNS = 13  # Π, τ (3), ∂τ/∂p (3), ∂τ/∂u as xx, xy, xz, yy, yz, zz


@njit(cache=True, nogil=True, error_model="numpy")
def inside(at: Array, maps: Array, powers: NDArray[np.int64], table: Array, out: Array) -> None:
    """Fill out (n, 13).

    Args:
        at: (n, 4) p and u, all in the box.
        maps: (4, 2) centres and scales of p and u.
        powers: (m, 3) of each monomial in u.
        table: (m, columns) its coefficients of x⁰, x¹ …
    """
    columns = table.shape[1]
    most = powers.max() if len(powers) else 0
    x = np.empty(BLOCK)
    value, slope = np.empty(BLOCK), np.empty(BLOCK)
    # v^j of each axis; the places before the first are zero, for derivatives of low powers
    v = np.zeros((3, most + 3, BLOCK))
    found = np.empty((COLUMNS, BLOCK))
    sx, sy, sz = maps[1, 1], maps[2, 1], maps[3, 1]
    for start in range(0, len(at), BLOCK):
        n = min(BLOCK, len(at) - start)
        for k in range(n):
            x[k] = (at[start + k, 0] - maps[0, 0]) / maps[0, 1]
        for a in range(3):
            for k in range(n):
                v[a, 2, k] = 1.0
            for k in range(n):
                first = (at[start + k, 1 + a] - maps[1 + a, 0]) / maps[1 + a, 1]
                for j in range(3, most + 3):
                    v[a, j, k] = v[a, j - 1, k] * first
        found[:] = 0.0
        for m in range(len(powers)):
            a, b, c = powers[m, 0], powers[m, 1], powers[m, 2]
            a1, b1, c1 = a / sx, b / sy, c / sz
            a2, b2, c2 = a1 * (a - 1) / sx, b1 * (b - 1) / sy, c1 * (c - 1) / sz
            for k in range(n):
                value[k] = table[m, columns - 1]
                slope[k] = 0.0
            for i in range(columns - 2, -1, -1):
                c_i = table[m, i]
                for k in range(n):
                    slope[k] = slope[k] * x[k] + value[k]
                    value[k] = value[k] * x[k] + c_i
            X, X1, X2 = v[0, a + 2], v[0, a + 1], v[0, a]
            Y, Y1, Y2 = v[1, b + 2], v[1, b + 1], v[1, b]
            Z, Z1, Z2 = v[2, c + 2], v[2, c + 1], v[2, c]
            for k in range(n):
                px, py, pz = a1 * X1[k], b1 * Y1[k], c1 * Z1[k]
                yz, xz, xy = Y[k] * Z[k], X[k] * Z[k], X[k] * Y[k]
                w = value[k]
                gx, gy, gz = px * yz, py * xz, pz * xy
                found[0, k] += w * X[k] * yz
                found[1, k] -= w * gx
                found[2, k] -= w * gy
                found[3, k] -= w * gz
                found[4, k] -= slope[k] * gx
                found[5, k] -= slope[k] * gy
                found[6, k] -= slope[k] * gz
                found[7, k] -= w * a2 * X2[k] * yz
                found[8, k] -= w * px * py * Z[k]
                found[9, k] -= w * px * pz * Y[k]
                found[10, k] -= w * b2 * Y2[k] * xz
                found[11, k] -= w * py * pz * X[k]
                found[12, k] -= w * c2 * Z2[k] * xy
        for k in range(n):
            rate = 1.0 / maps[0, 1]
            for i in range(4, 7):
                found[i, k] *= rate
            for i in range(COLUMNS):
                out[start + k, i] = found[i, k]
