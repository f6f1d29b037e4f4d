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
from typing import Any

import numpy as np
from numba import cfunc, njit, types
from numba.core.errors import NumbaExperimentalFeatureWarning

# Function pointers keep one compiled kernel for all effects; numba calls them experimental at every compile.
warnings.filterwarnings("ignore", category=NumbaExperimentalFeatureWarning)

_F, _A = types.float64, types.float64[::1]
TERM_SIGNATURE = _F(_F, _F, _F, _F, _F, _A, _A, _A)
MAX_TERMS = 8
ROLES = ("moment", "elastic", "actuation", "rest")
SLOPE_STEP = 1e-6
RAMP_STEPS = 4


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


@njit(cache=True)
def _effort(functions, terms, parameters, table, grid, law, signs, u, before, dt, p, t, old, new):  # type: ignore[no-untyped-def]
    """τ' of one joint at angle u; `new` becomes its memory."""
    rate = (u - before) / dt if 0.0 < dt < np.inf else 0.0
    net = 0.0
    for k in range(len(signs)):
        net += signs[k] * p[k]
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
    tau = moment
    for k in range(len(signs)):
        s = signs[k]
        whole = _law(table, grid, law, p[k], s * u)[0]
        tau += s * actuation * (whole - _law(table, grid, law, 0.0, s * u)[0])
        tau += s * elastic * _law(table, grid, law, 0.0, s * (u - rest))[0]
    return tau


@njit(cache=True)
def _plain(table, grid, law, signs, u, p):  # type: ignore[no-untyped-def]
    """τ and its slope of one joint without terms."""
    tau = slope = 0.0
    for k in range(len(signs)):
        value, in_u = _law(table, grid, law, p[k], signs[k] * u)
        tau += signs[k] * value
        slope += signs[k] * signs[k] * in_u
    return tau, slope


@njit(cache=True)
def _pose(q, base, position, offsets, rests, axis, arms, axes, origins, points):  # type: ignore[no-untyped-def]
    """Fills axes (n, 3), origins (n, 3) and points (n + 1, 3) of the moving bodies and the tip."""
    n = len(q)
    turned, parent = np.empty((3, 3)), base.copy()
    origin = position.copy()
    j, k = (axis + 1) % 3, (axis + 2) % 3
    for i in range(n):
        for a in range(3):
            origin[a] += (
                parent[a, 0] * offsets[i, 0] + parent[a, 1] * offsets[i, 1] + parent[a, 2] * offsets[i, 2]
            )
        for a in range(3):
            for b in range(3):
                turned[a, b] = (
                    parent[a, 0] * rests[i, 0, b]
                    + parent[a, 1] * rests[i, 1, b]
                    + parent[a, 2] * rests[i, 2, b]
                )
        cosine, sine = np.cos(q[i]), np.sin(q[i])
        for a in range(3):
            axes[i, a], origins[i, a] = turned[a, axis], origin[a]
            parent[a, axis] = turned[a, axis]
            parent[a, j] = cosine * turned[a, j] + sine * turned[a, k]
            parent[a, k] = cosine * turned[a, k] - sine * turned[a, j]
            points[i, a] = (
                origin[a] + parent[a, 0] * arms[i, 0] + parent[a, 1] * arms[i, 1] + parent[a, 2] * arms[i, 2]
            )
    for a in range(3):
        points[n, a] = (
            origin[a] + parent[a, 0] * arms[n, 0] + parent[a, 1] * arms[n, 1] + parent[a, 2] * arms[n, 2]
        )


@njit(cache=True)
def _weigh(axes, origins, points, masses, payload, gravity, force, load, stiffness, slopes):  # type: ignore[no-untyped-def]
    """Fills the generalised loads (n,) and, if `slopes`, their negative derivatives (n, n)."""
    n = len(load)
    f, total = np.zeros(3), np.zeros(3)
    torsor, own, turned = np.zeros((3, 3)), np.empty((3, 3)), np.empty(3)
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
                turned[a] = (
                    own[a, 0] * axes[i, 0]
                    + own[a, 1] * axes[i, 1]
                    + own[a, 2] * axes[i, 2]
                    - trace * axes[i, a]
                )
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
def follow(  # type: ignore[no-untyped-def]
    functions, terms, keeps, parameters, table, grid, laws, signs,
    position, bases, offsets, rests, axis, arms, masses, gravity,
    pressure, force, moment, payload, temperature, duration, start, specimen, n_specimens, substeps,
    parameters_v, gravity_v, pressure_v, force_v, moment_v, payload_v, temperature_v,
    tolerance, max_iterations, max_turn,
):  # fmt: skip
    """q (N, n), its changes (K, N, n) for K variations, and whether each of the N samples converged."""
    n_samples, n, n_memory, n_changes = len(moment), len(laws), len(keeps), len(parameters_v)
    q_all, dq_all = np.zeros((n_samples, n)), np.zeros((n_changes, n_samples, n))
    converged = np.ones(n_samples, dtype=np.bool_)
    q, before, trial = np.zeros(n), np.zeros(n), np.zeros(n)
    before_v, step = np.zeros((n_changes, n)), np.zeros(n)
    old, new, scratch = np.zeros((n, n_memory)), np.zeros((n, n_memory)), np.zeros(n_memory)
    old_v, moved = np.zeros((n_changes, n, n_memory)), np.zeros(n_memory)
    kept, kept_v = np.zeros((n_specimens, n, n_memory)), np.zeros((n_specimens, n_changes, n, n_memory))
    axes, origins, points = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n + 1, 3))
    load, residual, tau, slope = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    load_v, right = np.zeros(n), np.zeros(n)
    stiffness, work = np.zeros((n, n)), np.zeros((n, n))
    p, p_v, f, f_v = np.zeros(len(signs)), np.zeros(len(signs)), np.zeros(3), np.zeros(3)
    n_terms = terms.shape[0]
    for sample in range(n_samples):
        last = sample - 1
        if start[sample]:
            q[:] = 0.0
            before[:] = 0.0
            before_v[:] = 0.0
            for i in range(n):
                for s in range(n_memory):
                    old[i, s] = kept[specimen[sample], i, s] if keeps[s] else 0.0
                    for k in range(n_changes):
                        old_v[k, i, s] = kept_v[specimen[sample], k, i, s] if keeps[s] else 0.0
        parts = RAMP_STEPS if start[sample] else substeps[sample]
        dt = np.inf if start[sample] else duration[sample] / parts
        for part in range(1, parts + 1):
            # Between samples inputs are straight lines; a run begins with a slow ramp from nothing.
            share = part / parts
            rest = 0.0 if start[sample] else 1.0 - share
            for m in range(len(signs)):
                p[m] = share * pressure[sample, m] + (rest * pressure[last, m] if rest else 0.0)
            for a in range(3):
                f[a] = share * force[sample, a] + (rest * force[last, a] if rest else 0.0)
            end_moment = share * moment[sample] + (rest * moment[last] if rest else 0.0)
            hung = payload[sample] if start[sample] else share * payload[sample] + rest * payload[last]
            t = (
                temperature[sample]
                if start[sample]
                else share * temperature[sample] + rest * temperature[last]
            )
            base = bases[sample]

            size = np.inf
            done = False
            for iteration in range(max_iterations):
                _pose(q, base, position, offsets, rests, axis, arms, axes, origins, points)
                _weigh(axes, origins, points, masses, hung, gravity, f, load, stiffness, True)
                size = 0.0
                for i in range(n):
                    if n_terms == 0:
                        tau[i], slope[i] = _plain(table, grid, laws[i], signs, q[i], p)
                    else:
                        tau[i] = _effort(
                            functions,
                            terms,
                            parameters,
                            table,
                            grid,
                            laws[i],
                            signs,
                            q[i],
                            before[i],
                            dt,
                            p,
                            t,
                            old[i],
                            new[i],
                        )
                        up = _effort(
                            functions,
                            terms,
                            parameters,
                            table,
                            grid,
                            laws[i],
                            signs,
                            q[i] + SLOPE_STEP,
                            before[i],
                            dt,
                            p,
                            t,
                            old[i],
                            scratch,
                        )
                        down = _effort(
                            functions,
                            terms,
                            parameters,
                            table,
                            grid,
                            laws[i],
                            signs,
                            q[i] - SLOPE_STEP,
                            before[i],
                            dt,
                            p,
                            t,
                            old[i],
                            scratch,
                        )
                        slope[i] = (up - down) / (2 * SLOPE_STEP)
                    residual[i] = tau[i] - end_moment + load[i]
                    size = max(size, abs(residual[i]))
                    stiffness[i, i] -= slope[i]
                if size <= tolerance or not np.isfinite(size):
                    done = size <= tolerance
                    break
                if n == 1:
                    stiff = stiffness[0, 0]
                    step[0] = residual[0] / (stiff if stiff > 1e-12 else abs(stiff) + 1e-9)
                else:
                    work[:] = stiffness
                    step[:] = residual
                    _solve(work, step)
                longest = np.abs(step).max()
                scale = min(1.0, max_turn / longest) if longest > 0.0 else 1.0
                # A step that makes the balance worse is halved, a few times: kinks and backward slopes.
                for _ in range(8):
                    for i in range(n):
                        trial[i] = q[i] + scale * step[i]
                    _pose(trial, base, position, offsets, rests, axis, arms, axes, origins, points)
                    _weigh(axes, origins, points, masses, hung, gravity, f, load, work, False)
                    worst = 0.0
                    for i in range(n):
                        if n_terms == 0:
                            there = _plain(table, grid, laws[i], signs, trial[i], p)[0]
                        else:
                            there = _effort(
                                functions,
                                terms,
                                parameters,
                                table,
                                grid,
                                laws[i],
                                signs,
                                trial[i],
                                before[i],
                                dt,
                                p,
                                t,
                                old[i],
                                scratch,
                            )
                        worst = max(worst, abs(there - end_moment + load[i]))
                    if worst < size or worst <= tolerance:
                        break
                    scale *= 0.5
                q[:] = trial
            if not done:
                converged[sample] = False

            for k in range(n_changes):
                for m in range(len(signs)):
                    p_v[m] = share * pressure_v[k, sample, m] + (
                        rest * pressure_v[k, last, m] if rest else 0.0
                    )
                for a in range(3):
                    f_v[a] = share * force_v[k, sample, a] + (rest * force_v[k, last, a] if rest else 0.0)
                moment_k = share * moment_v[k, sample] + (rest * moment_v[k, last] if rest else 0.0)
                hung_k = (
                    payload_v[k, sample]
                    if start[sample]
                    else share * payload_v[k, sample] + rest * payload_v[k, last]
                )
                t_k = (
                    temperature_v[k, sample]
                    if start[sample]
                    else share * temperature_v[k, sample] + rest * temperature_v[k, last]
                )
                _pose(q, base, position, offsets, rests, axis, arms, axes, origins, points)
                _weigh(axes, origins, points, masses, hung, gravity, f, load, work, False)
                _weigh(axes, origins, points, masses, hung_k, gravity_v[k], f_v, load_v, work, False)
                for i in range(n):
                    here = _effort(
                        functions,
                        terms,
                        parameters,
                        table,
                        grid,
                        laws[i],
                        signs,
                        q[i],
                        before[i],
                        dt,
                        p,
                        t,
                        old[i],
                        scratch,
                    )
                    for s in range(n_memory):
                        moved[s] = old[i, s] + old_v[k, i, s]
                    there = _effort(
                        functions,
                        terms,
                        parameters_v[k],
                        table,
                        grid,
                        laws[i],
                        signs,
                        q[i],
                        before[i] + before_v[k, i],
                        dt,
                        p_v,
                        t_k,
                        moved,
                        scratch,
                    )
                    right[i] = (there - moment_k + load_v[i]) - (here - end_moment + load[i])
                work[:] = stiffness
                _solve(work, right)
                for i in range(n):
                    for s in range(n_memory):
                        moved[s] = old[i, s] + old_v[k, i, s]
                    _effort(
                        functions,
                        terms,
                        parameters_v[k],
                        table,
                        grid,
                        laws[i],
                        signs,
                        q[i] + right[i],
                        before[i] + before_v[k, i],
                        dt,
                        p_v,
                        t_k,
                        moved,
                        scratch,
                    )
                    _effort(
                        functions,
                        terms,
                        parameters,
                        table,
                        grid,
                        laws[i],
                        signs,
                        q[i],
                        before[i],
                        dt,
                        p,
                        t,
                        old[i],
                        new[i],
                    )
                    for s in range(n_memory):
                        old_v[k, i, s] = scratch[s] - new[i, s]
                    before_v[k, i] = right[i]
            for i in range(n):
                before[i] = q[i]
                for s in range(n_memory):
                    old[i, s] = new[i, s]
        for i in range(n):
            q_all[sample, i] = q[i]
            for k in range(n_changes):
                dq_all[k, sample, i] = before_v[k, i]
            for s in range(n_memory):
                kept[specimen[sample], i, s] = old[i, s]
                for k in range(n_changes):
                    kept_v[specimen[sample], k, i, s] = old_v[k, i, s]
    return q_all, dq_all, converged
