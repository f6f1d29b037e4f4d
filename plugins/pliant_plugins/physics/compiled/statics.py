"""Compiled: residual, stiffness and potential of a chain; equations and signs are those of `pliant.mechanics`.

Arguments are `Body.arrays`, `CompiledLaws.arrays` and `load_arrays`. A frame contains everything that depends on q, in
preallocated arrays; the stiffness is stored in the parts of `equilibrium`.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from pliant.mechanics.statics import SHORTEST_CORD_M
from pliant_plugins.physics.compiled.arrays import copy, copy_rows
from pliant_plugins.physics.compiled.efforts import efforts, law_potential

SPHERICAL, PRISMATIC, EXTENSIBLE = 1, 2, 3
# Below this angle the closed forms of rotations cancel; slopes of b and c cancel three times earlier.
SMALL_ANGLE = 0.1


@njit(cache=True, nogil=True)
def _coefficients(x):  # type: ignore[no-untyped-def]
    """Return a, b and c of R = 1 + a K + b K² and J = 1 + b K + c K² at θ² = x."""
    theta = np.sqrt(x)
    half = 0.5 * theta
    half_sinc = np.sin(half) / half if theta > 1e-12 else 1.0
    a, b = half_sinc * np.cos(half), 0.5 * half_sinc * half_sinc
    if theta < SMALL_ANGLE:
        c = 1 / 6 - x * (1 / 120 - x * (1 / 5040 - x / 362880))
    else:
        c = (1.0 - a) / x
    return a, b, c


@njit(cache=True, nogil=True)
def _skew_polynomial(v, x, first, second, out):  # type: ignore[no-untyped-def]
    """Fill out (3, 3) with 1 + first · [v]× + second · [v]×², with x = |v|²."""
    for i in range(3):
        for j in range(3):
            out[i, j] = second * v[i] * v[j]
        out[i, i] += 1.0 - second * x
    out[0, 1] -= first * v[2]
    out[0, 2] += first * v[1]
    out[1, 0] += first * v[2]
    out[1, 2] -= first * v[0]
    out[2, 0] -= first * v[1]
    out[2, 1] += first * v[0]


@njit(cache=True, nogil=True)
def left_jacobian_transpose_slope(v, g, out):  # type: ignore[no-untyped-def]
    """Fill out (3, 3) with ∂(J(v)ᵀ g)/∂v at fixed g (3,): rows are components of Jᵀg."""
    x = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    theta = np.sqrt(x)
    _, b, c = _coefficients(x)
    if theta < 3 * SMALL_ANGLE:
        db = -1 / 12 + x * (1 / 180 - x * (1 / 6720 - x * (1 / 453600 - x / 47900160)))
        dc = -1 / 60 + x * (1 / 1260 - x * (1 / 60480 - x * (1 / 4989600 - x / 622702080)))
    else:
        sine, cosine = np.sin(theta), np.cos(theta)
        db = (theta * sine - 2.0 * (1.0 - cosine)) / (x * x)
        dc = (theta * (1.0 - cosine) - 3.0 * (theta - sine)) / (x * x * theta)
    along = v[0] * g[0] + v[1] * g[1] + v[2] * g[2]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        turned = v[j] * g[k] - v[k] * g[j]
        outward = v[i] * along - x * g[i]
        for m in range(3):
            out[i, m] = c * (v[i] * g[m] - 2.0 * g[i] * v[m]) + (dc * outward - db * turned) * v[m]
        out[i, i] += c * along
        out[i, j] -= b * g[k]
        out[i, k] += b * g[j]


@njit(cache=True, nogil=True)
def new_frame(n, a, k):  # type: ignore[no-untyped-def]
    """Return arrays of a chain of n joints with a axes under k actuators.

    Origins and rotations of bodies, rest frames, directions, points, τ, ∂τ/∂p, ∂τ/∂u, Σ r Fᵀ about the joints,
    residual (n, a), moments about the joints, six small matrices, pivots of the joints, forces beyond them.
    """
    return (
        np.empty((n + 1, 3)),
        np.empty((n + 1, 3, 3)),
        np.empty((n, 3, 3)),
        np.empty((3, n * a)),
        np.empty((n + 1, 3)),
        np.empty((n, a)),
        np.empty((k, n, a)),
        np.empty((n, a, a)),
        np.empty((n, 3, 3)),
        np.empty((n, a)),
        np.empty((n, 3)),
        np.empty((6, 3, 3)),
        np.empty((n, 3)),
        np.empty((n, 3)),
    )


@njit(cache=True, nogil=True)
def n_turns(kind, a):  # type: ignore[no-untyped-def]
    """Return the number of a joint's leading coordinates of one kind: all a but the travel of an extensible one."""
    return a - 1 if kind == EXTENSIBLE else a


@njit(cache=True, nogil=True)
def _times(first, second, out):  # type: ignore[no-untyped-def]
    for i in range(3):
        for j in range(3):
            out[i, j] = first[i, 0] * second[0, j] + first[i, 1] * second[1, j] + first[i, 2] * second[2, j]


@njit(cache=True, nogil=True)
def _row(matrix, i, v):  # type: ignore[no-untyped-def]
    return matrix[i, 0] * v[0] + matrix[i, 1] * v[1] + matrix[i, 2] * v[2]


@njit(cache=True, nogil=True)
def place(body, q, frame):  # type: ignore[no-untyped-def]
    """Fill origins, rotations, rest frames, directions, points and pivots of the frame at q (n, a)."""
    kind, axes, _, position, rotation, offsets, rests, arms, _, _ = body
    origins, rotations, rest_frames, directions, points = frame[:5]
    pivots = frame[12]
    turn, jacobian, seen = frame[11][0], frame[11][1], frame[11][2]
    phi = frame[11][3, 0]
    n, a = q.shape
    turns = n_turns(kind, a)
    copy(position, origins[0])
    copy_rows(rotation, rotations[0])
    for i in range(n):
        rest = rest_frames[i]
        _times(rotations[i], rests[i], rest)
        phi[:] = 0.0
        for b in range(turns):
            phi[axes[b]] = q[i, b]
        for c in range(3):
            origins[i + 1, c] = origins[i, c] + _row(rotations[i], c, offsets[i])
            if kind == PRISMATIC:
                origins[i + 1, c] += _row(rest, c, phi)
            pivots[i, c] = origins[i + 1, c]
        if kind == PRISMATIC:
            copy_rows(rest, rotations[i + 1])
        else:
            x = phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2]
            first, second, third = _coefficients(x)
            _skew_polynomial(phi, x, first, second, turn)
            _times(rest, turn, rotations[i + 1])
            if kind in (SPHERICAL, EXTENSIBLE):
                _skew_polynomial(phi, x, second, third, jacobian)
                _times(rest, jacobian, seen)
                rest = seen
        for b in range(turns):
            for c in range(3):
                directions[c, i * a + b] = rest[c, axes[b]]
        if kind == EXTENSIBLE:
            for c in range(3):
                directions[c, i * a + turns] = rotations[i + 1, c, 0]
                origins[i + 1, c] += q[i, turns] * rotations[i + 1, c, 0]
        for c in range(3):
            points[i, c] = origins[i + 1, c] + _row(rotations[i + 1], c, arms[i])
    for c in range(3):
        points[n, c] = origins[n, c] + _row(rotations[n], c, arms[n])


@njit(cache=True, nogil=True)
def _point(frame, body, offset, out):  # type: ignore[no-untyped-def]
    for c in range(3):
        out[c] = frame[0][body, c] + _row(frame[1][body], c, offset)


@njit(cache=True, nogil=True)
def _pull(frame, loads, cord, point, force):  # type: ignore[no-untyped-def]
    """Fill where a cord acts and its force; return its length."""
    bodies, places, pulleys, tensions = loads[8:12]
    _point(frame, bodies[cord], places[cord], point)
    square = 0.0
    for c in range(3):
        force[c] = point[c] - pulleys[cord, c]
        square += force[c] * force[c]
    length = max(np.sqrt(square), SHORTEST_CORD_M)
    for c in range(3):
        force[c] *= -tensions[cord] / length
    return length


@njit(cache=True, nogil=True)
def _add(total, torsor, point, force):  # type: ignore[no-untyped-def]
    for c in range(3):
        total[c] += force[c]
        for d in range(3):
            torsor[c, d] += point[c] * force[d]


@njit(cache=True, nogil=True)
def sum_beyond(body, loads, frame):  # type: ignore[no-untyped-def]
    """Fill Σ r Fᵀ (n, 3, 3) about the pivots, moments (forces if prismatic) and forces (n, 3) of outer bodies."""
    kind, masses = body[0], body[8]
    gravity, tip_force, payload = loads[1], loads[2], loads[4]
    pivots, points, torsors, moments, forces = frame[12], frame[4], frame[8], frame[10], frame[13]
    sums = frame[11][2]
    total, force, point = frame[11][3, 0], frame[11][3, 1], frame[11][3, 2]
    n = len(torsors)
    total[:], sums[:] = 0.0, 0.0
    for i in range(n, -1, -1):
        mass = payload if i == n else masses[i]
        for c in range(3):
            force[c] = mass * gravity[c] + (tip_force[c] if i == n else 0.0)
        _add(total, sums, points[i], force)
        if i == n:
            continue
        for m in range(len(loads[5])):
            if loads[5][m] == i + 1:
                _point(frame, i + 1, loads[6][m], point)
                _add(total, sums, point, loads[7][m])
        for m in range(len(loads[8])):
            if loads[8][m] == i + 1:
                _pull(frame, loads, m, point, force)
                _add(total, sums, point, force)
        own = torsors[i]
        for c in range(3):
            for d in range(3):
                own[c, d] = sums[c, d] - pivots[i, c] * total[d]
        copy(total, forces[i])
        if kind == PRISMATIC:
            copy(total, moments[i])
        else:
            moments[i, 0] = own[1, 2] - own[2, 1]
            moments[i, 1] = own[2, 0] - own[0, 2]
            moments[i, 2] = own[0, 1] - own[1, 0]


@njit(cache=True, nogil=True)
def balance(body, laws, loads, q, frame):  # type: ignore[no-untyped-def]
    """Fill the frame and its residual at q (n, a); return its largest entry and its norm, infinite if not finite."""
    place(body, q, frame)
    sum_beyond(body, loads, frame)
    directions, tau, residual, moments, forces = frame[3], frame[5], frame[9], frame[10], frame[13]
    efforts(laws, q, loads[0], tau, frame[6], frame[7])
    n, a = q.shape
    turns = n_turns(body[0], a)
    largest, square = 0.0, 0.0
    for i in range(n):
        for b in range(a):
            d = i * a + b
            value = tau[i, b]
            for c in range(3):
                value += directions[c, d] * (moments[i, c] if b < turns else forces[i, c])
            if b == body[2]:
                value -= loads[3]
            residual[i, b] = value
            if not np.isfinite(value):
                return np.inf, np.inf
            largest = max(largest, abs(value))
            square += value * value
    return largest, np.sqrt(square)


@njit(cache=True, nogil=True)
def stiffen(body, loads, q, frame, parts):  # type: ignore[no-untyped-def]
    """Fill U, Y and the diagonal blocks of `equilibrium.new_factor` from a frame that `balance` filled.

    Returns the largest difference of ∂τ/∂u to its transpose: 0 where the laws derive from an energy.
    """
    kind, axes = body[0], body[1]
    rest_frames, directions, by_q = frame[2], frame[3], frame[7]
    torsors, moments, forces = frame[8], frame[10], frame[13]
    slope, phi, seen = frame[11][0], frame[11][3, 0], frame[11][3, 1]
    before, beyond, own_blocks = parts[0], parts[1], parts[3]
    n, a = q.shape
    turns = n_turns(kind, a)
    skewness = 0.0
    for i in range(n):
        own, block = torsors[i], own_blocks[i]
        trace = own[0, 0] + own[1, 1] + own[2, 2]
        for b in range(a):
            for c in range(3):
                before[i, b, c] = directions[c, i * a + b]
            for c in range(3):
                turned = _row(own, c, before[i, b]) - trace * before[i, b, c]
                beyond[i, b, c] = 0.0 if kind == PRISMATIC else -turned
        if turns < a:  # a travel t: before is 0, beyond is −t × F
            for c in range(3):
                d, e = (c + 1) % 3, (c + 2) % 3
                along = directions[d, i * a + turns], directions[e, i * a + turns]
                before[i, turns, c] = 0.0
                beyond[i, turns, c] = along[1] * forces[i, d] - along[0] * forces[i, e]
        for b in range(a):
            for e in range(a):
                block[b, e] = _dot(before[i, b], beyond[i, e])
        if kind in (SPHERICAL, EXTENSIBLE):
            phi[:] = 0.0
            for b in range(turns):
                phi[axes[b]] = q[i, b]
            for c in range(3):
                rest = rest_frames[i]
                seen[c] = rest[0, c] * moments[i, 0] + rest[1, c] * moments[i, 1] + rest[2, c] * moments[i, 2]
            left_jacobian_transpose_slope(phi, seen, slope)
            for b in range(turns):
                for e in range(turns):
                    block[b, e] -= slope[axes[b], axes[e]]
            if turns < a:  # the mean of both halves below is then the whole
                for e in range(turns):
                    block[turns, e] = block[e, turns]
        for b in range(a):
            for e in range(b):
                block[b, e] = block[e, b] = 0.5 * (block[b, e] + block[e, b])
                skewness = max(skewness, abs(by_q[i, b, e] - by_q[i, e, b]))
        for b in range(a):
            for e in range(a):
                block[b, e] -= by_q[i, b, e]
    for cord in range(len(loads[8])):
        _stiffen_by_cord(kind, loads, cord, frame, parts)
    return skewness


@njit(cache=True, nogil=True)
def _dot(first, second):  # type: ignore[no-untyped-def]
    return first[0] * second[0] + first[1] * second[1] + first[2] * second[2]


@njit(cache=True, nogil=True)
def _stiffen_by_cord(kind, loads, cord, frame, parts):  # type: ignore[no-untyped-def]
    """Add T/L Jᵀ (1 − d dᵀ) J of a cord's point, d its direction, L its length, as three rows of U and Y."""
    directions, pivots = frame[3], frame[12]
    before, beyond, own_blocks = parts[0], parts[1], parts[3]
    point, away = frame[11][4, 0], frame[11][4, 1]
    length = _pull(frame, loads, cord, point, away)
    tension, first = loads[11][cord], 3 + 3 * cord
    a = before.shape[1]
    turns = n_turns(kind, a)
    before[:, :, first : first + 3], beyond[:, :, first : first + 3] = 0.0, 0.0
    if tension == 0.0:
        return
    for c in range(3):
        away[c] /= -tension
    for i in range(loads[8][cord]):
        for b in range(a):
            direction, moved = before[i, b], before[i, b, first : first + 3]
            for c in range(3):
                d, e = (c + 1) % 3, (c + 2) % 3
                if kind == PRISMATIC:
                    moved[c] = direction[c]
                elif b == turns:
                    moved[c] = directions[c, i * a + b]
                else:
                    moved[c] = direction[d] * (point[e] - pivots[i, e])
                    moved[c] -= direction[e] * (point[d] - pivots[i, d])
            along = _dot(away, moved)
            for c in range(3):
                beyond[i, b, first + c] = tension / length * (moved[c] - along * away[c])
        for b in range(a):
            for e in range(a):
                own_blocks[i, b, e] += _dot(before[i, b, first:], beyond[i, e, first:])


@njit(cache=True, nogil=True)
def potential(body, laws, loads, q, frame):  # type: ignore[no-untyped-def]
    """Total potential in J at the q (n, a) at which the frame was filled by `balance` or `place`."""
    masses, main = body[8], body[2]
    p, gravity, tip_force, moment, payload = loads[:5]
    points = frame[4]
    point, force = frame[11][4, 0], frame[11][4, 1]
    n = len(q)
    energy = law_potential(laws, q, p)
    for i in range(n + 1):
        mass = payload if i == n else masses[i]
        for c in range(3):
            energy -= (mass * gravity[c] + (tip_force[c] if i == n else 0.0)) * points[i, c]
    for m in range(len(loads[5])):
        _point(frame, loads[5][m], loads[6][m], point)
        for c in range(3):
            energy -= loads[7][m, c] * point[c]
    for m in range(len(loads[8])):
        energy += loads[11][m] * _pull(frame, loads, m, point, force)
    for i in range(n):
        energy += moment * q[i, main]
    return energy
