"""Compiled: Cholesky's factors of symmetric matrices, of which only the lower triangle is read."""

from __future__ import annotations

import numpy as np
from numba import njit

# Sums may be reordered, so that they run in vector registers; numbers that are none stay visible.
LOOSE = {"reassoc", "contract", "arcp", "nsz"}


@njit(cache=True, nogil=True, fastmath=LOOSE)
def factorise(matrix, shift, factor):  # type: ignore[no-untyped-def]
    """Fills the lower triangle of `factor` with L, L Lᵀ = matrix + shift · 1; False where it is not positive.

    Row by row, four rows of L at a time against the present one: each number read serves four sums.
    """
    n = len(matrix)
    for i in range(n):
        row = factor[i]
        j = 0
        while j + 4 <= i:
            r0, r1, r2, r3 = factor[j], factor[j + 1], factor[j + 2], factor[j + 3]
            s0 = s1 = s2 = s3 = 0.0
            for k in range(j):
                x = row[k]
                s0 += x * r0[k]
                s1 += x * r1[k]
                s2 += x * r2[k]
                s3 += x * r3[k]
            x0 = (matrix[i, j] - s0) / r0[j]
            x1 = (matrix[i, j + 1] - s1 - x0 * r1[j]) / r1[j + 1]
            x2 = (matrix[i, j + 2] - s2 - x0 * r2[j] - x1 * r2[j + 1]) / r2[j + 2]
            x3 = (matrix[i, j + 3] - s3 - x0 * r3[j] - x1 * r3[j + 1] - x2 * r3[j + 2]) / r3[j + 3]
            row[j], row[j + 1], row[j + 2], row[j + 3] = x0, x1, x2, x3
            j += 4
        while j < i:
            r0 = factor[j]
            s0 = 0.0
            for k in range(j):
                s0 += row[k] * r0[k]
            row[j] = (matrix[i, j] - s0) / r0[j]
            j += 1
        s0 = 0.0
        for k in range(i):
            s0 += row[k] * row[k]
        rest = matrix[i, i] + shift - s0
        if not rest > 0.0:
            return False
        row[i] = np.sqrt(rest)
    return True


@njit(cache=True, nogil=True, fastmath=LOOSE)
def solve_factorised(factor, right):  # type: ignore[no-untyped-def]
    """Overwrites right (n,) with the solution of L Lᵀ x = right."""
    n = len(right)
    for i in range(n):
        row = factor[i]
        s = 0.0
        for k in range(i):
            s += row[k] * right[k]
        right[i] = (right[i] - s) / row[i]
    for i in range(n - 1, -1, -1):
        row = factor[i]
        right[i] /= row[i]
        x = right[i]
        for k in range(i):
            right[k] -= x * row[k]
