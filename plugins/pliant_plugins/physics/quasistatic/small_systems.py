"""Compiled: small systems of equations, as plain loops."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, error_model="numpy")
def solve(matrix, right):  # type: ignore[no-untyped-def]
    """Compute matrix⁻¹ right by elimination with pivots; both are overwritten. Singular pivots become tiny ones."""
    n = len(right)
    for i in range(n):
        best = i
        for k in range(i + 1, n):
            if abs(matrix[k, i]) > abs(matrix[best, i]):
                best = k
        if best != i:
            for b in range(n):
                matrix[i, b], matrix[best, b] = matrix[best, b], matrix[i, b]
            right[i], right[best] = right[best], right[i]
        pivot = matrix[i, i] if abs(matrix[i, i]) > 1e-300 else 1e-300
        for k in range(i + 1, n):
            ratio = matrix[k, i] / pivot
            if ratio != 0.0:
                for b in range(i, n):
                    matrix[k, b] -= ratio * matrix[i, b]
                right[k] -= ratio * right[i]
    for i in range(n - 1, -1, -1):
        for b in range(i + 1, n):
            right[i] -= matrix[i, b] * right[b]
        right[i] /= matrix[i, i] if abs(matrix[i, i]) > 1e-300 else 1e-300


@njit(cache=True, error_model="numpy")
def is_positive(matrix, shift, weights, factor):  # type: ignore[no-untyped-def]
    """Return whether symmetric matrix + shift · weights is positive; fill its Cholesky factor, diagonal inverted."""
    n = len(matrix)
    for i in range(n):
        for j in range(i):
            rest = matrix[i, j]
            for k in range(j):
                rest -= factor[i, k] * factor[j, k]
            factor[i, j] = rest * factor[j, j]
        rest = matrix[i, i] + shift * weights[i]
        for k in range(i):
            rest -= factor[i, k] * factor[i, k]
        if not rest > 0.0:
            return False
        factor[i, i] = 1.0 / np.sqrt(rest)
    return True


@njit(cache=True, error_model="numpy")
def substitute(factor, right):  # type: ignore[no-untyped-def]
    """Solve in place with the factor of `is_positive`."""
    n = len(right)
    for i in range(n):
        rest = right[i]
        for k in range(i):
            rest -= factor[i, k] * right[k]
        right[i] = rest * factor[i, i]
    for i in range(n - 1, -1, -1):
        rest = right[i]
        for k in range(i + 1, n):
            rest -= factor[k, i] * right[k]
        right[i] = rest * factor[i, i]
