"""Compiled loops of the materials: F⁻ᵀ, and the neo-Hookean law at many points; imported at the first call."""

from __future__ import annotations

from numba import njit

from pliant.records.design import Array


@njit(cache=True)
def cofactors(F: Array, J: Array, G: Array) -> None:
    """Fill J = det F (n,) and G = F⁻ᵀ (n, 9) of F (n, 9)."""
    for p in range(len(F)):
        f, g = F[p], G[p]
        g[0], g[1], g[2] = f[4] * f[8] - f[5] * f[7], f[5] * f[6] - f[3] * f[8], f[3] * f[7] - f[4] * f[6]
        g[3], g[4], g[5] = f[7] * f[2] - f[8] * f[1], f[8] * f[0] - f[6] * f[2], f[6] * f[1] - f[7] * f[0]
        g[6], g[7], g[8] = f[1] * f[5] - f[2] * f[4], f[2] * f[3] - f[0] * f[5], f[0] * f[4] - f[1] * f[3]
        J[p] = f[0] * g[0] + f[1] * g[1] + f[2] * g[2]
        if J[p] != 0:
            for i in range(9):
                g[i] /= J[p]


@njit(cache=True)
def neo_hookean(
    F: Array, J: Array, G: Array, mu: float, K: float, energy: Array, stress: Array, tangent: Array
) -> None:
    """Fill W (n,), P (n, 9) and A (n, 9, 9) of F (n, 9), with its J and G; formulas: `neo_hookean`."""
    for p in range(len(F)):
        f, g, j, A = F[p], G[p], J[p], tangent[p]
        I1 = 0.0
        for i in range(9):
            I1 += f[i] * f[i]
        bar, pressure = mu * j ** (-2 / 3), K * (j - 1) * j
        energy[p] = 0.5 * (bar * I1 - 3 * mu) + 0.5 * K * (j - 1) ** 2
        along, crossed = 2 / 9 * bar * I1 + K * j * (2 * j - 1), bar * I1 / 3 - pressure
        for i in range(9):
            stress[p, i] = bar * f[i] - crossed * g[i]
            for k in range(9):
                A[i, k] = g[i] * (along * g[k] - 2 / 3 * bar * f[k]) - 2 / 3 * bar * f[i] * g[k]
                # (ij)(kl) of G_il G_kj
                A[i, k] += crossed * g[3 * (i // 3) + k % 3] * g[3 * (k // 3) + i % 3]
            A[i, i] += bar
