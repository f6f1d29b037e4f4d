"""Compiled: a hinge chain through histories, one equilibrium after another, with derivatives.

At each step Newton's method solves, joint by joint i,

    R_i(q) = τ'_i(q_i) − M + a_i · Σ_{k ≥ i} (x_k − o_i) × F_k = 0

with τ' the effort with law terms (`LawTerm`), M the end moment, a_i and o_i axis and origin of joint i, x_k and
F_k the points beyond it and the forces on them. Derivatives follow by the implicit function theorem: with a
small change δ of inputs, parameters and past, K dq = R(q; δ) − R(q), K = −∂R/∂q, and memories change by what
the step makes of the changed past at q + dq. Everything is plain loops over small arrays.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numba import cfunc, njit, types
from numba.core.errors import NumbaExperimentalFeatureWarning

# Function pointers keep one compiled kernel for all effects; numba calls them experimental at every compile.
warnings.filterwarnings("ignore", category=NumbaExperimentalFeatureWarning)

_F, _A = types.float64, types.float64[::1]
TERM_SIGNATURE = _F(_F, _F, _F, _F, _F, _A, _A, _A)
MAX_TERMS = 16
ROLES = ("moment", "elastic", "actuation", "rest")
SLOPE_STEP = 1e-6
RAMP_STEPS = 4
MAX_HALVINGS = 8
# Pseudo-transient continuation: iterations, and the turn of a joint that its first step aims at.
RELAX_ITERATIONS = 300
RELAX_TURN = 0.05
# A joint that has turned so far (rad) has no equilibrium in reach.
MOST_TURNED = 2.0 * np.pi


def _nothing(angle: float, rate: float, dt: float, p: float, t: float, old: Any, new: Any, c: Any) -> float:
    return 0.0


NOTHING = cfunc(TERM_SIGNATURE, cache=True)(_nothing)


@njit(cache=True, inline="always")
def _law(table, grid, law, p, u):  # type: ignore[no-untyped-def]
    """τ and ∂τ/∂u of a tabulated law: bicubic inside the table, straight on outside."""
    s, r = (p - grid[law, 0]) / grid[law, 1], (u - grid[law, 2]) / grid[law, 3]
    i = min(max(int(np.floor(s)), 0), table.shape[1] - 1)
    j = min(max(int(np.floor(r)), 0), table.shape[2] - 1)
    x, y = min(max(s - i, 0.0), 1.0), min(max(r - j, 0.0), 1.0)
    value = in_p = in_u = 0.0
    for a in range(3, -1, -1):
        row = 0.0
        slope = 0.0
        for b in range(3, -1, -1):
            slope = slope * y + row
            row = row * y + table[law, i, j, a, b]
        in_p = in_p * x + value
        value = value * x + row
        in_u = in_u * x + slope
    value += in_p * (s - i - x) + in_u * (r - j - y)
    return value, in_u / grid[law, 3]


@njit(cache=True, inline="always")
def _combine(functions, terms, parameters, u, before, dt, net, t, old, new):  # type: ignore[no-untyped-def]
    """(Σ moment, Π elastic, Π actuation, Σ rest) of one joint at angle u; `new` becomes its memory."""
    rate = (u - before) / dt if 0.0 < dt < np.inf else 0.0
    moment, elastic, actuation, rest = 0.0, 1.0, 1.0, 0.0
    for k in range(terms.shape[0]):
        c = parameters[terms[k, 1] : terms[k, 2]]
        o, w = old[terms[k, 3] : terms[k, 4]], new[terms[k, 3] : terms[k, 4]]
        value = functions[k](u, rate, dt, net, t, o, w, c)
        if terms[k, 0] == 0:
            moment += value
        elif terms[k, 0] == 1:
            elastic *= value
        elif terms[k, 0] == 2:
            actuation *= value
        else:
            rest += value
    return moment, elastic, actuation, rest


@njit(cache=True, inline="always")
def _effort(model, joint, law, u, before, dt, p, t, old, new):  # type: ignore[no-untyped-def]
    """τ' and ∂τ'/∂u of one joint at angle u; `new` becomes its memory.

    Slopes of laws are those of their tables, slopes of terms central differences.
    """
    functions, terms, numbers, table, grid, signs = model
    parameters = numbers[joint]
    net = 0.0
    for k in range(len(signs)):
        net += signs[k] * p[k]
    moment, elastic, actuation, rest = 0.0, 1.0, 1.0, 0.0
    d_moment = d_elastic = d_actuation = d_rest = 0.0
    if terms.shape[0]:
        h = SLOPE_STEP
        m1, e1, a1, r1 = _combine(functions, terms, parameters, u + h, before, dt, net, t, old, new)
        m0, e0, a0, r0 = _combine(functions, terms, parameters, u - h, before, dt, net, t, old, new)
        d_moment, d_elastic = (m1 - m0) / (2 * h), (e1 - e0) / (2 * h)
        d_actuation, d_rest = (a1 - a0) / (2 * h), (r1 - r0) / (2 * h)
        moment, elastic, actuation, rest = _combine(
            functions, terms, parameters, u, before, dt, net, t, old, new
        )
    tau, slope = moment, d_moment
    plain = elastic == 1.0 and actuation == 1.0 and rest == 0.0 and d_elastic == 0.0 and d_rest == 0.0
    for k in range(len(signs)):
        s = signs[k]
        whole, in_u = _law(table, grid, law, p[k], s * u)
        if plain and d_actuation == 0.0:
            tau += s * whole
            slope += s * s * in_u
            continue
        straight, straight_u = _law(table, grid, law, 0.0, s * u)
        spring, spring_u = (
            (straight, straight_u) if rest == 0.0 else _law(table, grid, law, 0.0, s * (u - rest))
        )
        tau += s * (actuation * (whole - straight) + elastic * spring)
        slope += s * (d_actuation * (whole - straight) + d_elastic * spring)
        slope += s * s * (actuation * (in_u - straight_u) + elastic * spring_u * (1.0 - d_rest))
    return tau, slope


@njit(cache=True, inline="always")
def _row(matrix, a, vector):  # type: ignore[no-untyped-def]
    return matrix[a, 0] * vector[0] + matrix[a, 1] * vector[1] + matrix[a, 2] * vector[2]


@njit(cache=True, inline="always")
def _pose(q, base, body, axes, origins, points, space):  # type: ignore[no-untyped-def]
    """Fills axes (n, 3), origins (n, 3) and points (n + 1, 3) of the moving bodies and the tip."""
    position, _, offsets, rests, axis, arms, _ = body
    n = len(q)
    parent, turned, origin = space[0], space[1], space[2, 0]
    j, k = (axis + 1) % 3, (axis + 2) % 3
    for a in range(3):
        origin[a] = position[a]
        for b in range(3):
            parent[a, b] = base[a, b]
    for i in range(n):
        for a in range(3):
            origin[a] += _row(parent, a, offsets[i])
            for b in range(3):
                turned[a, b] = _row(parent, a, rests[i, :, b])
        cosine, sine = np.cos(q[i]), np.sin(q[i])
        for a in range(3):
            axes[i, a], origins[i, a] = turned[a, axis], origin[a]
            parent[a, axis] = turned[a, axis]
            parent[a, j] = cosine * turned[a, j] + sine * turned[a, k]
            parent[a, k] = cosine * turned[a, k] - sine * turned[a, j]
            points[i, a] = origin[a] + _row(parent, a, arms[i])
    for a in range(3):
        points[n, a] = origin[a] + _row(parent, a, arms[n])


@njit(cache=True, inline="always")
def _weigh(axes, origins, points, masses, payload, gravity, force, load, stiffness, slopes, space):  # type: ignore[no-untyped-def]
    """Fills the generalised loads (n,) and, if `slopes`, their negative derivatives (n, n)."""
    n = len(load)
    torsor, own, f, total, turned = space[3], space[4], space[5, 0], space[5, 1], space[5, 2]
    for a in range(3):
        total[a] = 0.0
        for b in range(3):
            torsor[a, b] = 0.0
    for i in range(n, -1, -1):
        mass = payload if i == n else masses[i]
        for a in range(3):
            f[a] = mass * gravity[a] + (force[a] if i == n else 0.0)
            total[a] += f[a]
        for a in range(3):
            for b in range(3):
                torsor[a, b] += points[i, a] * f[b]
        if i == n:
            continue
        for a in range(3):
            for b in range(3):
                own[a, b] = torsor[a, b] - origins[i, a] * total[b]
        x, y, z = own[1, 2] - own[2, 1], own[2, 0] - own[0, 2], own[0, 1] - own[1, 0]
        load[i] = axes[i, 0] * x + axes[i, 1] * y + axes[i, 2] * z
        if slopes:
            trace = own[0, 0] + own[1, 1] + own[2, 2]
            for a in range(3):
                turned[a] = _row(own, a, axes[i]) - trace * axes[i, a]
            for h in range(i + 1):
                value = -(axes[h, 0] * turned[0] + axes[h, 1] * turned[1] + axes[h, 2] * turned[2])
                stiffness[h, i] = value
                stiffness[i, h] = value


@njit(cache=True)
def _solve(matrix, right):  # type: ignore[no-untyped-def]
    """matrix⁻¹ right by elimination with pivots; both are overwritten. Singular pivots become tiny ones."""
    n = len(right)
    for i in range(n):
        best = i
        for k in range(i + 1, n):
            if abs(matrix[k, i]) > abs(matrix[best, i]):
                best = k
        if best != i:
            for b in range(n):
                matrix[i, b], matrix[best, b] = matrix[best, b], matrix[i, b]
            right[i], right[best] = right[best], right[i]
        pivot = matrix[i, i] if abs(matrix[i, i]) > 1e-300 else 1e-300
        for k in range(i + 1, n):
            ratio = matrix[k, i] / pivot
            if ratio != 0.0:
                for b in range(i, n):
                    matrix[k, b] -= ratio * matrix[i, b]
                right[k] -= ratio * right[i]
    for i in range(n - 1, -1, -1):
        for b in range(i + 1, n):
            right[i] -= matrix[i, b] * right[b]
        right[i] /= matrix[i, i] if abs(matrix[i, i]) > 1e-300 else 1e-300


@njit(cache=True)
def _balance(chain, now, q, memory, frame):  # type: ignore[no-untyped-def]
    """Fills the frame and the new memory at q; returns the largest residual, infinite where one is no number."""
    model, laws, body, gravity = chain
    base, p, f, opposed, hung, t, dt = now
    before, old, new = memory
    axes, origins, points, load, residual, slope, space = frame
    _pose(q, base, body, axes, origins, points, space)
    _weigh(axes, origins, points, body[6], hung, gravity, f, load, origins, False, space)
    size = 0.0
    for i in range(len(q)):
        tau, slope[i] = _effort(model, i, laws[i], q[i], before[i], dt, p, t, old[i], new[i])
        residual[i] = tau - opposed + load[i]
        if not np.isfinite(residual[i]):
            return np.inf
        size = max(size, abs(residual[i]))
    return size


@njit(cache=True, inline="always")
def _stiffen(chain, now, frame, stiffness):  # type: ignore[no-untyped-def]
    """Fills the stiffness −∂R/∂q (n, n)."""
    axes, origins, points, load, _, slope, space = frame
    _weigh(axes, origins, points, chain[2][6], now[4], chain[3], now[2], load, stiffness, True, space)
    for i in range(len(load)):
        stiffness[i, i] -= slope[i]


@njit(cache=True)
def _step(stiffness, residual, step, work, max_turn):  # type: ignore[no-untyped-def]
    """Fills Newton's step; returns the share of it that turns no joint too far."""
    n = len(step)
    if n == 1:
        stiff = stiffness[0, 0]
        step[0] = residual[0] / (stiff if stiff > 1e-12 else abs(stiff) + 1e-9)
    else:
        step[:] = residual
        work[:] = stiffness
        _solve(work, step)
    longest = 0.0
    for i in range(n):
        longest = max(longest, abs(step[i]))
    return max_turn / longest if longest > max_turn else 1.0


@njit(cache=True)
def _equilibrium(chain, now, q, memory, frame, square, lines, options):  # type: ignore[no-untyped-def]
    """Moves q to equilibrium; returns whether it was reached. Frame and new memory are those at q.

    Where it was not, q and the memory are those before the step: what comes next begins there.
    """
    before, old, new = memory
    if _newton(chain, now, q, memory, frame, square, lines, options):
        return True
    q[:] = before
    if _relax(chain, now, q, memory, frame, square, lines, options):
        return True
    q[:] = before
    _balance(chain, now, q, memory, frame)
    new[:] = old
    return False


@njit(cache=True)
def _relax(chain, now, q, memory, frame, square, lines, options):  # type: ignore[no-untyped-def]
    """Newton's method damped as an overdamped motion with ever longer steps; returns whether it arrived.

    Pseudo-transient continuation with switched evolution (Kelley & Keyes, SIAM J. Numer. Anal. 35, 1998): slow, but
    it follows a long chain through curls and snaps, in which the residual must grow before it falls.
    """
    tolerance, _, max_turn = options
    stiffness, work = square
    step, _ = lines
    size = _balance(chain, now, q, memory, frame)
    damping = size / RELAX_TURN
    for _ in range(RELAX_ITERATIONS):
        if size <= tolerance or not np.isfinite(size):
            break
        _stiffen(chain, now, frame, stiffness)
        shift = damping
        while not _is_positive(stiffness, shift, work) and shift < 1e12:
            shift = 2.0 * shift + 1e-12
        for i in range(len(q)):
            stiffness[i, i] += shift
        scale = _step(stiffness, frame[4], step, work, max_turn)
        turned = 0.0
        for i in range(len(q)):
            q[i] += scale * step[i]
            turned = max(turned, abs(q[i] - memory[0][i]))
        if turned > MOST_TURNED:
            return False
        reached = _balance(chain, now, q, memory, frame)
        damping *= min(max(reached / size, 0.1), 2.0)
        size = reached
    return size <= tolerance


@njit(cache=True)
def _is_positive(matrix, shift, work):  # type: ignore[no-untyped-def]
    """Whether a symmetric matrix + shift · 1 is positive definite, by Cholesky's factors in `work`."""
    n = len(matrix)
    for i in range(n):
        for j in range(i + 1):
            rest = matrix[i, j] + (shift if i == j else 0.0)
            for k in range(j):
                rest -= work[i, k] * work[j, k]
            if i == j:
                if not rest > 0.0:
                    return False
                work[i, i] = np.sqrt(rest)
            else:
                work[i, j] = rest / work[j, j]
    return True


@njit(cache=True, inline="always")
def _newton(chain, now, q, memory, frame, square, lines, options):  # type: ignore[no-untyped-def]
    """Moves q toward equilibrium; returns whether it was reached. Frame and new memory are those at q."""
    tolerance, max_iterations, max_turn = options
    stiffness, work = square
    step, trial = lines
    size = _balance(chain, now, q, memory, frame)
    iteration = 0
    while size > tolerance and iteration < max_iterations and np.isfinite(size):
        iteration += 1
        _stiffen(chain, now, frame, stiffness)
        scale = _step(stiffness, frame[4], step, work, max_turn)
        # A step that makes the balance worse is halved, a few times: kinks and backward slopes.
        reached = size
        for _ in range(MAX_HALVINGS):
            for i in range(len(q)):
                trial[i] = q[i] + scale * step[i]
            reached = _balance(chain, now, trial, memory, frame)
            if reached < size or reached <= tolerance:
                break
            scale *= 0.5
        q[:] = trial
        size = reached
    return size <= tolerance


@njit(cache=True, inline="always")
def _differentiate(chain, then, dt, q, memory, memory_v, frame, square, lines, spare):  # type: ignore[no-untyped-def]
    """Changes of q and of the memory when parameters, inputs and past change a little.

    `then` holds the changed model, gravity, inputs and loads; `memory_v` the changes of the past, which become
    those of the present.
    """
    model, gravity, p, f, opposed, hung, t = then
    before, old, new = memory
    before_v, old_v = memory_v
    axes, origins, points, _, residual, _, space = frame
    stiffness, work = square
    load, right = lines
    moved, scratch = spare
    laws, masses = chain[1], chain[2][6]
    _weigh(axes, origins, points, masses, hung, gravity, f, load, work, False, space)
    for i in range(len(q)):
        for s in range(len(moved)):
            moved[s] = old[i, s] + old_v[i, s]
        tau = _effort(model, i, laws[i], q[i], before[i] + before_v[i], dt, p, t, moved, scratch)[0]
        right[i] = tau - opposed + load[i] - residual[i]
    work[:] = stiffness
    _solve(work, right)
    for i in range(len(q)):
        if len(moved):
            for s in range(len(moved)):
                moved[s] = old[i, s] + old_v[i, s]
            _effort(model, i, laws[i], q[i] + right[i], before[i] + before_v[i], dt, p, t, moved, scratch)
            for s in range(len(moved)):
                old_v[i, s] = scratch[s] - new[i, s]
        before_v[i] = right[i]


@njit(cache=True, inline="always")
def _mix(value, previous, share, begins):  # type: ignore[no-untyped-def]
    """A straight line from the sample before to this one; from nothing where a run begins."""
    return share * value if begins else share * value + (1.0 - share) * previous


@njit(cache=True)
def _drive(drive, sample, share, begins, p, f):  # type: ignore[no-untyped-def]
    """Fills pressures and tip force part of the way to a sample; returns moment, payload and temperature there."""
    pressure, force, moment, payload, temperature = drive
    last = max(sample - 1, 0)
    for m in range(len(p)):
        p[m] = _mix(pressure[sample, m], pressure[last, m], share, begins)
    for a in range(3):
        f[a] = _mix(force[sample, a], force[last, a], share, begins)
    opposed = _mix(moment[sample], moment[last], share, begins)
    if begins:
        return opposed, payload[sample], temperature[sample]
    hung = _mix(payload[sample], payload[last], share, False)
    return opposed, hung, _mix(temperature[sample], temperature[last], share, False)


@njit(cache=True)
def follow(model, keeps, laws, body, gravity, drive, clock, others, options):  # type: ignore[no-untyped-def]
    """A chain of n hinges through N samples of all runs, one after another.

    Args:
        model: functions, terms, parameters, table, grid, signs: see `Terms` and `LawTable`.
        keeps: (states,) whether a memory outlasts the rest between runs.
        laws: (n,) the law of each joint.
        body: position, bases (N, 3, 3), offsets, rests, axis, arms, masses: see `Body`.
        gravity: (3,).
        drive: pressure (N, m), force (N, 3), moment (N,), payload (N,), temperature (N,).
        clock: duration (N,), start (N,), specimen (N,), number of specimens, substeps (N,).
        others: parameters, gravity and the five arrays of `drive` of K variations, stacked.
        options: tolerance, iterations, longest turn of a joint in one of them.

    Returns:
        q (N, n), its changes (K, N, n) to first order, and whether each sample converged (N,).
    """
    functions, terms, _, table, grid, signs = model
    duration, start, specimen, n_specimens, substeps = clock
    parameters_v, gravity_v, pressure_v, force_v, moment_v, payload_v, temperature_v = others
    n_samples, n, n_memory, n_changes = len(start), len(laws), len(keeps), len(parameters_v)
    chain = (model, laws, body, gravity)
    q_all, dq_all = np.zeros((n_samples, n)), np.zeros((n_changes, n_samples, n))
    converged = np.ones(n_samples, dtype=np.bool_)
    q, before, old, new = np.zeros(n), np.zeros(n), np.zeros((n, n_memory)), np.zeros((n, n_memory))
    before_v, old_v = np.zeros((n_changes, n)), np.zeros((n_changes, n, n_memory))
    kept, kept_v = np.zeros((n_specimens, n, n_memory)), np.zeros((n_specimens, n_changes, n, n_memory))
    memory = (before, old, new)
    pose = (np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n + 1, 3)))
    frame = (*pose, np.zeros(n), np.zeros(n), np.zeros(n), np.zeros((6, 3, 3)))
    square, lines = (np.zeros((n, n)), np.zeros((n, n))), (np.zeros(n), np.zeros(n))
    spare = (np.zeros(n_memory), np.zeros(n_memory))
    p, p_v, f, f_v = np.zeros(len(signs)), np.zeros(len(signs)), np.zeros(3), np.zeros(3)
    for sample in range(n_samples):
        begins, owner = start[sample], specimen[sample]
        if begins:
            q[:], before[:], before_v[:] = 0.0, 0.0, 0.0
            old[:], old_v[:] = kept[owner], kept_v[owner]
            for s in range(n_memory):
                if not keeps[s]:
                    old[:, s], old_v[:, :, s] = 0.0, 0.0
        parts = RAMP_STEPS if begins else substeps[sample]
        dt = np.inf if begins else duration[sample] / parts
        for part in range(1, parts + 1):
            share = part / parts
            opposed, hung, t = _drive(drive, sample, share, begins, p, f)
            now = (body[1][sample], p, f, opposed, hung, t, dt)
            if not _equilibrium(chain, now, q, memory, frame, square, lines, options):
                converged[sample] = False
            if n_changes:
                _stiffen(chain, now, frame, square[0])
            for k in range(n_changes):
                drive_v = (pressure_v[k], force_v[k], moment_v[k], payload_v[k], temperature_v[k])
                opposed_v, hung_v, t_v = _drive(drive_v, sample, share, begins, p_v, f_v)
                other = (functions, terms, parameters_v[k], table, grid, signs)
                then = (other, gravity_v[k], p_v, f_v, opposed_v, hung_v, t_v)
                past = (before_v[k], old_v[k])
                _differentiate(chain, then, dt, q, memory, past, frame, square, lines, spare)
            before[:], old[:] = q, new
        q_all[sample] = q
        dq_all[:, sample] = before_v
        kept[owner], kept_v[owner] = old, old_v
    return q_all, dq_all, converged


def is_compiled() -> bool:
    """Whether machine code of `follow` is there, in this process or in numba's cache, as new as this file."""
    if follow.signatures:
        return True
    source = Path(__file__).stat().st_mtime
    cached = Path(follow.stats.cache_path).glob("kernel.follow-*.nbc")
    return any(file.stat().st_mtime >= source for file in cached)
