"""Compiled: an equilibrium with its slopes by every actuation, by the implicit function theorem."""

from __future__ import annotations

import numpy as np
from numba import njit

from pliant_plugins.physics.compiled.equilibrium import (
    ROUNDING,
    factorise_chain,
    fill_dense,
    new_factor,
    settle,
    solve_chain,
)
from pliant_plugins.physics.compiled.statics import PRISMATIC, balance, n_turns, new_frame, stiffen


@njit(cache=True, nogil=True)
def respond(body, laws, boxes, loads, q, markers, by_p, turn, spin, options):  # type: ignore[no-untyped-def]
    """Move q (n, a) to the equilibrium and fill its derivatives by the actuators.

    Args:
        body, laws, boxes, loads, q, markers, options: as `settle` takes them.
        by_p: (k, n + 2, 3) slopes of the markers, filled.
        turn: (3, 3) attitude of the last body, filled; `spin` (k, 3) its angular velocity per unit of each actuator.

    Returns:
        what `settle` returns, and whether the slopes are those of a regular equilibrium.
    """
    converged, stable, size, iterations, outside = settle(body, laws, boxes, loads, q, markers, options)
    (n, a), k = q.shape, len(loads[0])
    frame, parts = new_frame(n, a, k), new_factor(n, a, 3 + 3 * len(loads[8]))
    balance(body, laws, loads, q, frame)
    skewness = stiffen(body, loads, q, frame, parts)
    positive = factorise_chain(parts, 0.0)
    scale = 0.0
    for value in parts[3].flat:
        scale = max(scale, abs(value))
    dense = np.empty((n * a, n * a))
    plain = positive and skewness <= ROUNDING * scale
    if not plain:
        fill_dense(parts, dense)
    pivots, directions, turns = frame[12], frame[3], n_turns(body[0], a)
    turn[:, :] = frame[1][n]
    by_p[:], spin[:] = 0.0, 0.0
    for m in range(k):
        moved = np.empty(n * a)
        for i in range(n):
            for b in range(a):
                moved[i * a + b] = frame[6][m, i, b]
        if plain:
            solve_chain(parts, moved)
        elif positive:
            moved = np.linalg.solve(dense, moved)
        for i in range(n):
            w0, w1, w2 = 0.0, 0.0, 0.0
            for b in range(turns):
                d = i * a + b
                w0 += directions[0, d] * moved[d]
                w1 += directions[1, d] * moved[d]
                w2 += directions[2, d] * moved[d]
            if body[0] == PRISMATIC:
                for j in range(i + 1, n + 2):
                    by_p[m, j, 0] += w0
                    by_p[m, j, 1] += w1
                    by_p[m, j, 2] += w2
                continue
            spin[m, 0] += w0
            spin[m, 1] += w1
            spin[m, 2] += w2
            for j in range(i + 1, n + 2):
                x = markers[j, 0] - pivots[i, 0]
                y = markers[j, 1] - pivots[i, 1]
                z = markers[j, 2] - pivots[i, 2]
                by_p[m, j, 0] += w1 * z - w2 * y
                by_p[m, j, 1] += w2 * x - w0 * z
                by_p[m, j, 2] += w0 * y - w1 * x
                if turns < a:
                    d = i * a + turns
                    for c in range(3):
                        by_p[m, j, c] += directions[c, d] * moved[d]
    return converged, stable, size, iterations, outside, positive
