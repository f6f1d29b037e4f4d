"""Compiled: pieces of the loop of a hinge chain: effort of a joint, pose and loads.

Frames are turned so that every joint is a hinge about its own third axis. 3 × 3 products are written in scalars: the
compiler keeps these in registers.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from pliant.mechanics.terms import STEP as SLOPE_STEP
from pliant_plugins.physics.compiled.efforts import call_wide_law
from pliant_plugins.physics.compiled.terms import combine, joint_net_input

# Newton of a law behind a spring: steps, the shortest share of one, and the turn (rad) to which it is known.
MOST_STEPS = 40
LEAST_SHARE = 1.0 / 64.0
PRECISION_RAD = 1e-13


@njit(cache=True, forceinline=True, error_model="numpy")
def law_at(cells, grid, size, law, p, u):  # type: ignore[no-untyped-def]
    """Return τ and ∂τ/∂u of a tabulated law: bicubic inside the table, straight on outside."""
    rows, columns = size[0], size[1]
    s, r = (p - grid[law, 0]) / grid[law, 1], (u - grid[law, 2]) / grid[law, 3]
    i = min(max(int(np.floor(s)), 0), rows - 1)
    j = min(max(int(np.floor(r)), 0), columns - 1)
    x, y = min(max(s - i, 0.0), 1.0), min(max(r - j, 0.0), 1.0)
    first = 16 * ((law * rows + i) * columns + j)
    value = in_p = in_u = 0.0
    for a in range(3, -1, -1):
        row = 0.0
        slope = 0.0
        for b in range(3, -1, -1):
            slope = slope * y + row
            row = row * y + cells[np.uintp(first + 4 * a + b)]
        in_p = in_p * x + value
        value = value * x + row
        in_u = in_u * x + slope
    value += in_p * (s - i - x) + in_u * (r - j - y)
    return value, in_u / grid[law, 3]


@njit(cache=True, error_model="numpy")
def wide_law_at(wide, law, a, u):  # type: ignore[no-untyped-def]
    """Return τ and ∂τ/∂u of a law of actuations a (m,), called by address: τ = law(a, v), v = α u + γ τ."""
    addresses, spans, parameters, around, _, at, value, by_a, by_u = wide
    c = parameters[spans[law, 0] : spans[law, 1]]
    stretch, give = around[law, 0], around[law, 1]
    at[0] = v = stretch * u
    call_wide_law(addresses[law], a, at, c, value, by_a, by_u)
    if give == 0.0:
        return value[0], stretch * by_u[0, 0]
    tau, tau_v, share = value[0], by_u[0, 0], 1.0
    missing = -give * tau
    for _ in range(MOST_STEPS):
        step = share * missing / (1.0 - give * tau_v)
        if not abs(step) > PRECISION_RAD:
            break
        at[0] = v - step
        call_wide_law(addresses[law], a, at, c, value, by_a, by_u)
        left = at[0] - stretch * u - give * value[0]
        if abs(left) < abs(missing) or share <= LEAST_SHARE:
            v, tau, tau_v, missing, share = at[0], value[0], by_u[0, 0], left, 1.0
        else:
            share *= 0.5
    return tau, stretch * tau_v / (1.0 - give * tau_v)


@njit(cache=True, forceinline=True, error_model="numpy")
def effort(model, joint, law, u, before, dt, p, t, old, old_at, new, new_at):  # type: ignore[no-untyped-def]
    """Return τ' of one joint at angle u and the input of `slope`; write its new memory.

    Where all terms are moments the law is not split into its elastic and its actuation part.
    """
    terms, cells, grid, size, signs, split, drives, wide = model
    net = joint_net_input(signs, drives, joint, p)
    moment, elastic, actuation, rest = combine(terms, joint, u, before, dt, net, t, old, old_at, new, new_at)
    spring = driven = spring_u = driven_u = 0.0
    first, last = drives[joint, 0], drives[joint, 1]
    if drives[joint, 2] > 1:
        spring, spring_u = wide_law_at(wide, law, p[first:last], u)
        if split:
            none = wide[4][: last - first]
            straight, straight_u = wide_law_at(wide, law, none, u)
            driven, driven_u = spring - straight, spring_u - straight_u
            spring, spring_u = straight, straight_u
            if rest != 0.0:
                spring, spring_u = wide_law_at(wide, law, none, u - rest)
        last = first
    for k in range(first, last):
        s = signs[k]
        own, own_u = law_at(cells, grid, size, law, p[k], s * u)
        if split:
            straight, straight_u = law_at(cells, grid, size, law, 0.0, s * u)
            driven += s * (own - straight)
            driven_u += s * s * (own_u - straight_u)
            own, own_u = straight, straight_u
            if rest != 0.0:
                own, own_u = law_at(cells, grid, size, law, 0.0, s * (u - rest))
        spring += s * own
        spring_u += s * s * own_u
    return moment + actuation * driven + elastic * spring, (
        spring,
        driven,
        elastic * spring_u,
        actuation * driven_u,
    )


@njit(cache=True, forceinline=True, error_model="numpy")
def slope(model, joint, u, before, dt, p, t, old, old_at, scratch, parts):  # type: ignore[no-untyped-def]
    """Return ∂τ'/∂u of one joint: laws by the slopes of their tables, terms by central differences."""
    spring, driven, spring_u, driven_u = parts
    terms, h = model[0], SLOPE_STEP
    if not len(terms[0]):
        return spring_u
    net = joint_net_input(model[4], model[6], joint, p)
    m1, e1, a1, r1 = combine(terms, joint, u + h, before, dt, net, t, old, old_at, scratch, 0)
    m0, e0, a0, r0 = combine(terms, joint, u - h, before, dt, net, t, old, old_at, scratch, 0)
    of_terms = (m1 - m0) + (e1 - e0) * spring + (a1 - a0) * driven - spring_u * (r1 - r0)
    return of_terms / (2.0 * h) + spring_u + driven_u


@njit(cache=True, forceinline=True, error_model="numpy")
def by_the_past(model, joint, u, before, dt, p, t, memory, changes, scratch, parts):  # type: ignore[no-untyped-def]
    """Change of τ' of one joint with small changes of its angle and memory before the step, by central differences.

    These are as small as those of `slope`: a change of the past that grows the rate beyond what the slope sees would
    be larger after every step of a hold.

    Args:
        memory: old, where the joint's begins, how many numbers it has, space for as many.
        changes: of the angle before, and of `old`.
    """
    old, old_at, states, moved = memory
    before_v, old_v = changes
    spring, driven, spring_u, _ = parts
    net = joint_net_input(model[4], model[6], joint, p)
    share = 1.0
    if abs(before_v) > SLOPE_STEP:
        share = SLOPE_STEP / abs(before_v)
    for s in range(states):
        moved[s] = old[old_at + s] + share * old_v[old_at + s]
    m1, e1, a1, r1 = combine(model[0], joint, u, before + share * before_v, dt, net, t, moved, 0, scratch, 0)
    for s in range(states):
        moved[s] = old[old_at + s] - share * old_v[old_at + s]
    m0, e0, a0, r0 = combine(model[0], joint, u, before - share * before_v, dt, net, t, moved, 0, scratch, 0)
    of_terms = (m1 - m0) + (e1 - e0) * spring + (a1 - a0) * driven - spring_u * (r1 - r0)
    return of_terms / (2.0 * share)


@njit(cache=True, forceinline=True, error_model="numpy")
def pose(q, base, body, axes, origins, points):  # type: ignore[no-untyped-def]
    """Fill axes (n, 3), origins (n, 3) and points (n + 1, 3) of the moving bodies and the tip."""
    position, _, offsets, rests, straight, arms, _ = body
    n = len(q)
    x, y, z = position[0], position[1], position[2]
    xx, xy, xz = base[0, 0], base[0, 1], base[0, 2]
    yx, yy, yz = base[1, 0], base[1, 1], base[1, 2]
    zx, zy, zz = base[2, 0], base[2, 1], base[2, 2]
    for i in range(n):
        a, b, c = offsets[i, 0], offsets[i, 1], offsets[i, 2]
        x, y, z = x + xx * a + xy * b + xz * c, y + yx * a + yy * b + yz * c, z + zx * a + zy * b + zz * c
        if not straight[i]:
            rest = rests[i]
            a, b, c = rest[0, 0], rest[1, 0], rest[2, 0]
            x0, y0, z0 = xx * a + xy * b + xz * c, yx * a + yy * b + yz * c, zx * a + zy * b + zz * c
            a, b, c = rest[0, 1], rest[1, 1], rest[2, 1]
            x1, y1, z1 = xx * a + xy * b + xz * c, yx * a + yy * b + yz * c, zx * a + zy * b + zz * c
            a, b, c = rest[0, 2], rest[1, 2], rest[2, 2]
            x2, y2, z2 = xx * a + xy * b + xz * c, yx * a + yy * b + yz * c, zx * a + zy * b + zz * c
            xx, xy, xz, yx, yy, yz, zx, zy, zz = x0, x1, x2, y0, y1, y2, z0, z1, z2
        cosine, sine = np.cos(q[i]), np.sin(q[i])
        xx, xy = cosine * xx + sine * xy, cosine * xy - sine * xx
        yx, yy = cosine * yx + sine * yy, cosine * yy - sine * yx
        zx, zy = cosine * zx + sine * zy, cosine * zy - sine * zx
        axes[i, 0], axes[i, 1], axes[i, 2] = xz, yz, zz
        origins[i, 0], origins[i, 1], origins[i, 2] = x, y, z
        a, b, c = arms[i, 0], arms[i, 1], arms[i, 2]
        points[i, 0] = x + xx * a + xy * b + xz * c
        points[i, 1] = y + yx * a + yy * b + yz * c
        points[i, 2] = z + zx * a + zy * b + zz * c
    a, b, c = arms[n, 0], arms[n, 1], arms[n, 2]
    points[n, 0] = x + xx * a + xy * b + xz * c
    points[n, 1] = y + yx * a + yy * b + yz * c
    points[n, 2] = z + zx * a + zy * b + zz * c


@njit(cache=True, forceinline=True, error_model="numpy")
def weigh(axes, origins, points, masses, payload, gravity, force, load, turned):  # type: ignore[no-untyped-def]
    """Fill the generalised loads (n,), and `turned` (n, 3), whose products with axes are their derivatives.

    With T = Σ (x − o) Fᵀ of the points beyond joint i: load a · ax(T), turned (T − tr T) a.
    """
    n = len(load)
    tx = ty = tz = xx = xy = xz = yx = yy = yz = zx = zy = zz = 0.0
    for i in range(n, -1, -1):
        mass = payload if i == n else masses[i]
        fx, fy, fz = mass * gravity[0], mass * gravity[1], mass * gravity[2]
        if i == n:
            fx, fy, fz = fx + force[0], fy + force[1], fz + force[2]
        tx, ty, tz = tx + fx, ty + fy, tz + fz
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        xx, xy, xz = xx + x * fx, xy + x * fy, xz + x * fz
        yx, yy, yz = yx + y * fx, yy + y * fy, yz + y * fz
        zx, zy, zz = zx + z * fx, zy + z * fy, zz + z * fz
        if i == n:
            continue
        x, y, z = origins[i, 0], origins[i, 1], origins[i, 2]
        a, b, c = axes[i, 0], axes[i, 1], axes[i, 2]
        d, e, f = xx - x * tx, yy - y * ty, zz - z * tz
        txy, txz, tyz = xy - x * ty, xz - x * tz, yz - y * tz
        tyx, tzx, tzy = yx - y * tx, zx - z * tx, zy - z * ty
        load[i] = a * (tyz - tzy) + b * (tzx - txz) + c * (txy - tyx)
        turned[i, 0] = txy * b + txz * c - (e + f) * a
        turned[i, 1] = tyx * a + tyz * c - (d + f) * b
        turned[i, 2] = tzx * a + tzy * b - (d + e) * c
