"""Compiled: a hinge chain through histories, one equilibrium after another, with derivatives.

At each step Newton's method solves, joint by joint i,

    R_i(q) = τ'_i(q_i) − M + a_i · Σ_{k ≥ i} (x_k − o_i) × F_k = 0

with τ' the effort with law terms (`LawTerm`), M the end moment, a_i and o_i axis and origin of joint i, x_k and
F_k the points beyond it and the forces on them. Derivatives follow by the implicit function theorem: with a
small change δ of inputs, parameters and past, K dq = R(q; δ) − R(q) + ∂R/∂past δ, the first difference with the
past as it was, K = −∂R/∂q, and memories change by what the step makes of the changed past at q + dq.

Everything is plain loops over small arrays that are lent from function to function: counting references to them would
cost more than the arithmetic.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numba import njit

from pliant_plugins.physics.compiled import arrays, discard_stale, efforts, laws, terms
from pliant_plugins.physics.compiled.arrays import copy, copy_rows, lent
from pliant_plugins.physics.compiled.terms import combine, net_of_joint
from pliant_plugins.physics.quasistatic import hinge
from pliant_plugins.physics.quasistatic.hinge import (
    by_the_past,
    effort,
    is_positive,
    pose,
    slope,
    solve,
    substitute,
    weigh,
)

SOURCES = tuple(
    Path(str(module.__file__)) for module in (sys.modules[__name__], hinge, arrays, efforts, laws, terms)
)
RAMP_STEPS = 4
MAX_HALVINGS = 8
# From a guess, steps that aim at this share of the tolerance.
CLOSER, CLOSER_STEPS = 1e-2, 2
# Pseudo-transient continuation: iterations, and the turn of a joint that its first step aims at.
RELAX_ITERATIONS = 300
RELAX_TURN = 0.05
# A joint that has turned so far (rad) has no equilibrium in reach.
MOST_TURNED = 2.0 * np.pi


@njit(cache=True, error_model="numpy")
def _balance(chain, now, q, memory, frame):  # type: ignore[no-untyped-def]
    """Fills the frame and the new memory at q; returns the largest residual, infinite where one is no number."""
    model, laws, body, gravity = chain
    base, p, f, opposed, hung, t, dt = now
    before, old, new, states = memory
    axes, origins, points, turned, load, residual, parts, _ = frame
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
def _stiffen(chain, now, q, memory, frame, stiffness):  # type: ignore[no-untyped-def]
    """Fills the stiffness −∂R/∂q (n, n) at the q of the last balance."""
    model = chain[0]
    _, p, _, _, _, t, dt = now
    before, old, _, states = memory
    axes, _, _, turned, _, _, parts, scratch = frame
    for i in range(len(q)):
        x, y, z = turned[i, 0], turned[i, 1], turned[i, 2]
        for h in range(i + 1):
            value = -(axes[h, 0] * x + axes[h, 1] * y + axes[h, 2] * z)
            stiffness[h, i] = value
            stiffness[i, h] = value
        part = (parts[i, 0], parts[i, 1], parts[i, 2], parts[i, 3])
        stiffness[i, i] -= slope(model, i, q[i], before[i], dt, p, t, old, i * states, scratch, part)


@njit(cache=True, error_model="numpy")
def _step(stiffness, residual, step, work, max_turn):  # type: ignore[no-untyped-def]
    """Fills Newton's step; returns the share of it that turns no joint too far."""
    n = len(step)
    if n == 1:
        stiff = stiffness[0, 0]
        step[0] = residual[0] / (stiff if stiff > 1e-12 else abs(stiff) + 1e-9)
    else:
        copy(residual, step)
        if is_positive(stiffness, 0.0, work):
            substitute(work, step)
        else:
            copy_rows(stiffness, work)
            solve(work, step)
    longest = 0.0
    for i in range(n):
        longest = max(longest, abs(step[i]))
    return max_turn / longest if longest > max_turn else 1.0


@njit(cache=True, error_model="numpy")
def _equilibrium(chain, now, q, memory, frame, square, lines, options, guessed):  # type: ignore[no-untyped-def]
    """Moves q to equilibrium; returns whether it was reached. Frame and new memory are those at q.

    From a guess the way is short, and would end at the tolerance: a step or two more end as near as the way from the
    step before. Where no equilibrium was reached, q and the memory are those before the step: what comes next begins
    there.
    """
    before, old, new, _ = memory
    least = CLOSER_STEPS if guessed else 0
    while True:
        if _newton(chain, now, q, memory, frame, square, lines, options, least):
            return True
        if least == 0:
            break
        least = 0
        copy(before, q)
    copy(before, q)
    if _relax(chain, now, q, memory, frame, square, lines, options):
        return True
    copy(before, q)
    _balance(chain, now, q, memory, frame)
    copy(old, new)
    return False


@njit(cache=True, error_model="numpy")
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
        _stiffen(chain, now, q, memory, frame, stiffness)
        shift = damping
        while not is_positive(stiffness, shift, work) and shift < 1e12:
            shift = 2.0 * shift + 1e-12
        for i in range(len(q)):
            stiffness[i, i] += shift
        scale = _step(stiffness, frame[5], step, work, max_turn)
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


@njit(cache=True, forceinline=True, error_model="numpy")
def _newton(chain, now, q, memory, frame, square, lines, options, least):  # type: ignore[no-untyped-def]
    """Moves q toward equilibrium; returns whether it was reached. Frame and new memory are those at q.

    In its first `least` steps it aims closer than the tolerance.
    """
    tolerance, max_iterations, max_turn = options
    stiffness, work = square
    step, trial = lines
    size, aim = _balance(chain, now, q, memory, frame), CLOSER * tolerance
    iteration = 0
    while (
        (size > tolerance or (size > aim and iteration < least))
        and iteration < max_iterations
        and np.isfinite(size)
    ):
        iteration += 1
        _stiffen(chain, now, q, memory, frame, stiffness)
        scale = _step(stiffness, frame[5], step, work, max_turn)
        # A step that makes the balance worse is halved, a few times: kinks and backward slopes.
        reached = size
        for _ in range(MAX_HALVINGS):
            for i in range(len(q)):
                trial[i] = q[i] + scale * step[i]
            reached = _balance(chain, now, trial, memory, frame)
            if reached < size or reached <= tolerance:
                break
            scale *= 0.5
        copy(trial, q)
        size = reached
    return size <= tolerance


@njit(cache=True, error_model="numpy")
def _differentiate(chain, then, now, q, memory, past, frame, square, lines, spare, positive):  # type: ignore[no-untyped-def]
    """Changes of q and of the memory when parameters, inputs and past change a little.

    `then` holds the changed model, gravity, inputs and loads; `past` the changes of the past, which become those of
    the present. The square holds the stiffness and, where it is positive, its factor.
    """
    model, gravity, p, f, opposed, hung, t = then
    before, old, new, states = memory
    before_v, old_v = past
    axes, origins, points, _, plain_load, residual, parts, _ = frame
    stiffness, work = square
    load, right = lines
    moved, scratch, turned = spare
    laws, masses, dt = chain[1], chain[2][6], now[6]
    copy(plain_load, load)
    if hung != now[4] or not _same(f, now[2]) or not _same(gravity, chain[3]):
        weigh(axes, origins, points, masses, hung, gravity, f, load, turned)
    same, _, _, _ = chain
    for i in range(len(q)):
        at = i * states
        tau, _ = effort(model, i, laws[i], q[i], before[i], dt, p, t, old, at, scratch, 0)
        right[i] = tau - opposed + load[i] - residual[i]
        if len(same[0][0]):
            part = (parts[i, 0], parts[i, 1], parts[i, 2], parts[i, 3])
            was, change = (old, at, states, moved), (before_v[i], old_v)
            right[i] += by_the_past(same, i, q[i], before[i], dt, now[1], now[5], was, change, scratch, part)
    if positive:
        substitute(work, right)
    else:
        copy_rows(stiffness, work)
        solve(work, right)
    for i in range(len(q)):
        if states:
            net = net_of_joint(model[4], model[6], i, p)
            at = i * states
            for s in range(states):
                moved[s] = old[at + s] + old_v[at + s]
            combine(model[0], i, q[i] + right[i], before[i] + before_v[i], dt, net, t, moved, 0, scratch, 0)
            for s in range(states):
                old_v[at + s] = scratch[s] - new[at + s]
        before_v[i] = right[i]


@njit(cache=True, forceinline=True, error_model="numpy")
def _same(a, b):  # type: ignore[no-untyped-def]
    return a[0] == b[0] and a[1] == b[1] and a[2] == b[2]


@njit(cache=True, forceinline=True, error_model="numpy")
def _mix(value, previous, share, begins):  # type: ignore[no-untyped-def]
    """A straight line from the sample before to this one; from nothing where a run begins."""
    return share * value if begins else share * value + (1.0 - share) * previous


@njit(cache=True, forceinline=True, error_model="numpy")
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


@njit(cache=True, forceinline=True, error_model="numpy")
def _extrapolate(q, before, earlier, stretch, guess):  # type: ignore[no-untyped-def]
    """Fills the guess on the straight line through the last two steps."""
    for i in range(len(q)):
        guess[i] = before[i] + stretch * (before[i] - earlier[i])


@njit(cache=True, forceinline=True, error_model="numpy")
def _distance(a, b):  # type: ignore[no-untyped-def]
    longest = 0.0
    for i in range(len(a)):
        longest = max(longest, abs(a[i] - b[i]))
    return longest


@njit(cache=True, error_model="numpy")
def _walk(model, keeps, laws, body, gravity, drive, clock, others, options, space):  # type: ignore[no-untyped-def]
    """The loop of `follow`, over arrays that its caller owns."""
    model, keeps, laws, body, gravity, drive, clock, others, space = lent(
        (model, keeps, laws, body, gravity, drive, clock, others, space)
    )
    duration, start, specimen, _, substeps = clock
    bases = body[1]
    numbers_v, gravity_v, pressure_v, force_v, moment_v, payload_v, temperature_v = others
    results, angles, memories, changes, places, scratch, square, rows, spare, inputs = space
    q_all, dq_all, converged = results
    q, before, earlier, guess = angles
    old, new, kept = memories
    before_v, old_v, kept_v = changes
    frame, lines = (*places, rows[0], rows[1], *scratch), (rows[2], rows[3])
    p, p_v, f, f_v = inputs
    chain = (model, laws, body, gravity)
    n_samples, n, states, n_changes = len(start), len(laws), len(keeps), len(numbers_v)
    memory = (before, old, new, states)
    last_dt, trusted = np.inf, False
    for sample in range(n_samples):
        begins, owner = start[sample], specimen[sample]
        if begins:
            q[:], before[:], earlier[:], before_v[:] = 0.0, 0.0, 0.0, 0.0
            copy(kept[owner], old)
            copy_rows(kept_v[owner], old_v)
            trusted = False
            for i in range(n):
                for s in range(states):
                    if not keeps[s]:
                        old[i * states + s], old_v[:, i * states + s] = 0.0, 0.0
        parts = RAMP_STEPS if begins else substeps[sample]
        dt = np.inf if begins else duration[sample] / parts
        for part in range(1, parts + 1):
            share = part / parts
            opposed, hung, t = _drive(drive, sample, share, begins, p, f)
            now = (bases[sample], p, f, opposed, hung, t, dt)
            stretch = dt / last_dt if last_dt > 0.0 and np.isfinite(last_dt) and np.isfinite(dt) else 1.0
            _extrapolate(q, before, earlier, stretch, guess)
            guessed = trusted and _distance(guess, before) > 0.0
            if guessed:
                copy(guess, q)
            if not _equilibrium(chain, now, q, memory, frame, square, lines, options, guessed):
                converged[sample] = False
            trusted = _distance(q, guess) < _distance(q, before)
            if n_changes:
                _stiffen(chain, now, q, memory, frame, square[0])
                positive = is_positive(square[0], 0.0, square[1])
                for k in range(n_changes):
                    drive_v = (pressure_v[k], force_v[k], moment_v[k], payload_v[k], temperature_v[k])
                    opposed_v, hung_v, t_v = _drive(drive_v, sample, share, begins, p_v, f_v)
                    terms_v = (model[0][0], model[0][1], numbers_v[k], model[0][3])
                    tables = (model[1], model[2], model[3], model[4], model[5], model[6], model[7])
                    other = (terms_v,) + tables
                    then = (other, gravity_v[k], p_v, f_v, opposed_v, hung_v, t_v)
                    past = (before_v[k], old_v[k])
                    _differentiate(chain, then, now, q, memory, past, frame, square, lines, spare, positive)
            copy(before, earlier)
            copy(q, before)
            copy(new, old)
            last_dt = dt
        copy(q, q_all[sample])
        copy_rows(before_v, dq_all[:, sample])
        copy(old, kept[owner])
        copy_rows(old_v, kept_v[owner])


@njit(cache=True, nogil=True, error_model="numpy")
def follow(model, keeps, laws, body, gravity, drive, clock, others, options):  # type: ignore[no-untyped-def]
    """A chain of n hinges through N samples of all runs, one after another.

    Newton's method begins on the straight line through the last two steps where that was nearer last time, else where
    the last step ended.

    Args:
        model: terms of `CompiledTerms.arrays`; cells, grid, size (cells by actuation and by angle) of `LawTable`; signs
            of the actuators; whether a term has another role than `moment`; `drives` of `CompiledLaws`; laws of
            several actuations: addresses, spans, parameters, α and γ (see `JointLaw.behind`), zeros, space.
        keeps: (states,) whether a memory outlasts the rest between runs.
        laws: (n,) which table each joint has, or which law of several actuations.
        body: position, bases (N, 3, 3), offsets, rests, which rests are none (n,), arms, masses: see `Body`; the third
            axis of its frames is that of the hinges.
        gravity: (3,).
        drive: pressure (N, m), force (N, 3), moment (N,), payload (N,), temperature (N,).
        clock: duration (N,), start (N,), specimen (N,), number of specimens, substeps (N,).
        others: numbers, gravity and the five arrays of `drive` of K variations, stacked.
        options: tolerance, iterations, longest turn of a joint in one of them.

    Returns:
        q (N, n), its changes (K, N, n) to first order, and whether each sample converged (N,).
    """
    start, n_specimens = clock[1], clock[3]
    n_samples, n, states, n_changes, m = len(start), len(laws), len(keeps), len(others[0]), len(model[4])
    results = (
        np.zeros((n_samples, n)),
        np.zeros((n_changes, n_samples, n)),
        np.ones(n_samples, dtype=np.bool_),
    )
    angles = (np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n))
    memories = (np.zeros(n * states), np.zeros(n * states), np.zeros((n_specimens, n * states)))
    kept_v = np.zeros((n_specimens, n_changes, n * states))
    changes = (np.zeros((n_changes, n)), np.zeros((n_changes, n * states)), kept_v)
    places = (np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n + 1, 3)), np.zeros((n, 3)))
    scratch, square = (np.zeros((n, 4)), np.zeros(states)), (np.zeros((n, n)), np.zeros((n, n)))
    rows = (np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n))
    spare = (np.zeros(states), np.zeros(states), np.zeros((n, 3)))
    inputs = (np.zeros(m), np.zeros(m), np.zeros(3), np.zeros(3))
    space = (results, angles, memories, changes, places, scratch, square, rows, spare, inputs)
    _walk(model, keeps, laws, body, gravity, drive, clock, others, options, space)
    return results


discard_stale(Path(follow.stats.cache_path), SOURCES)


def is_compiled() -> bool:
    """Whether machine code of `follow` is there, in this process or in numba's cache, as new as its sources."""
    if follow.signatures:
        return True
    source = max(path.stat().st_mtime for path in SOURCES)
    cached = Path(follow.stats.cache_path).glob("kernel.follow-*.nbc")
    return any(file.stat().st_mtime >= source for file in cached)
