"""Compiled: Cholesky's factor of a small symmetric matrix."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def factorise(matrix, shift, factor):  # type: ignore[no-untyped-def]
    """Fills the lower triangle of `factor` with L, L Lᵀ = matrix + shift · 1; False where that is not positive.

    Of the matrix only the lower triangle is read.
    """
    for i in range(len(matrix)):
        for j in range(i + 1):
            rest = matrix[i, j] + (shift if i == j else 0.0)
            for k in range(j):
                rest -= factor[i, k] * factor[j, k]
            if i > j:
                factor[i, j] = rest / factor[j, j]
            elif rest > 0.0:
                factor[i, i] = np.sqrt(rest)
            else:
                return False
    return True
