"""Compiled: the equilibrium of one chain under one set of loads, as an engine calls it."""

from __future__ import annotations

import numpy as np
from numba import njit

from pliant.mechanics.efforts import DOMAIN_ROUNDING
from pliant_plugins.physics.compiled.chain_stiffness import new_factor
from pliant_plugins.physics.compiled.cholesky import factorise
from pliant_plugins.physics.compiled.descent import descend, relax
from pliant_plugins.physics.compiled.statics import new_frame


@njit(cache=True, nogil=True)
def _leaves_domain(boxes, signs, p, q, by_q):  # type: ignore[no-untyped-def]
    """Whether a joint is outside the box of its law, or its ∂τ/∂u is not negative definite."""
    n, a = q.shape
    block, factor = np.empty((a, a)), np.empty((a, a))
    for i in range(n):
        for k in range(len(signs)):
            if not boxes[i, 0, 0] - DOMAIN_ROUNDING <= p[k] <= boxes[i, 0, 1] + DOMAIN_ROUNDING:
                return True
            for b in range(a):
                u = signs[k] * q[i, b]
                if not boxes[i, 1 + b, 0] - DOMAIN_ROUNDING <= u <= boxes[i, 1 + b, 1] + DOMAIN_ROUNDING:
                    return True
        for b in range(a):
            for e in range(a):
                block[b, e] = -0.5 * (by_q[i, b, e] + by_q[i, e, b])
        if not factorise(block, 0.0, factor):
            return True
    return False


@njit(cache=True, nogil=True)
def settle(body, laws, boxes, loads, q, markers, options, patient):  # type: ignore[no-untyped-def]
    """Moves q (n, a) to a stable equilibrium and fills the markers (n + 2, 3) there.

    Args:
        body, laws, loads: see `descend`; boxes: `CompiledLaws.boxes`.
        patient: follow the overdamped motion from q where the direct way fails.

    Returns:
        converged, stable, largest residual, iterations, whether a law leaves its domain.
    """
    n, a = q.shape
    frame = new_frame(n, a, len(laws[3]))
    parts = new_factor(n, a, 3 + 3 * len(loads[8]))
    chain = (body, laws, loads)
    start = q.copy()
    converged, stable, size, iterations = descend(chain, q, frame, parts, options)
    if patient and not converged:
        q[:] = start
        converged, stable, size, more = relax(chain, q, frame, parts, options)
        iterations += more
    markers[: n + 1], markers[n + 1] = frame[0], frame[4][n]
    outside = _leaves_domain(boxes, laws[3], loads[0], q, frame[7])
    return converged, stable, size, iterations, outside
