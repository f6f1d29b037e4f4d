"""Compiled: a chain through histories, one equilibrium after another, with derivatives.

At each step Newton's method solves R(q) = 0 for the coordinates in one line, (n·a,), with R the balance of
`hinge_chain` for hinges and of `spatial_chain` for all other joints: the loop is compiled for either. Derivatives
follow by the implicit function theorem: with a small change δ of inputs, parameters and past, K dq = R(q;
δ) − R(q) + ∂R/∂past δ, the first difference with the unchanged past, K = −∂R/∂q, and memories change by the result of
the step for the changed past at q + dq.

All code is plain loops over small arrays that are passed without reference counting, which would cost more than the
arithmetic.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit, types
from numba.extending import overload

from pliant_plugins.physics.compiled import (
    arrays,
    discard_stale,
    efforts,
    equilibrium,
    handles,
    laws,
    statics,
    terms,
)
from pliant_plugins.physics.compiled.arrays import copy, copy_rows, lent
from pliant_plugins.physics.compiled.equilibrium import new_factor
from pliant_plugins.physics.compiled.handles import apart, keep, kept
from pliant_plugins.physics.compiled.statics import new_frame
from pliant_plugins.physics.compiled.terms import combine, joint_net_input
from pliant_plugins.physics.quasistatic import hinge, hinge_chain, joint_effort, small_systems, spatial_chain
from pliant_plugins.physics.quasistatic.small_systems import is_positive, solve, substitute

OF_HINGES = (hinge, hinge_chain)
OF_OTHERS = (joint_effort, spatial_chain, statics, equilibrium)
OF_BOTH = (sys.modules[__name__], small_systems, arrays, handles, efforts, laws, terms)
SOURCES = tuple(Path(str(module.__file__)) for module in (*OF_BOTH, *OF_HINGES, *OF_OTHERS))
RAMP_STEPS = 4
MAX_HALVINGS = 8
# Number of failed steps after which Newton's method stops: without descent the relaxation is faster.
MOST_STALLS = 2
# A step that went past the equilibrium is cut to this share at least.
LEAST_SHARE = 0.1
# From a guess, steps that aim at this share of the tolerance.
CLOSER, CLOSER_STEPS = 1e-2, 2
# Pseudo-transient continuation: iterations, and the turn of a joint that its first step aims at.
RELAX_ITERATIONS = 300
RELAX_TURN = 0.05
# A saddle is left along a growing mode, by this share of the longest turn; multiplications to find the mode.
PUSH, MODE_STEPS = 0.2, 200
# Curvature below this share of the largest is neutral within rounding.
NEUTRAL = 1e-10
# A joint that has turned by this angle (rad) has no equilibrium in reach.
MOST_TURNED = 2.0 * np.pi


def _chosen(chain: Any, name: str) -> Any:
    """Return the function of this name for the type of a chain: only a hinge's body begins with an array."""
    of_hinges = isinstance(chain.kind[2][0], types.Array)
    return getattr(hinge_chain if of_hinges else spatial_chain, name)


def _balance(chain, now, q, memory, frame):  # type: ignore[no-untyped-def]
    """Fill the frame and the new memory at q; return the largest residual, infinite if one is not finite."""


@overload(_balance)
def _overload_balance(chain, now, q, memory, frame):  # type: ignore[no-untyped-def]
    balance = _chosen(chain, "balance")
    return lambda chain, now, q, memory, frame: balance(chain, now, q, memory, frame)


def _stiffen(chain, now, q, memory, frame, stiffness):  # type: ignore[no-untyped-def]
    """Fill the stiffness −∂R/∂q at the q of the last balance; return whether it is symmetric."""


@overload(_stiffen)
def _overload_stiffen(chain, now, q, memory, frame, stiffness):  # type: ignore[no-untyped-def]
    stiffen = _chosen(chain, "stiffen")
    return lambda chain, now, q, memory, frame, stiffness: stiffen(chain, now, q, memory, frame, stiffness)


def _misfit(chain, then, now, q, memory, past, frame, lines, spare):  # type: ignore[no-untyped-def]
    """Fill lines[1] with R(q; δ) − R(q) + ∂R/∂past δ; `then` and `past` are those of `_differentiate`."""


@overload(_misfit)
def _overload_misfit(chain, then, now, q, memory, past, frame, lines, spare):  # type: ignore[no-untyped-def]
    misfit = _chosen(chain, "misfit")
    return lambda chain, then, now, q, memory, past, frame, lines, spare: misfit(
        chain, then, now, q, memory, past, frame, lines, spare
    )


@njit(cache=True, error_model="numpy")
def _step(stiffness, symmetric, residual, step, work, options):  # type: ignore[no-untyped-def]
    """Fill Newton's step; return the share of it that moves no coordinate too far."""
    apart()
    _, _, max_turn, unit = kept(options)
    n = len(step)
    if n == 1:
        stiff = stiffness[0, 0]
        step[0] = residual[0] / (stiff if stiff > 1e-12 else abs(stiff) + 1e-9)
    else:
        copy(residual, step)
        if symmetric and is_positive(stiffness, 0.0, unit, work):
            substitute(work, step)
        else:
            copy_rows(stiffness, work)
            solve(work, step)
    longest = 0.0
    for i in range(n):
        longest = max(longest, abs(step[i]) * unit[i])
    return max_turn / longest if longest > max_turn else 1.0


@njit(cache=True, error_model="numpy")
def _equilibrium(chain, now, q, memory, frame, square, lines, options, guessed):  # type: ignore[no-untyped-def]
    """Move q to equilibrium; return whether it was reached. Frame and new memory are those at q.

    From a guess the way is short, and would end at the tolerance: a step or two more end as near as the way from the
    step before. Where no equilibrium was reached, q and the memory are those before the step: what comes next begins
    there.
    """
    apart()
    before, old, new, _ = kept(memory)
    max_iterations = kept(options)[1]
    least, stalls, relaxed = CLOSER_STEPS if guessed else 0, MOST_STALLS, False
    while True:  # from a guess, from the step before, and there at last with every patience
        if _newton(chain, now, q, memory, frame, square, lines, options, least, stalls):
            return True
        copy(before, q)
        if least > 0:
            least = 0
            continue
        if relaxed:
            break
        if _relax(chain, now, q, memory, frame, square, lines, options):
            return True
        copy(before, q)
        stalls, relaxed = max_iterations, True
    _balance(chain, now, q, memory, frame)
    copy(old, new)
    return False


@njit(cache=True, error_model="numpy")
def _relax(chain, now, q, memory, frame, square, lines, options):  # type: ignore[no-untyped-def]
    """Run Newton's method damped as an overdamped motion with increasing steps; return whether it converged.

    Pseudo-transient continuation with switched evolution (Kelley & Keyes, SIAM J. Numer. Anal. 35, 1998): slow, but
    it follows a long chain through curls and snaps, in which the residual must grow before it falls.
    """
    apart()
    tolerance, _, _, unit = kept(options)
    stiffness, work = kept(square)
    step, _ = kept(lines)
    before, residual = kept(memory)[0], kept(frame)[5]
    size = _balance(chain, now, q, memory, frame)
    damping = size / RELAX_TURN
    for _ in range(RELAX_ITERATIONS):
        if size <= tolerance or not np.isfinite(size):
            break
        symmetric = _stiffen(chain, now, q, memory, frame, stiffness)
        shift = damping
        while not is_positive(stiffness, shift, unit, work) and shift < 1e12:
            shift = 2.0 * shift + 1e-12
        for i in range(len(q)):
            stiffness[i, i] += shift * unit[i]
        scale = _step(stiffness, symmetric, residual, step, work, options)
        turned = 0.0
        for i in range(len(q)):
            q[i] += scale * step[i]
            turned = max(turned, abs(q[i] - before[i]) * unit[i])
        if turned > MOST_TURNED:
            return False
        reached = _balance(chain, now, q, memory, frame)
        damping *= min(max(reached / size, 0.1), 2.0)
        size = reached
    return size <= tolerance


@njit(cache=True, forceinline=True, error_model="numpy")
def _dot(a, b):  # type: ignore[no-untyped-def]
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@njit(cache=True, forceinline=True, error_model="numpy")
def _shorter(along, there):  # type: ignore[no-untyped-def]
    """Share of a step at whose end the residual does the work `there` along it: where a straight line has none."""
    share = along / (along - there) if along > 0.0 and there < 0.0 else 0.5
    return min(max(share, LEAST_SHARE), 0.5)


@njit(cache=True, error_model="numpy")
def _newton(chain, now, q, memory, frame, square, lines, options, least, most_stalls):  # type: ignore[no-untyped-def]
    """Move q toward equilibrium; return whether it was reached. Frame and new memory are those at q.

    In its first `least` steps it aims closer than the tolerance. It gives up after `most_stalls` steps that help at
    no length.
    """
    tolerance, max_iterations, _, _ = kept(options)
    stiffness, work = kept(square)
    step, trial = kept(lines)
    residual = kept(frame)[5]
    size, aim = _balance(chain, now, q, memory, frame), CLOSER * tolerance
    iteration = stalls = 0
    while (
        (size > tolerance or (size > aim and iteration < least))
        and iteration < max_iterations
        and stalls < most_stalls
        and np.isfinite(size)
    ):
        iteration += 1
        symmetric = _stiffen(chain, now, q, memory, frame, stiffness)
        scale = _step(stiffness, symmetric, residual, step, work, options)
        along = _dot(residual, step)
        # A step that makes the balance worse is cut, a few times: kinks and backward slopes.
        reached = size
        for _ in range(MAX_HALVINGS):
            for i in range(len(q)):
                trial[i] = q[i] + scale * step[i]
            reached = _balance(chain, now, trial, memory, frame)
            if reached < size or reached <= tolerance:
                break
            scale *= _shorter(along, _dot(residual, step))
        if not (reached < size or reached <= tolerance):
            stalls += 1
        copy(trial, q)
        size = reached
    return size <= tolerance


@njit(cache=True, error_model="numpy")
def _leave_saddle(chain, now, q, memory, frame, square, lines, options):  # type: ignore[no-untyped-def]
    """Move q from a saddle, with the stiffness in `square`, to a stable equilibrium.

    The mode of steepest descent is found by power iteration; of its two directions the one is taken in which the
    residual does more work. Returns whether q has moved; frame and new memory are those at q.
    """
    apart()
    _, _, max_turn, unit = kept(options)
    stiffness, work = kept(square)
    mode, start = kept(lines)
    residual, n = kept(frame)[5], len(q)
    largest = 0.0
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += abs(stiffness[i, j])
        largest = max(largest, total)
    if not np.isfinite(largest) or is_positive(stiffness, NEUTRAL * largest, unit, work):
        return False
    for i in range(n):
        mode[i] = 1.0 + 0.3 * (i % 3) - 0.1 * (i % 7)
    curvature = 0.0
    for _ in range(MODE_STEPS):
        longest = 0.0
        for i in range(n):
            start[i] = largest * mode[i]
            for j in range(n):
                start[i] -= stiffness[i, j] * mode[j]
            longest = max(longest, abs(start[i]) * unit[i])
        for i in range(n):
            mode[i] = start[i] / longest
    for i in range(n):
        for j in range(n):
            curvature += mode[i] * stiffness[i, j] * mode[j]
    if not curvature < 0.0:
        return False
    copy(q, start)
    best, side = -np.inf, 1.0
    for way in (1.0, -1.0):
        done = 0.0
        for share in (0.5, 1.0):  # Simpson's rule: the residual is zero at the start
            for i in range(n):
                q[i] = start[i] + way * share * PUSH * max_turn * mode[i]
            _balance(chain, now, q, memory, frame)
            for i in range(n):
                done += (4.0 if share < 1.0 else 1.0) * way * residual[i] * mode[i]
        if done > best:
            best, side = done, way
    back = start.copy()
    for i in range(n):
        q[i] = start[i] + side * PUSH * max_turn * mode[i]
    if _relax(chain, now, q, memory, frame, square, lines, options):
        return True
    copy(back, q)
    _balance(chain, now, q, memory, frame)
    return False


@njit(cache=True, error_model="numpy")
def _differentiate(chain, then, now, q, memory, past, frame, square, lines, spare, positive):  # type: ignore[no-untyped-def]
    """Compute first-order changes of q and of the memory for small changes of parameters, inputs and past.

    `then` contains the changed model, gravity, inputs and loads; `past` the changes of the past, which are overwritten
    by those of the present. `square` contains the stiffness and, if it is positive, its factor.
    """
    apart()
    model_handle, _, p, _, _, _, t = kept(then)
    before, old, new, states = kept(memory)
    before_v, old_v = kept(past)
    stiffness, work = kept(square)
    right, moved, scratch = kept(lines)[1], kept(spare)[0], kept(spare)[1]
    dt, n_axes = kept(now)[6], len(q) // len(kept(chain)[1])
    terms, _, _, _, signs, _, drives, _ = kept(model_handle)
    _misfit(chain, then, now, q, memory, past, frame, lines, spare)
    if positive:
        substitute(work, right)
    else:
        copy_rows(stiffness, work)
        solve(work, right)
    for i in range(len(q)):
        if states:
            joint, at = i // n_axes, i * states
            net = joint_net_input(signs, drives, joint, p)
            for s in range(states):
                moved[s] = old[at + s] + old_v[at + s]
            combine(terms, joint, q[i] + right[i], before[i] + before_v[i], dt, net, t, moved, 0, scratch, 0)
            for s in range(states):
                old_v[at + s] = scratch[s] - new[at + s]
        before_v[i] = right[i]


@njit(cache=True, forceinline=True, error_model="numpy")
def _mix(value, previous, share, begins):  # type: ignore[no-untyped-def]
    """Interpolate linearly from the last sample to this one; from zero at the start of a run."""
    return share * value if begins else share * value + (1.0 - share) * previous


@njit(cache=True, forceinline=True, error_model="numpy")
def _drive(drive, sample, share, begins, p, f):  # type: ignore[no-untyped-def]
    """Fill pressures and tip force part of the way to a sample; return moment, payload and temperature there."""
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
    """Fill the guess on the straight line through the last two steps."""
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
    """Run the loop of `follow` over arrays of its caller."""
    apart()
    model, keeps, laws, body, gravity, drive, clock, others, options, space = lent(
        (model, keeps, laws, body, gravity, drive, clock, others, options, space)
    )
    duration, start, specimen, _, substeps, (numbers_of_run, numbers_of_run_v) = clock
    bases = body[1]
    numbers_v, gravity_v, pressure_v, force_v, moment_v, payload_v, temperature_v = others
    results, angles, memories, changes, places, scratch, square, rows, spare, inputs = space
    q_all, dq_all, converged = results
    q, before, earlier, guess = angles
    old, new, kept = memories
    before_v, old_v, kept_v = changes
    frame, lines = keep((*places, rows[0], rows[1], *scratch)), keep((rows[2], rows[3]))
    p, p_v, f, f_v = inputs
    chain = keep((keep(model), laws, body, gravity))
    stiffness, factor = square
    square, spare, unit, options = keep(square), keep(spare), options[3], keep(options)
    n_samples, n, states, n_changes = len(start), len(q), len(keeps), len(numbers_v)
    memory = keep((before, old, new, states))
    positive = False
    last_dt, trusted, buckles = np.inf, False, n > len(laws)  # out of the plane in which it is loaded
    run = -1
    for sample in range(n_samples):
        begins, owner = start[sample], specimen[sample]
        if begins:
            q[:], before[:], earlier[:], before_v[:] = 0.0, 0.0, 0.0, 0.0
            copy(kept[owner], old)
            copy_rows(kept_v[owner], old_v)
            trusted = False
            run += 1
            if len(numbers_of_run):
                copy(numbers_of_run[run], model[0][2])
                for k in range(n_changes):
                    copy(numbers_of_run_v[k, run], numbers_v[k])
            for i in range(n):
                for s in range(states):
                    if not keeps[s]:
                        old[i * states + s], old_v[:, i * states + s] = 0.0, 0.0
        parts = RAMP_STEPS if begins else substeps[sample]
        dt = np.inf if begins else duration[sample] / parts
        for part in range(1, parts + 1):
            share = part / parts
            opposed, hung, t = _drive(drive, sample, share, begins, p, f)
            now = keep((bases[sample], p, f, opposed, hung, t, dt))
            stretch = dt / last_dt if last_dt > 0.0 and np.isfinite(last_dt) and np.isfinite(dt) else 1.0
            _extrapolate(q, before, earlier, stretch, guess)
            guessed = trusted and _distance(guess, before) > 0.0
            if guessed:
                copy(guess, q)
            known = False
            if not _equilibrium(chain, now, q, memory, frame, square, lines, options, guessed):
                converged[sample] = False
            elif buckles:
                symmetric = _stiffen(chain, now, q, memory, frame, stiffness)
                positive, known = symmetric and is_positive(stiffness, 0.0, unit, factor), True
                if symmetric and not positive:
                    _leave_saddle(chain, now, q, memory, frame, square, lines, options)
                    known = False
            trusted = _distance(q, guess) < _distance(q, before)
            if n_changes:
                if not known:
                    symmetric = _stiffen(chain, now, q, memory, frame, stiffness)
                    positive = symmetric and is_positive(stiffness, 0.0, unit, factor)
                for k in range(n_changes):
                    drive_v = (pressure_v[k], force_v[k], moment_v[k], payload_v[k], temperature_v[k])
                    opposed_v, hung_v, t_v = _drive(drive_v, sample, share, begins, p_v, f_v)
                    terms_v = (model[0][0], model[0][1], numbers_v[k], model[0][3])
                    tables = (model[1], model[2], model[3], model[4], model[5], model[6], model[7])
                    other = keep((terms_v,) + tables)
                    then = keep((other, gravity_v[k], p_v, f_v, opposed_v, hung_v, t_v))
                    past = keep((before_v[k], old_v[k]))
                    _differentiate(chain, then, now, q, memory, past, frame, square, lines, spare, positive)
            copy(before, earlier)
            copy(q, before)
            copy(new, old)
            last_dt = dt
        copy(q, q_all[sample])
        copy_rows(before_v, dq_all[:, sample])
        copy(old, kept[owner])
        copy_rows(old_v, kept_v[owner])


@njit(cache=True, forceinline=True, error_model="numpy")
def _space(n, states, n_samples, n_changes, n_specimens, m):  # type: ignore[no-untyped-def]
    """Return arrays of a loop over n coordinates that both kinds of chains need."""
    results = (
        np.zeros((n_samples, n)),
        np.zeros((n_changes, n_samples, n)),
        np.ones(n_samples, dtype=np.bool_),
    )
    angles = (np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n))
    memories = (np.zeros(n * states), np.zeros(n * states), np.zeros((n_specimens, n * states)))
    kept_v = np.zeros((n_specimens, n_changes, n * states))
    changes = (np.zeros((n_changes, n)), np.zeros((n_changes, n * states)), kept_v)
    square = (np.zeros((n, n)), np.zeros((n, n)))
    rows = (np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n))
    inputs = (np.zeros(m), np.zeros(m), np.zeros(3), np.zeros(3))
    return results, angles, memories, changes, square, rows, inputs


@njit(cache=True, nogil=True, error_model="numpy")
def follow(model, keeps, laws, body, gravity, drive, clock, others, options):  # type: ignore[no-untyped-def]
    """Follow a chain of n hinges through N samples of all runs, one after another.

    Newton's method starts from the linear extrapolation of the last two steps if that was closer last time, else from
    the last step.

    Args:
        model: terms of `CompiledTerms.arrays`; cells, grid, size (cells by actuation and by angle) of `LawTable`; signs
            of the actuators; whether a term has another role than `moment`; `drives` of `CompiledLaws`; laws of
            several actuations: addresses, spans, parameters, α and γ (see `JointLaw.unwrap`), zeros, space.
        keeps: (states,) whether a memory outlasts the rest between runs.
        laws: (n,) which table each joint has, or which law of several actuations.
        body: position, bases (N, 3, 3), offsets, rests, which rests are the identity (n,), arms, masses: see `Body`;
            the third axis of its frames is that of the hinges.
        gravity: (3,).
        drive: pressure (N, m), force (N, 3), moment (N,), payload (N,), temperature (N,).
        clock: duration (N,), start (N,), specimen (N,), number of specimens, substeps (N,); the terms' numbers by run,
            (R, n·P) and (K, R, n·P) of the variations, or R = 0 if those of `model` and `others` hold for all runs.
        others: numbers, gravity and the five arrays of `drive` of K variations, stacked.
        options: tolerance, iterations, longest turn of a joint in one of them; (n,) factors from coordinates to turns.

    Returns:
        q (N, n), its changes (K, N, n) to first order, and whether each sample converged (N,).
    """
    n, states = len(laws), len(keeps)
    space = _space(n, states, len(clock[1]), len(others[0]), clock[3], len(model[4]))
    results, angles, memories, changes, square, rows, inputs = space
    places = (np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n + 1, 3)), np.zeros((n, 3)))
    scratch, spare = (
        (np.zeros((n, 4)), np.zeros(states)),
        (np.zeros(states), np.zeros(states), np.zeros((n, 3))),
    )
    whole = (results, angles, memories, changes, places, scratch, square, rows, spare, inputs)
    _walk(model, keeps, laws, body, gravity, drive, clock, others, options, whole)
    return results


@njit(cache=True, forceinline=True, error_model="numpy")
def _parts(n, a):  # type: ignore[no-untyped-def]
    return np.zeros((n, a)), np.zeros((n, a)), np.zeros((n, a, a)), np.zeros((n, a, a)), np.zeros((n, a))


@njit(cache=True, nogil=True, error_model="numpy")
def follow_spatial(model, keeps, laws, body, gravity, drive, clock, others, options):  # type: ignore[no-untyped-def]
    """Follow a chain of any joints with a coordinates each, as `follow`: q (N, n·a), changes (K, N, n·a).

    Args:
        model: see `joint_effort`; body: see `spatial_chain`; laws: (n,) which law each joint has.
        keeps, gravity, drive, clock, others, options: as `follow` takes them.
    """
    n, a, states, m = len(laws), len(body[2]), len(keeps), len(model[4])
    space = _space(n * a, states, len(clock[1]), len(others[0]), clock[3], m)
    results, angles, memories, changes, square, rows, inputs = space
    places = (new_frame(n, a, m), new_factor(n, a, 3), 0, 0)
    scratch = (_parts(n, a), np.zeros(states))
    spare = (np.zeros(states), np.zeros(n * a * states), _parts(n, a))
    whole = (results, angles, memories, changes, places, scratch, square, rows, spare, inputs)
    _walk(model, keeps, laws, body, gravity, drive, clock, others, options, whole)
    return results


discard_stale(Path(follow.stats.cache_path), SOURCES)


def is_compiled(spatial: bool = False) -> bool:
    """Return whether up-to-date machine code of the loop exists, in this process or in numba's cache."""
    loop = follow_spatial if spatial else follow
    if loop.signatures:
        return True
    source = max(path.stat().st_mtime for path in SOURCES)
    cached = Path(loop.stats.cache_path).glob(f"kernel.{loop.__name__}-*.nbc")
    return any(file.stat().st_mtime >= source for file in cached)
