"""Compiled loops over cells and quadrature points: the mixed law, and a density's way to the nodes.

The variables g at a point are those of `kinematics.Variables`, in the order (S₁ | S₂, ρ_y | S₃, ρ_z | ϑ | q | k, e).
`law_slopes` carries a law's stress and tangent in F, or (F, ϑ, q), to them; `projected` carries a point's gradient and
Hessian in them to a cell's local vector and matrix, which dense products of small matrices add up.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from pliant.records.design import Array
from pliant.records.fem import IntArray


@njit(cache=True)
def mixed_law(
    F: Array, G: Array, J: Array, theta: Array, rho: Array, pressure: Array, K: Array, law_stress: Array,
    law_tangent: Array, stress: Array, tangent: Array,
) -> None:  # fmt: skip
    """Compute stress (n, 11) and tangent (n, 11, 11) of W(F̂) + q (J − ϑ) from P̂ (n, 9), Â (n, 9, 9), F̂ = ρ F.

    `pressure` (n,) is q/K, and `stress` and `tangent` are by (F, ϑ, q/K); a tangent of no rows is left out. Formulas:
    `dilatation.mixed`.
    """
    AF, P = np.empty(9), np.empty(9)
    for p in range(len(F)):
        f, g, r, A = F[p], G[p], rho[p], law_tangent[p]
        m = 0.0
        for i in range(9):
            P[i] = r * law_stress[p, i]
            m += P[i] * f[i] / 3
        work = K[p] * pressure[p] * J[p]
        for i in range(9):
            stress[p, i] = P[i] + (work - m) * g[i]
        stress[p, 9], stress[p, 10] = m / theta[p] - K[p] * pressure[p], K[p] * (J[p] - theta[p])
        if len(tangent) == 0:
            continue
        twice, T = 0.0, tangent[p]
        for i in range(9):
            AF[i] = 0.0
            for k in range(9):
                AF[i] += A[i, k] * f[k]
            AF[i] *= r * r
            twice += AF[i] * f[i]
        gamma = twice / 9 + m / 3 + work
        for i in range(9):
            for k in range(9):
                crossed = g[3 * (i // 3) + k % 3] * g[3 * (k // 3) + i % 3]
                half = g[i] * (gamma * g[k] - (AF[k] + P[k]) / 3) - g[k] * (AF[i] + P[i]) / 3
                T[i, k] = r * r * A[i, k] + half + (m - work) * crossed
            by_growth = (AF[i] - twice / 3 * g[i] + P[i] - m * g[i]) / (3 * theta[p])
            T[i, 9] = T[9, i] = by_growth
            T[i, 10] = T[10, i] = K[p] * J[p] * g[i]
        T[9, 9] = (twice / 9 - 2 / 3 * m) / theta[p] ** 2
        T[9, 10] = T[10, 9] = -K[p]
        T[10, 10] = 0.0


@njit(cache=True)
def law_slopes(
    stress: Array, tangent: Array, g: Array, dg: Array, first: Array, bilinear: Array,
    S: IntArray, frame: IntArray, volume: int, strain: int, gradient: Array, hessian: Array,
) -> None:  # fmt: skip
    """Transform a law's stress (n, N) and tangent (n, N, N) to the variables: gradient (n, v), Hessian (n, v, v) or
    empty.

    With F = S + g ⊗ S₁ the slope of F by the variables is D, and H = Dᵀ A D + P : ∂²F; `volume` and `strain` are the
    indices of ϑ and e, −1 if absent.
    """
    N, count, rows, used = stress.shape[1], gradient.shape[1], g.shape[1], len(frame)
    D, AD = np.zeros((N, count)), np.empty((N, count))
    for p in range(len(stress)):
        D[:] = 0.0
        for i in range(9):
            D[i, S[i]] = 1.0
        for i in range(rows):
            for j in range(3):
                D[3 * i + j, j] += g[p, i]
                for a in range(used):
                    D[3 * i + j, frame[a]] = first[p, j] * dg[p, i, a]
            if strain >= 0:
                D[3 * i, strain] = g[p, i] + (1.0 if i == 0 else 0.0)
        if volume >= 0:
            D[9, volume] = D[10, volume + 1] = 1.0
        for v in range(count):
            gradient[p, v] = 0.0
        for r in range(N):
            for v in range(count):
                gradient[p, v] += stress[p, r] * D[r, v]
        if len(hessian) == 0:
            continue
        H, A = hessian[p], tangent[p]
        for r in range(N):
            for v in range(count):
                AD[r, v] = 0.0
            for k in range(N):
                for v in range(count):
                    AD[r, v] += A[r, k] * D[k, v]
        H[:] = 0.0
        for r in range(N):
            for u in range(count):
                if D[r, u] != 0.0:
                    for v in range(count):
                        H[u, v] += D[r, u] * AD[r, v]
        # P : ∂²F, which is in S₁ ⊗ g, e ⊗ g and g itself
        for a in range(used):
            for j in range(3):
                across = 0.0
                for i in range(rows):
                    across += stress[p, 3 * i + j] * dg[p, i, a]
                H[j, frame[a]] += across
                H[frame[a], j] += across
                if j == 0 and strain >= 0:
                    H[frame[a], strain] += across
                    H[strain, frame[a]] += across
            for b in range(used):
                for i in range(rows):
                    if bilinear[i, a, b] != 0.0:
                        for j in range(3):
                            curved = stress[p, 3 * i + j] * first[p, j] * bilinear[i, a, b]
                            H[frame[a], frame[b]] += curved


@njit(cache=True)
def projected(
    stress: Array, tangent: Array, g: Array, dg: Array, first_row: Array, bilinear: Array, S: IntArray, frame: IntArray,
    volume: int, strain: int, count: int, weight: Array, slopes: Array, value: Array, modes: Array, wide_y: bool,
    wide_z: bool, columns: Array, chosen: IntArray, slot: IntArray, factor: Array, totals: Array,
) -> None:  # fmt: skip
    """Sum a law's slopes at the points of cells into the cells' vectors and into the matrix.

    It works cell by cell, so that large arrays stay in the cache.

    Args:
        stress, tangent: (m, q, N) and (m, q, N, N), or a tangent of no cells; with g … strain of `count` variables as
            `law_slopes` takes them.
        weight: (m, q) volumes.
        slopes, value: (m, q, 3, n) and (q, n) of the displacements' functions.
        modes: (m or 1, q, k) of volume's and pressure's functions, k = 0 without them.
        wide_y, wide_z: whether ρ_y, ρ_z are variables.
        columns: (m, 3 n + 2 k + G, 1 + G) out: gradient and the Hessian's columns of the globals.
        chosen, slot, factor: of `pattern.Scatter`, in the order of the cells; a factor of no entries is 1.
        totals: (nnz,) out: the matrix's values.
    """
    m, q, n, k = weight.shape[0], weight.shape[1], slopes.shape[3], modes.shape[2]
    local = 9 + wide_y + wide_z
    first = local + (2 if k else 0)
    G, second, size, entry = count - first, len(tangent) > 0, 3 * n + 2 * k, 0
    gradient, stiffness = np.empty((q, count)), np.empty((size, size))
    hessian = np.empty((q if second else 0, count, count))
    start = np.array([0, 3, 6 + wide_y, local])
    none = np.empty((0, stress.shape[2], stress.shape[2]))
    narrow, wide = np.empty((q * 3, n)), np.empty((q * 4, n))
    T3, T4, block = np.empty((q * 3, n)), np.empty((q * 4, n)), np.empty((n, n))
    mode = np.empty(n)
    for c in range(m):
        own = modes[c if len(modes) > 1 else 0]
        law_slopes(
            stress[c], tangent[c] if second else none, g[c], dg[c], first_row[c], bilinear, S, frame, volume, strain,
            gradient, hessian,
        )  # fmt: skip
        for p in range(q):
            for r in range(3):
                narrow[3 * p + r] = slopes[c, p, r]
                wide[4 * p + r] = slopes[c, p, r]
            wide[4 * p + 3] = value[p]
        for p in range(q):
            w = weight[c, p]
            for part in range(3):
                rows = start[part + 1] - start[part]
                for r in range(rows):
                    v = start[part] + r
                    B = value[p] if r == 3 else slopes[c, p, r]
                    for col in range(1 + G if second else 1):
                        x = w * (gradient[p, v] if col == 0 else hessian[p, v, first + col - 1])
                        for a in range(n):
                            columns[c, part * n + a, col] += x * B[a]
            for part in range(2 if k else 0):
                for col in range(1 + G if second else 1):
                    v = local + part
                    x = w * (gradient[p, v] if col == 0 else hessian[p, v, first + col - 1])
                    for a in range(k):
                        columns[c, 3 * n + part * k + a, col] += x * own[p, a]
            for i in range(G):
                columns[c, 3 * n + 2 * k + i, 0] += w * gradient[p, first + i]
                for j in range(G if second else 0):
                    columns[c, 3 * n + 2 * k + i, 1 + j] += w * hessian[p, first + i, first + j]
        if not second:
            continue
        stiffness[:] = 0.0
        for d in range(3):
            rd, right = start[d + 1] - start[d], wide if start[d + 1] - start[d] == 4 else narrow
            for e in range(d + 1):
                re = start[e + 1] - start[e]
                T, left = (T4, wide) if re == 4 else (T3, narrow)
                for p in range(q):
                    for r in range(re):
                        row = T[re * p + r]
                        row[:] = 0.0
                        for s in range(rd):
                            h = weight[c, p] * hessian[p, start[e] + r, start[d] + s]
                            B = right[rd * p + s]
                            for a in range(n):
                                row[a] += h * B[a]
                np.dot(left.T, T, block)
                stiffness[e * n : (e + 1) * n, d * n : (d + 1) * n] = block
        for part in range(2 if k else 0):
            v, at = local + part, 3 * n + part * k
            for p in range(q):
                for e in range(3):
                    re = start[e + 1] - start[e]
                    mode[:] = 0.0
                    for r in range(re):
                        h = weight[c, p] * hessian[p, start[e] + r, v]
                        B = value[p] if r == 3 else slopes[c, p, r]
                        for a in range(n):
                            mode[a] += h * B[a]
                    for a in range(n):
                        for b in range(k):
                            stiffness[e * n + a, at + b] += mode[a] * own[p, b]
                for other in range(part + 1):
                    h = weight[c, p] * hessian[p, local + other, v]
                    for a in range(k):
                        for b in range(k):
                            stiffness[3 * n + other * k + a, at + b] += h * own[p, a] * own[p, b]
        while entry < len(chosen) and chosen[entry] < (c + 1) * size * size:
            place = chosen[entry] - c * size * size
            share = stiffness[place // size, place % size]
            totals[slot[entry]] += share * (factor[entry] if len(factor) else 1.0)
            entry += 1


@njit(cache=True)
def scattered(entries: Array, chosen: IntArray, slot: IntArray, factor: Array, totals: Array) -> None:
    """Add factor · entries[chosen] to totals[slot]; a factor without entries is 1."""
    for i in range(len(chosen)):
        totals[slot[i]] += entries[chosen[i]] * (factor[i] if len(factor) else 1.0)
