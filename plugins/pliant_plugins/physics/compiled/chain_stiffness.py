"""Compiled: Cholesky's factors of a chain's stiffness in a time that grows with n, not n³.

What lies beyond joint j is all that joints i < j feel of it, so off its diagonal blocks the stiffness has the rank
of a force and a moment: K_ij = U_iᵀ Y_j for i < j, with U_i = ω_i, Y_j = −T_j ω_j (`pliant.mechanics.statics`), and
three rows more for each cord, U_i = J_i, Y_j = (T/L)(1 − d dᵀ) J_j. Its factor then has the same form,
L_ji = Y_jᵀ W_i, and with P_i = Σ_{k<i} W_k W_kᵀ

    L_ii L_iiᵀ = K_ii + s 1 − Y_iᵀ P_i Y_i,   W_i L_iiᵀ = U_i − P_i Y_i.

(Semiseparable matrices: Vandebril, Van Barel & Mastronardi 2008, chapter 4.)
"""

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


@njit(cache=True, nogil=True)
def new_factor(n, a, rank):  # type: ignore[no-untyped-def]
    """Generators U, Y and W (n, a, rank), diagonal blocks of K and of L (n, a, a), P (rank, rank), a row (rank,)."""
    return (
        np.zeros((n, a, rank)),
        np.zeros((n, a, rank)),
        np.zeros((n, a, rank)),
        np.zeros((n, a, a)),
        np.zeros((n, a, a)),
        np.zeros((rank, rank)),
        np.zeros(rank),
    )


@njit(cache=True, nogil=True)
def factorise_chain(parts, shift):  # type: ignore[no-untyped-def]
    """Fills W and L from U, Y and the diagonal blocks; False where K + shift · 1 is not positive."""
    before, beyond, through, own, lower, total, _ = parts
    n, a, rank = before.shape
    block = np.empty((a, a))
    total[:] = 0.0
    for i in range(n):
        for b in range(a):
            for r in range(rank):
                through[i, b, r] = 0.0
                for s in range(rank):
                    through[i, b, r] += total[r, s] * beyond[i, b, s]
        for b in range(a):
            for e in range(b + 1):
                value = 0.5 * (own[i, b, e] + own[i, e, b])
                for r in range(rank):
                    value -= beyond[i, e, r] * through[i, b, r]
                block[b, e] = value
        if not factorise(block, shift, lower[i]):
            return False
        for b in range(a):
            for r in range(rank):
                value = before[i, b, r] - through[i, b, r]
                for e in range(b):
                    value -= lower[i, b, e] * through[i, e, r]
                through[i, b, r] = value / lower[i, b, b]
        for b in range(a):
            for r in range(rank):
                for s in range(rank):
                    total[r, s] += through[i, b, r] * through[i, b, s]
    return True


@njit(cache=True, nogil=True)
def solve_chain(parts, right):  # type: ignore[no-untyped-def]
    """Overwrites right (n·a,) with the solution of L Lᵀ x = right."""
    _, beyond, through, _, lower, _, carried = parts
    n, a, rank = beyond.shape
    carried[:] = 0.0
    for i in range(n):
        for b in range(a):
            value = right[i * a + b]
            for r in range(rank):
                value -= beyond[i, b, r] * carried[r]
            for e in range(b):
                value -= lower[i, b, e] * right[i * a + e]
            right[i * a + b] = value / lower[i, b, b]
        for b in range(a):
            for r in range(rank):
                carried[r] += through[i, b, r] * right[i * a + b]
    carried[:] = 0.0
    for i in range(n - 1, -1, -1):
        for b in range(a - 1, -1, -1):
            value = right[i * a + b]
            for r in range(rank):
                value -= through[i, b, r] * carried[r]
            for e in range(b + 1, a):
                value -= lower[i, e, b] * right[i * a + e]
            right[i * a + b] = value / lower[i, b, b]
        for b in range(a):
            for r in range(rank):
                carried[r] += beyond[i, b, r] * right[i * a + b]


@njit(cache=True, nogil=True)
def fill_dense(parts, stiffness):  # type: ignore[no-untyped-def]
    """Fills the whole stiffness (n·a, n·a)."""
    before, beyond, _, own, _, _, _ = parts
    n, a, rank = before.shape
    for j in range(n):
        for e in range(a):
            for i in range(j):
                for b in range(a):
                    value = 0.0
                    for r in range(rank):
                        value += before[i, b, r] * beyond[j, e, r]
                    stiffness[i * a + b, j * a + e] = stiffness[j * a + e, i * a + b] = value
            for b in range(a):
                stiffness[j * a + b, j * a + e] = own[j, b, e]
