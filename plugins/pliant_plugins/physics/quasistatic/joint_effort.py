"""Compiled: the effort with law terms of a joint with any number of coordinates and actuators, and its slopes.

    τ'_b = Π f_elastic · E_b(u − rest) + Π f_actuation · A_b(p, u) + Σ moment,      A(p, u) = τ(p, u) − E(u)

with E(u) = τ(0, u), τ(p, u) = Σ_k T_k law(p_k, T_kᵀ u) or law(a, u), and each term a function of one coordinate
(`LawTerm`). Laws are called by their addresses.

The handle of a model contains terms, laws, turns T (k, a, a), space, signs, whether a term has another role than
`moment`, drives (n, 3), and no actuation (k,). Laws are addresses, spans, parameters, `less_rest`, α and γ of
`JointLaw.unwrap`. Parts of an effort are the input of `slopes` and `by_the_past`: E_b (n, a), A_b (n, a), f_elastic
∂E/∂u and f_actuation ∂A/∂u (n, a, a), and Σ rest (n, a).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from pliant.mechanics.terms import STEP as SLOPE_STEP
from pliant.records.design import Array
from pliant_plugins.physics.compiled.arrays import copy, copy_rows
from pliant_plugins.physics.compiled.efforts import call_law, call_wide_law
from pliant_plugins.physics.compiled.handles import apart, kept
from pliant_plugins.physics.compiled.terms import combine, joint_net_input
from pliant_plugins.physics.quasistatic.small_systems import solve

# Newton of a law behind a spring: steps, the shortest share of one, and the turn (rad) to which it is known.
MOST_STEPS = 40
LEAST_SHARE = 1.0 / 64.0
PRECISION_RAD = 1e-13


def new_space(a: int, m: int) -> tuple[Array, Array, Array]:
    """Return work arrays of a call: rows (12, a), slopes by m actuations (a·m,), blocks (5, a, a)."""
    return np.zeros((12, a)), np.zeros(a * m), np.zeros((5, a, a))


@njit(cache=True, error_model="numpy")
def _law(model, law, p, first, count, v, tau, tau_u):  # type: ignore[no-untyped-def]
    """Fill τ (a,) and ∂τ/∂v of a law without its wrappers."""
    apart()
    _, (addresses, spans, parameters, less, _), _, (rows, by_p, blocks), _, _, _, _ = kept(model)
    c = parameters[spans[law, 0] : spans[law, 1]]
    if count > 1:
        call_wide_law(addresses[law], p[first : first + count], v, c, tau, by_p, tau_u)
        return
    call_law(addresses[law], p[first], v, c, tau, by_p, tau_u)
    share, a = less[law], len(v)
    if share == 0.0:
        return
    if p[first] == 0.0:  # it is its own rest
        for b in range(a):
            tau[b] *= 1.0 - share
            for e in range(a):
                tau_u[b, e] *= 1.0 - share
        return
    rest, rest_u = rows[0], blocks[0]
    call_law(addresses[law], 0.0, v, c, rest, by_p, rest_u)
    for b in range(a):
        tau[b] -= share * rest[b]
        for e in range(a):
            tau_u[b, e] -= share * rest_u[b, e]


@njit(cache=True, error_model="numpy")
def _law_behind(model, law, p, first, count, u, tau, tau_u):  # type: ignore[no-untyped-def]
    """Fill τ (a,) and ∂τ/∂u of a law in its place: τ = law(p, v), v = α u + γ τ."""
    apart()
    _, laws, _, (rows, _, _), _, _, _, _ = kept(model)
    stretch, give = laws[4][law, 0], laws[4][law, 1]
    v, a = rows[1], len(u)
    for b in range(a):
        v[b] = stretch * u[b]
    _law(model, law, p, first, count, v, tau, tau_u)
    if give != 0.0:
        _divide(model, law, p, first, count, u, tau, tau_u)
    elif stretch != 1.0:
        for b in range(a):
            for e in range(a):
                tau_u[b, e] *= stretch


@njit(cache=True, error_model="numpy")
def _divide(model, law, p, first, count, u, tau, tau_u):  # type: ignore[no-untyped-def]
    """Solve for v by damped Newton from v = α u; see `_law_behind`."""
    apart()
    _, laws, _, (rows, _, blocks), _, _, _, _ = kept(model)
    stretch, give = laws[4][law, 0], laws[4][law, 1]
    v, ahead, step, there = rows[1], rows[2], rows[3], rows[4]
    matrix, there_u, a = blocks[1], blocks[2], len(u)
    share, size = 1.0, 0.0
    for b in range(a):
        size = max(size, abs(v[b] - stretch * u[b] - give * tau[b]))
    for _ in range(MOST_STEPS):
        for b in range(a):
            step[b] = v[b] - stretch * u[b] - give * tau[b]
            for e in range(a):
                matrix[b, e] = (1.0 if b == e else 0.0) - give * tau_u[b, e]
        solve(matrix, step)
        longest = 0.0
        for b in range(a):
            longest = max(longest, abs(share * step[b]))
            ahead[b] = v[b] - share * step[b]
        if not longest > PRECISION_RAD:
            break
        _law(model, law, p, first, count, ahead, there, there_u)
        left = 0.0
        for b in range(a):
            left = max(left, abs(ahead[b] - stretch * u[b] - give * there[b]))
        if left < size or share <= LEAST_SHARE:
            copy(ahead, v)
            copy(there, tau)
            copy_rows(there_u, tau_u)
            size, share = left, 1.0
        else:
            share *= 0.5
    for e in range(a):  # column by column (1 − γ ∂τ/∂v)⁻¹ ∂τ/∂v
        for b in range(a):
            step[b] = tau_u[b, e]
            for d in range(a):
                matrix[b, d] = (1.0 if b == d else 0.0) - give * tau_u[b, d]
        solve(matrix, step)
        for b in range(a):
            there_u[b, e] = stretch * step[b]
    copy_rows(there_u, tau_u)


@njit(cache=True, error_model="numpy")
def joint_laws(model, joint, law, p, u, tau, tau_u):  # type: ignore[no-untyped-def]
    """Fill τ (a,) and ∂τ/∂u (a, a) of a joint without terms, p (k,) being the values of all actuators."""
    apart()
    _, _, turns, (rows, _, blocks), _, _, drives, _ = kept(model)
    first, last, count = drives[joint, 0], drives[joint, 1], drives[joint, 2]
    if count > 1:
        _law_behind(model, law, p, first, count, u, tau, tau_u)
        return
    own, own_u, half, turned, a = rows[5], blocks[3], blocks[4], rows[6], len(u)
    for b in range(a):
        tau[b] = 0.0
        for e in range(a):
            tau_u[b, e] = 0.0
    for k in range(first, last):
        turn = turns[k]
        for b in range(a):
            turned[b] = 0.0
            for e in range(a):
                turned[b] += turn[e, b] * u[e]
        _law_behind(model, law, p, k, 1, turned, own, own_u)
        for b in range(a):
            for e in range(a):
                tau[b] += turn[b, e] * own[e]
                half[b, e] = 0.0
                for d in range(a):
                    half[b, e] += turn[b, d] * own_u[d, e]
        for b in range(a):
            for e in range(a):
                for d in range(a):
                    tau_u[b, e] += half[b, d] * turn[e, d]


@njit(cache=True, error_model="numpy")
def effort(model, joint, law, q, before, dt, p, t, old, new, states, tau, parts):  # type: ignore[no-untyped-def]
    """Fill τ' of a joint's coordinates in tau (n·a,), their new memory, and its parts."""
    apart()
    spring, driven, spring_u, driven_u, moved_by = parts
    terms, _, _, (rows, _, _), signs, split, drives, none = kept(model)
    u, shifted, moment, elastic, actuation, a = rows[7], rows[8], rows[9], rows[10], rows[11], spring.shape[1]
    net, moved = joint_net_input(signs, drives, joint, p), False
    for b in range(a):
        d = joint * a + b
        u[b] = q[d]
        moment[b], elastic[b], actuation[b], rest = combine(
            terms, joint, q[d], before[d], dt, net, t, old, d * states, new, d * states
        )
        moved_by[joint, b] = rest
        shifted[b] = q[d] - rest
        moved = moved or rest != 0.0
    own, own_u = spring[joint], spring_u[joint]
    more, more_u = driven[joint], driven_u[joint]
    if not split:
        joint_laws(model, joint, law, p, u, own, own_u)
    else:
        joint_laws(model, joint, law, p, u, more, more_u)
        joint_laws(model, joint, law, none, u, own, own_u)
        for b in range(a):
            more[b] -= own[b]
            for e in range(a):
                more_u[b, e] -= own_u[b, e]
        if moved:
            joint_laws(model, joint, law, none, shifted, own, own_u)
    for b in range(a):
        tau[joint * a + b] = moment[b] + elastic[b] * own[b]
        for e in range(a):
            own_u[b, e] *= elastic[b]
        if split:
            tau[joint * a + b] += actuation[b] * more[b]
            for e in range(a):
                more_u[b, e] *= actuation[b]


@njit(cache=True, error_model="numpy")
def term_effort(model, joint, q, before, dt, p, t, old, new, states, tau, parts):  # type: ignore[no-untyped-def]
    """Fill τ' as `effort`, of other terms at actuations and coordinates with known parts.

    Returns whether it could: no rest has moved, so that laws need not be called again. Parts stay as they are.
    """
    apart()
    spring, driven, _, _, moved_by = parts
    terms, _, _, _, signs, split, drives, _ = kept(model)
    a, net = spring.shape[1], joint_net_input(signs, drives, joint, p)
    for b in range(a):
        d = joint * a + b
        moment, elastic, actuation, rest = combine(
            terms, joint, q[d], before[d], dt, net, t, old, d * states, new, d * states
        )
        if rest != moved_by[joint, b]:
            return False
        tau[d] = moment + elastic * spring[joint, b]
        if split:
            tau[d] += actuation * driven[joint, b]
    return True


@njit(cache=True, error_model="numpy")
def slopes(model, joint, q, before, dt, p, t, old, states, scratch, parts, tau_u):  # type: ignore[no-untyped-def]
    """Fill ∂τ'/∂u (a, a) of a joint: laws by their slopes, terms by central differences."""
    apart()
    spring, driven, spring_u, driven_u, _ = parts
    terms, _, _, _, signs, split, drives, _ = kept(model)
    h, a = SLOPE_STEP, spring.shape[1]
    for b in range(a):
        for e in range(a):
            tau_u[b, e] = spring_u[joint, b, e]
            if split:
                tau_u[b, e] += driven_u[joint, b, e]
    if not len(terms[0]):
        return
    net = joint_net_input(signs, drives, joint, p)
    for e in range(a):
        d = joint * a + e
        at, u = d * states, q[d]
        m1, e1, a1, r1 = combine(terms, joint, u + h, before[d], dt, net, t, old, at, scratch, 0)
        m0, e0, a0, r0 = combine(terms, joint, u - h, before[d], dt, net, t, old, at, scratch, 0)
        own = (m1 - m0) + (e1 - e0) * spring[joint, e]
        if split:
            own += (a1 - a0) * driven[joint, e]
        tau_u[e, e] += own / (2.0 * h)
        if r1 != r0:
            for b in range(a):
                tau_u[b, e] -= spring_u[joint, b, e] * (r1 - r0) / (2.0 * h)


@njit(cache=True, error_model="numpy")
def by_the_past(model, joint, q, before, dt, p, t, memory, changes, scratch, parts, change):  # type: ignore[no-untyped-def]
    """Add to `change` (n·a,) the change of τ' of a joint with its coordinates and memory before the step.

    By central differences as small as those of `slopes`, for the reason that `hinge.by_the_past` gives.

    Args:
        memory: old, how many numbers each coordinate has in it, space for as many.
        changes: of the coordinates before, and of `old`.
    """
    apart()
    old, states, moved = memory
    before_v, old_v = changes
    spring, driven, spring_u, _, _ = parts
    terms, _, _, _, signs, split, drives, _ = kept(model)
    a, net = spring.shape[1], joint_net_input(signs, drives, joint, p)
    for e in range(a):
        d = joint * a + e
        at, share = d * states, 1.0
        if abs(before_v[d]) > SLOPE_STEP:
            share = SLOPE_STEP / abs(before_v[d])
        far = share * before_v[d]
        for s in range(states):
            moved[s] = old[at + s] + share * old_v[at + s]
        m1, e1, a1, r1 = combine(terms, joint, q[d], before[d] + far, dt, net, t, moved, 0, scratch, 0)
        for s in range(states):
            moved[s] = old[at + s] - share * old_v[at + s]
        m0, e0, a0, r0 = combine(terms, joint, q[d], before[d] - far, dt, net, t, moved, 0, scratch, 0)
        own = (m1 - m0) + (e1 - e0) * spring[joint, e]
        if split:
            own += (a1 - a0) * driven[joint, e]
        change[d] += own / (2.0 * share)
        if r1 != r0:
            for b in range(a):
                change[joint * a + b] -= spring_u[joint, b, e] * (r1 - r0) / (2.0 * share)
