"""Compiled: balance, stiffness and differences of a chain of hinges, for the loop of `kernel`.

Joint by joint i

    R_i(q) = τ'_i(q_i) − M + a_i · Σ_{k ≥ i} (x_k − o_i) × F_k

with τ' the effort with law terms (`LawTerm`), M the end moment, a_i and o_i axis and origin of joint i, x_k and F_k the
points beyond it and the forces on them.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from pliant_plugins.physics.compiled.arrays import copy
from pliant_plugins.physics.compiled.handles import apart, kept
from pliant_plugins.physics.quasistatic.hinge import by_the_past, effort, pose, slope, weigh


@njit(cache=True, error_model="numpy")
def balance(chain, now, q, memory, frame):  # type: ignore[no-untyped-def]
    """Fill the frame and the new memory at q; return the largest residual, infinite if one is not finite."""
    apart()
    model_handle, laws, body, gravity = kept(chain)
    model = kept(model_handle)
    base, p, f, opposed, hung, t, dt = kept(now)
    before, old, new, states = kept(memory)
    axes, origins, points, turned, load, residual, parts, _ = kept(frame)
    pose(q, base, body, axes, origins, points)
    weigh(axes, origins, points, body[6], hung, gravity, f, load, turned)
    size = 0.0
    for i in range(len(q)):
        at = i * states
        tau, part = effort(model, i, laws[i], q[i], before[i], dt, p, t, old, at, new, at)
        parts[i, 0], parts[i, 1], parts[i, 2], parts[i, 3] = part
        residual[i] = tau - opposed + load[i]
        if not np.isfinite(residual[i]):
            return np.inf
        size = max(size, abs(residual[i]))
    return size


@njit(cache=True, error_model="numpy")
def stiffen(chain, now, q, memory, frame, stiffness):  # type: ignore[no-untyped-def]
    """Fill the stiffness −∂R/∂q (n, n) at the q of the last balance; return True: it is symmetric."""
    apart()
    model = kept(kept(chain)[0])
    _, p, _, _, _, t, dt = kept(now)
    before, old, _, states = kept(memory)
    axes, _, _, turned, _, _, parts, scratch = kept(frame)
    for i in range(len(q)):
        x, y, z = turned[i, 0], turned[i, 1], turned[i, 2]
        for h in range(i + 1):
            value = -(axes[h, 0] * x + axes[h, 1] * y + axes[h, 2] * z)
            stiffness[h, i] = value
            stiffness[i, h] = value
        part = (parts[i, 0], parts[i, 1], parts[i, 2], parts[i, 3])
        stiffness[i, i] -= slope(model, i, q[i], before[i], dt, p, t, old, i * states, scratch, part)
    return True


@njit(cache=True, error_model="numpy")
def misfit(chain, then, now, q, memory, past, frame, lines, spare):  # type: ignore[no-untyped-def]
    """Fill lines[1] with the change of the residual at q due to `then` and `past`; see `kernel`."""
    apart()
    model_handle, gravity, p, f, opposed, hung, t = kept(then)
    before, old, _, states = kept(memory)
    before_v, old_v = kept(past)
    axes, origins, points, _, plain_load, residual, parts, _ = kept(frame)
    load, right = kept(lines)
    moved, scratch, turned = kept(spare)
    same_handle, laws, body, same_gravity = kept(chain)
    model, same = kept(model_handle), kept(same_handle)
    _, same_p, same_f, _, same_hung, same_t, dt = kept(now)
    copy(plain_load, load)
    if hung != same_hung or not _same(f, same_f) or not _same(gravity, same_gravity):
        weigh(axes, origins, points, body[6], hung, gravity, f, load, turned)
    for i in range(len(q)):
        at = i * states
        tau, _ = effort(model, i, laws[i], q[i], before[i], dt, p, t, old, at, scratch, 0)
        right[i] = tau - opposed + load[i] - residual[i]
        if len(same[0][0]):
            part = (parts[i, 0], parts[i, 1], parts[i, 2], parts[i, 3])
            was, change = (old, at, states, moved), (before_v[i], old_v)
            right[i] += by_the_past(same, i, q[i], before[i], dt, same_p, same_t, was, change, scratch, part)


@njit(cache=True, forceinline=True, error_model="numpy")
def _same(a, b):  # type: ignore[no-untyped-def]
    return a[0] == b[0] and a[1] == b[1] and a[2] == b[2]
