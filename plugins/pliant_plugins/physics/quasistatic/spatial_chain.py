"""Compiled: balance, stiffness and differences of a chain of any joints, for the loop of `kernel`.

Coordinates stand in one line, (n·a,), joint by joint. Directions, moments and stiffness of the loads are those of
`compiled.statics`, efforts those of `joint_effort`. A body is kind, bases (N, 3, 3), axes, main, position, offsets,
rests, arms, masses, reach and the arrays of no loads at points and of no cords; a frame is a frame of
`compiled.statics`, the parts of a stiffness in `compiled.equilibrium`, and two places that hinges have more.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from pliant_plugins.physics.compiled.arrays import copy
from pliant_plugins.physics.compiled.equilibrium import ROUNDING, fill_dense
from pliant_plugins.physics.compiled.handles import apart, kept
from pliant_plugins.physics.compiled.statics import n_turns, place, sum_beyond
from pliant_plugins.physics.compiled.statics import stiffen as stiffen_by_loads
from pliant_plugins.physics.compiled.terms import has_past
from pliant_plugins.physics.quasistatic.joint_effort import by_the_past, effort, slopes, term_effort


@njit(cache=True, error_model="numpy")
def _placed(body, base):  # type: ignore[no-untyped-def]
    """Return a body for `compiled.statics` on the given base."""
    kind, _, axes, main, position, offsets, rests, arms, masses, reach, _ = body
    return kind, axes, main, position, base, offsets, rests, arms, masses, reach


@njit(cache=True, error_model="numpy")
def _loads(body, p, gravity, f, opposed, hung):  # type: ignore[no-untyped-def]
    """Return loads for `compiled.statics`."""
    bodies, rows, none = body[10]
    return p, gravity, f, opposed, hung, bodies, rows, rows, bodies, rows, rows, none


@njit(cache=True, error_model="numpy")
def _generalise(body, opposed, statics, load):  # type: ignore[no-untyped-def]
    """Fill load (n·a,) with the generalised forces of loads and end moment."""
    directions, moments, forces = statics[3], statics[10], statics[13]
    n, a = len(moments), len(body[2])
    turns = n_turns(body[0], a)
    for i in range(n):
        for b in range(a):
            d = i * a + b
            value = 0.0
            for c in range(3):
                value += directions[c, d] * (moments[i, c] if b < turns else forces[i, c])
            load[d] = value - opposed if b == body[3] else value


@njit(cache=True, error_model="numpy")
def balance(chain, now, q, memory, frame):  # type: ignore[no-untyped-def]
    """Fill the frame and the new memory at q; return the largest residual, infinite if one is not finite."""
    apart()
    model, laws, body, gravity = kept(chain)
    base, p, f, opposed, hung, t, dt = kept(now)
    before, old, new, states = kept(memory)
    statics, _, _, _, load, residual, parts, _ = kept(frame)
    placed, n, a = _placed(body, base), len(laws), len(body[2])
    place(placed, q.reshape((n, a)), statics)
    sum_beyond(placed, _loads(body, p, gravity, f, opposed, hung), statics)
    _generalise(body, opposed, statics, load)
    size = 0.0
    for i in range(n):
        effort(model, i, laws[i], q, before, dt, p, t, old, new, states, residual, parts)
        for d in range(i * a, i * a + a):
            residual[d] += load[d]
            if not np.isfinite(residual[d]):
                return np.inf
            size = max(size, abs(residual[d]))
    return size


@njit(cache=True, error_model="numpy")
def stiffen(chain, now, q, memory, frame, stiffness):  # type: ignore[no-untyped-def]
    """Fill the stiffness −∂R/∂q (n·a, n·a) at the q of the last balance; return whether it is symmetric."""
    apart()
    model, laws, body, gravity = kept(chain)
    base, p, f, opposed, hung, t, dt = kept(now)
    before, old, _, states = kept(memory)
    statics, factor, _, _, _, _, parts, scratch = kept(frame)
    n, a, by_q = len(laws), len(body[2]), statics[7]
    for i in range(n):
        slopes(model, i, q, before, dt, p, t, old, states, scratch, parts, by_q[i])
    loads = _loads(body, p, gravity, f, opposed, hung)
    skewness = stiffen_by_loads(_placed(body, base), loads, q.reshape((n, a)), statics, factor)
    fill_dense(factor, stiffness)
    largest = 0.0
    for d in range(n * a):
        largest = max(largest, abs(stiffness[d, d]))
    return skewness <= ROUNDING * largest


@njit(cache=True, error_model="numpy")
def misfit(chain, then, now, q, memory, past, frame, lines, spare):  # type: ignore[no-untyped-def]
    """Fill lines[1] with the change of the residual at q due to `then` and `past`; see `kernel`."""
    apart()
    model, gravity, p, f, opposed, hung, t = kept(then)
    before, old, _, states = kept(memory)
    statics, _, _, _, plain_load, residual, parts, _ = kept(frame)
    load, right = kept(lines)
    moved, scratch, other_parts = kept(spare)
    same, laws, body, same_gravity = kept(chain)
    base, same_p, same_f, same_opposed, same_hung, same_t, dt = kept(now)
    remembers = has_past(kept(same)[0])
    a = len(body[2])
    copy(plain_load, load)
    if (
        hung != same_hung
        or opposed != same_opposed
        or not _same(f, same_f)
        or not _same(gravity, same_gravity)
    ):
        sum_beyond(_placed(body, base), _loads(body, p, gravity, f, opposed, hung), statics)
        _generalise(body, opposed, statics, load)
    same_laws = True
    for k in range(len(p)):
        same_laws = same_laws and p[k] == same_p[k]
    for i in range(len(laws)):
        if not same_laws or not term_effort(
            model, i, q, before, dt, p, t, old, scratch, states, right, parts
        ):
            effort(model, i, laws[i], q, before, dt, p, t, old, scratch, states, right, other_parts)
        for d in range(i * a, i * a + a):
            right[d] += load[d] - residual[d]
        if remembers:
            was = (old, states, moved)
            by_the_past(same, i, q, before, dt, same_p, same_t, was, kept(past), scratch, parts, right)


@njit(cache=True, forceinline=True, error_model="numpy")
def _same(a, b):  # type: ignore[no-untyped-def]
    return a[0] == b[0] and a[1] == b[1] and a[2] == b[2]
