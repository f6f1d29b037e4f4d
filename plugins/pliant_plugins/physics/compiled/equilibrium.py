"""Compiled: Newton's method on the potential of a chain, globalised so that it ends in a minimum.

Where the stiffness K is positive definite the step is Newton's; elsewhere K is shifted by a multiple of 1 until it
is (Nocedal & Wright 2006, algorithm 3.3), so every step descends. A step that does not reduce the residual is cut
back until the potential has decreased sufficiently. An equilibrium that is a saddle is left along its lowest mode.

The Cholesky factorisation of a chain's stiffness takes O(n) time instead of O(n³). Joints i < j are affected by joint j
only through the force and the moment of the bodies beyond it, so off its diagonal blocks the stiffness has the rank of
a force and a moment: K_ij = U_iᵀ Y_j for i < j, with U_i = ω_i, Y_j = −T_j ω_j (`pliant.mechanics.statics`), and three
rows more for each cord, U_i = J_i, Y_j = (T/L)(1 − d dᵀ) J_j. Its factor then has the same form, L_ji = Y_jᵀ W_i, and
with P_i = Σ_{k<i} W_k W_kᵀ

    L_ii L_iiᵀ = K_ii + s 1 − Y_iᵀ P_i Y_i,   W_i L_iiᵀ = U_i − P_i Y_i.

(Semiseparable matrices: Vandebril, Van Barel & Mastronardi 2008, chapter 4.)

Functions with a single call site are inlined before type inference: otherwise each would be compiled and optimised
separately, and again in all its callers.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from pliant.mechanics.efforts import DOMAIN_ROUNDING
from pliant.mechanics.statics import NEUTRAL_SHARE
from pliant_plugins.physics.compiled.arrays import copy, copy_rows
from pliant_plugins.physics.compiled.statics import balance, new_frame, place, potential, stiffen

SUFFICIENT_DECREASE = 1e-4
MAX_HALVINGS = 30
# Share of the longest step by which a saddle is left along its most negative mode.
PUSH = 0.2
# Difference of ∂τ/∂u to its transpose, relative to the stiffness, beyond which a law has no energy.
ROUNDING = 1e-12
RELAX_ITERATIONS = 400
# Turn of a joint (share of the longest step) at which the first step of the relaxation aims.
RELAX_SHARE = 0.1


@njit(cache=True, nogil=True)
def factorise(matrix, shift, weights, factor):  # type: ignore[no-untyped-def]
    """Fill the lower triangle of `factor` with L, L Lᵀ = matrix + shift · weights; return False if not positive.

    Of the matrix only the lower triangle is read.
    """
    for i in range(len(matrix)):
        for j in range(i + 1):
            rest = matrix[i, j] + (shift * weights[i] if i == j else 0.0)
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
    """Return arrays U, Y and W (n, a, rank), diagonal blocks of K and L (n, a, a), P (rank, rank), a row (rank,).

    The last, (a,), are weights of shifts: 1 / reach² (`weigh`), so that all coordinates are shifted in one unit.
    """
    return (
        np.zeros((n, a, rank)),
        np.zeros((n, a, rank)),
        np.zeros((n, a, rank)),
        np.zeros((n, a, a)),
        np.zeros((n, a, a)),
        np.zeros((rank, rank)),
        np.zeros(rank),
        np.ones(a),
    )


@njit(cache=True, nogil=True)
def weigh(body, parts):  # type: ignore[no-untyped-def]
    """Fill the weights of shifts."""
    reach, weights = body[9], parts[7]
    for b in range(len(reach)):
        weights[b] = 1.0 / (reach[b] * reach[b])


@njit(cache=True, nogil=True)
def factorise_chain(parts, shift):  # type: ignore[no-untyped-def]
    """Fill W and L from U, Y and the diagonal blocks; return False if K + shift · weights is not positive."""
    before, beyond, through, own, lower, total, _, weights = parts
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
        if not factorise(block, shift, weights, lower[i]):
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
    """Overwrite right (n·a,) with the solution of L Lᵀ x = right."""
    _, beyond, through, _, lower, _, carried, _ = parts
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
    """Fill the whole stiffness (n·a, n·a)."""
    before, beyond, own = parts[0], parts[1], parts[3]
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


@njit(cache=True, nogil=True)
def _largest(values):  # type: ignore[no-untyped-def]
    largest = 0.0
    for value in values.flat:
        largest = max(largest, abs(value))
    return largest


@njit(cache=True, nogil=True)
def _longest(moves, reach):  # type: ignore[no-untyped-def]
    """Return the longest of moves (n·a,) as a share of the reach (a,) of its coordinate."""
    longest, a = 0.0, len(reach)
    for i in range(len(moves)):
        longest = max(longest, abs(moves[i]) / reach[i % a])
    return longest


@njit(cache=True, nogil=True)
def _stiffest(blocks, reach):  # type: ignore[no-untyped-def]
    """Return the largest entry of blocks (n, a, a), with travels of extensible joints scaled by `reach`."""
    largest, a = 0.0, len(reach)
    for i in range(len(blocks)):
        for b in range(a):
            for e in range(a):
                largest = max(largest, abs(blocks[i, b, e]) * reach[b] * reach[e])
    return largest


@njit(cache=True, nogil=True, inline="always")
def _product(first, second):  # type: ignore[no-untyped-def]
    """Return the sum of the products of two (n, a)."""
    n, a = first.shape
    total = 0.0
    for i in range(n):
        for b in range(a):
            total += first[i, b] * second[i, b]
    return total


@njit(cache=True, nogil=True)
def _dense(parts):  # type: ignore[no-untyped-def]
    n, a, _ = parts[0].shape
    stiffness = np.empty((n * a, n * a))
    fill_dense(parts, stiffness)
    return stiffness


@njit(cache=True, nogil=True)
def _fold(flat, share, rows):  # type: ignore[no-untyped-def]
    """Fill rows (n, a) with a share of the flat values (n·a,)."""
    n, a = rows.shape
    for i in range(n):
        for b in range(a):
            rows[i, b] = share * flat[i * a + b]


@njit(cache=True, nogil=True)
def _unfold(rows):  # type: ignore[no-untyped-def]
    """Flatten rows (n, a)."""
    n, a = rows.shape
    flat = np.empty(n * a)
    for i in range(n):
        for b in range(a):
            flat[i * a + b] = rows[i, b]
    return flat


@njit(cache=True, nogil=True)
def _go(start, step, share, q):  # type: ignore[no-untyped-def]
    """Fill q (n, a) with start + share · step."""
    n, a = q.shape
    for i in range(n):
        for b in range(a):
            q[i, b] = start[i, b] + share * step[i, b]


@njit(cache=True, nogil=True, inline="always")
def _leave_saddle(chain, q, mode, length, frame):  # type: ignore[no-untyped-def]
    """Move q along the mode, in the direction of lower potential."""
    body, laws, loads = chain
    start, push, energies = q.copy(), np.empty(q.shape), np.empty(2)
    _fold(mode, length / _longest(mode, body[9]), push)
    for way in range(2):
        _go(start, push, 2.0 * way - 1.0, q)
        place(body, q, frame)
        energies[way] = potential(body, laws, loads, q, frame)
    if not energies[1] <= energies[0]:
        _go(start, push, -1.0, q)


@njit(cache=True, nogil=True, inline="always")
def _search(chain, q, step, share, positive, norm, above, frame):  # type: ignore[no-untyped-def]
    """Move q along the step (n, a) by `share` of it, or less.

    `above` is the potential at q, or NaN if it has not been computed yet.

    Returns:
        largest residual, its norm, potential (or no number) where it ends; whether the step helped.
    """
    body, laws, loads = chain
    slope = _product(frame[9], step)
    start = q.copy()
    _go(start, step, 1.0, q)
    size, reached = balance(body, laws, loads, q, frame)
    if positive and reached <= (1.0 - 0.1 * share) * norm:
        return size, reached, np.nan, True
    whole = reached
    below = potential(body, laws, loads, q, frame) if np.isfinite(reached) else np.inf
    moved = False
    if np.isnan(above):
        place(body, start, frame)
        above = potential(body, laws, loads, start, frame)
        moved = True
    rounding = 1e-14 * max(abs(above), 1e-12)
    part = 1.0
    for _ in range(MAX_HALVINGS):
        if above - below >= SUFFICIENT_DECREASE * part * slope - rounding:
            if moved:
                size, reached = balance(body, laws, loads, q, frame)
            return size, reached, below, True
        part *= 0.5
        _go(start, step, part, q)
        place(body, q, frame)
        below = potential(body, laws, loads, q, frame)
        moved = True
    if whole < norm:
        _go(start, step, 1.0, q)
    else:
        copy_rows(start, q)
    size, reached = balance(body, laws, loads, q, frame)
    return size, reached, np.nan, whole < norm


@njit(cache=True, nogil=True, inline="always")
def descend(chain, q, frame, parts, options):  # type: ignore[no-untyped-def]
    """Move q (n, a) to a stable equilibrium.

    Args:
        chain: `Body.arrays`, `CompiledLaws.arrays`, `load_arrays`.
        frame: see `new_frame`; filled at the q where it ends.
        parts: see `new_factor`, of rank 3 and 3 more for each cord.
        options: tolerance on the largest residual, iterations allowed, longest move of a coordinate in one.

    Returns:
        whether it arrived, whether K is positive (semi-)definite at the end, the largest residual, iterations.
    """
    tolerance, max_iterations, max_step = options
    body, laws, loads = chain
    size, norm = balance(body, laws, loads, q, frame)
    energy, moved = np.nan, np.empty(q.shape)
    for iteration in range(max_iterations + 1):
        if not np.isfinite(size):
            return False, False, size, iteration
        skewness = stiffen(body, loads, q, frame, parts)
        positive = factorise_chain(parts, 0.0)
        if size <= tolerance:
            if positive:
                return True, True, size, iteration
            curvatures, modes = np.linalg.eigh(_dense(parts))
            if curvatures[0] >= -NEUTRAL_SHARE * _largest(curvatures):  # 0 within rounding
                return True, True, size, iteration
            if iteration < max_iterations:
                _leave_saddle(chain, q, modes[:, 0].copy(), PUSH * max_step, frame)
                size, norm = balance(body, laws, loads, q, frame)
                energy = np.nan
            continue
        if iteration == max_iterations:
            return False, positive, size, iteration
        step, scale = _unfold(frame[9]), _stiffest(parts[3], body[9])
        if positive and skewness > ROUNDING * scale:  # a law without an energy
            copy(np.linalg.solve(_dense(parts), step), step)
        elif positive or np.isfinite(scale):
            # About the smallest shift that makes the stiffness positive.
            shift = 0.0 if positive else 1e-3 * scale + 1e-300
            while not positive and not factorise_chain(parts, shift):
                shift *= 3.0
            solve_chain(parts, step)
        else:
            return False, False, size, iteration
        share = min(1.0, max_step / _longest(step, body[9]))
        _fold(step, share, moved)
        size, norm, energy, helped = _search(chain, q, moved, share, positive, norm, energy, frame)
        if not helped:
            return False, positive, size, iteration + 1
    return False, False, size, max_iterations


@njit(cache=True, nogil=True, inline="always")
def relax(chain, q, frame, parts, options):  # type: ignore[no-untyped-def]
    """Move q (n, a) along an overdamped motion with increasing steps, (K + δ 1) Δq = r; return their number.

    Arguments are those of `descend`, which continues from the result.

    Pseudo-transient continuation with switched evolution (Kelley & Keyes, SIAM J. Numer. Anal. 35, 1998): slow, but it
    follows a long chain through curling and snap-through, in which the residual first increases.
    """
    tolerance, _, max_step = options
    body, laws, loads = chain
    size, _ = balance(body, laws, loads, q, frame)
    damping, moved = size / (RELAX_SHARE * max_step), np.empty(q.shape)
    done = 0
    while done < RELAX_ITERATIONS:
        done += 1
        if size <= 1e3 * tolerance or not np.isfinite(size):
            break
        stiffen(body, loads, q, frame, parts)
        shift = damping
        while not factorise_chain(parts, shift) and np.isfinite(shift):
            shift = 2.0 * shift + 1e-12
        step = _unfold(frame[9])
        solve_chain(parts, step)
        _fold(step, min(1.0, max_step / _longest(step, body[9])), moved)
        _go(q, moved, 1.0, q)
        reached, _ = balance(body, laws, loads, q, frame)
        damping *= min(max(reached / size, 0.1), 2.0)
        size = reached
    return done


@njit(cache=True, nogil=True, inline="always")
def _leaves_domain(boxes, signs, drives, p, q, by_q):  # type: ignore[no-untyped-def]
    """Return whether a joint is outside the box of its law, or its ∂τ/∂u is not negative definite."""
    n, a = q.shape
    block, factor, even = np.empty((a, a)), np.empty((a, a)), np.ones(a)
    rows = boxes.shape[1] - a
    for i in range(n):
        first, last, m = drives[i, 0], drives[i, 1], drives[i, 2]
        for k in range(first, last):
            own = rows - m + (k - first if m > 1 else 0)
            if not boxes[i, own, 0] - DOMAIN_ROUNDING <= p[k] <= boxes[i, own, 1] + DOMAIN_ROUNDING:
                return True
            for b in range(a):
                u = signs[k] * q[i, b]
                if (
                    not boxes[i, rows + b, 0] - DOMAIN_ROUNDING
                    <= u
                    <= boxes[i, rows + b, 1] + DOMAIN_ROUNDING
                ):
                    return True
        for b in range(a):
            for e in range(a):
                block[b, e] = -0.5 * (by_q[i, b, e] + by_q[i, e, b])
        if not factorise(block, 0.0, even, factor):
            return True
    return False


@njit(cache=True, nogil=True)
def settle(body, laws, boxes, loads, q, markers, options):  # type: ignore[no-untyped-def]
    """Move q (n, a) to a stable equilibrium and fill the markers (n + 2, 3) there.

    Where the direct way fails it follows the overdamped motion from q.

    Args:
        body, laws, loads: see `descend`; boxes: `CompiledLaws.boxes`.

    Returns:
        converged, stable, largest residual, iterations, whether a law leaves its domain.
    """
    n, a = q.shape
    frame = new_frame(n, a, len(laws[3]))
    parts = new_factor(n, a, 3 + 3 * len(loads[8]))
    weigh(body, parts)
    chain = (body, laws, loads)
    start, iterations = q.copy(), 0
    converged, stable, size = False, False, np.inf
    for way in range(2):  # one call of `descend` in the text: it is compiled into this once
        if way == 1:
            copy_rows(start, q)
            iterations += relax(chain, q, frame, parts, options)
        converged, stable, size, more = descend(chain, q, frame, parts, options)
        iterations += more
        if converged:
            break
    copy_rows(frame[0], markers)
    copy(frame[4][n], markers[n + 1])
    outside = _leaves_domain(boxes, laws[3], laws[4], loads[0], q, frame[7])
    return converged, stable, size, iterations, outside
