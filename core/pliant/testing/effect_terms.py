"""Checks of an effect's law terms: memory, time, stability, energy, and equality of the compiled form.

An effect that adds no law term passes them all.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product

import numpy as np

from pliant.interfaces.effect import Model
from pliant.mechanics.efforts import JointEfforts
from pliant.mechanics.inertia import mass_matrix
from pliant.pipeline.engine_checks import require_histories
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import REFERENCE_TEMPERATURE_C, History
from pliant.records.term import LawTerm
from pliant.testing import Subject, agree, require
from pliant.testing.effect_bench import (
    both_ends,
    follower,
    hinge,
    model_inputs,
    probe_motion,
    probe_run,
    sample_model,
    strong,
)
from pliant.testing.histories import HeldMotion, drive, follow_joint, triangles
from pliant.testing.samples import PRESSURE_PA

# Steps that occur: duplicate times, fast logging, 10 Hz, a night, a separate state.
DURATIONS = (0.0, 1e-9, 0.1, 5e4, math.inf)
AGREEMENT_RAD = 1e-5
# Allowed change of a term by refining a run's samples, relative to its largest value.
SAMPLING_SHARE = 0.05
LET_GO_RAD = 0.05
ANGLES_RAD = (-0.3, 0.0, 0.4)


def _value(term: LawTerm, angle: float, rate: float, dt_s: float, old: Array, new: Array) -> float:
    numbers = np.array(term.numbers(0), float)
    return term.function(angle, rate, dt_s, 9e3, REFERENCE_TEMPERATURE_C + 10.0, old, new, numbers)


def _pasts(chain: ChainModel) -> Iterator[tuple[LawTerm, Array]]:
    """Yield each term with states that it reaches during the probe motion."""
    states = drive(chain, probe_motion()).states
    first = 0
    for term in chain.terms:
        for row in states[:: max(1, len(states) // 8)]:
            yield term, row[first : first + term.n_states].copy()
        first += term.n_states


def terms_write_new_and_leave_old(subject: Subject) -> None:
    """a law term writes every number of `new`, never changes `old`, and is finite for any step."""
    for (term, past), dt, angle in product(_pasts(hinge(subject, strong(subject))), DURATIONS, ANGLES_RAD):
        rate = 0.0 if dt == 0.0 or math.isinf(dt) else 1e-3 / dt
        name, old, new = term.function.__name__, past.copy(), np.full(term.n_states, np.nan)
        value = _value(term, angle, rate, dt, old, new)
        require(np.array_equal(old, past), f"'{name}' changed `old` in place")
        gives = (
            f"'{name}' gives {value} and memory {new.tolist()} after a step of {dt:g} s (`new` arrives unset)"
        )
        require(np.isfinite(value) and np.all(np.isfinite(new)), gives)


def terms_that_use_time_say_so(subject: Subject) -> None:
    """a law term that depends on rate, duration or memory has `needs_time=True`."""
    none = np.zeros(0)
    for term in hinge(subject, strong(subject)).terms:
        if term.needs_time:
            continue
        name = term.function.__name__
        memory = f"'{name}' has a memory and needs_time is False: engines without time use it"
        require(term.n_states == 0, memory)
        for angle in ANGLES_RAD:
            slow, fast = (_value(term, angle, *of, none, none) for of in ((0.0, math.inf), (1.0, 0.1)))
            gives = f"'{name}' gives {slow:.6g} at rest and {fast:.6g} in motion, and needs_time is False"
            require(slow == fast, gives)


def terms_remember_in_states_only(subject: Subject) -> None:
    """a law term keeps no memory but its states: the same motion gives the same efforts again."""
    chain = hinge(subject, strong(subject))
    first, again = (drive(chain, probe_motion()) for _ in range(2))
    same = np.array_equal(first.effort, again.effort) and np.array_equal(first.states, again.states)
    cause = "a global or a mutable default"
    require(same, f"the same motion of a rested joint gives other efforts the second time: {cause}")


def terms_are_the_same_compiled(subject: Subject) -> None:
    """compiled, a law term gives what it gives in plain Python; runs of other specimens share no memory."""
    chain = hinge(subject, strong(subject))
    if not chain.terms:
        return
    inputs = model_inputs(Model(chain))
    runs = [probe_run(name, body, inputs=inputs) for name, body in (("1", "a"), ("2", "b"), ("3", "a"))]
    runs.append(probe_run("4", "c", timed=False, inputs=inputs))
    compiled = [f.joint_angles[:, 0, 0] for f in require_histories(follower(subject)).follow(chain, runs)[0]]
    plain = follow_joint(chain, runs)
    for run, there, here in zip(runs, compiled, plain, strict=True):
        where = f"in the engine and in plain Python differ in run {run.run}, specimen {run.specimen}"
        cause = "a global that changes, or a function that only Python has"
        agree(there, here, f"the joint angle (rad) {where}: {cause}", atol=AGREEMENT_RAD)
    if not any(term.keeps for term in chain.terms):
        finding = "a second run of one specimen differs, and no term `keeps`"
        agree(plain[2], plain[0], finding, atol=1e-9)


def terms_keep_the_joint_stable(subject: Subject) -> None:
    """within the plausible range the joint stays stable along a motion: ∂τ'/∂u < 0, so that solvers converge."""
    for values, actuation in product(both_ends(subject), (0.0, 0.6 * PRESSURE_PA)):
        slope = float(drive(hinge(subject, values), probe_motion(actuation)).slope.max())
        reaches = f"∂τ'/∂u reaches {slope:.3g} N·m/rad on the way at {actuation:g} Pa"
        require(slope < 0.0, f"{reaches}: the joint snaps")


def terms_make_no_energy(subject: Subject) -> None:
    """a law term creates no energy: around a repeated cycle of the joint ∮ τ' du ≤ 0."""
    for values, rate, actuation in product(both_ends(subject), (0.5, 0.05), (0.0, 0.6 * PRESSURE_PA)):
        time_s, angle = triangles((0.5, -0.2, 0.0) * 3, rate, 0.01 / rate)
        effort = drive(hinge(subject, values), HeldMotion.from_angles(time_s, angle, actuation)).effort
        last = slice(2 * (len(angle) - 1) // 3, None)
        work = float(np.trapezoid(effort[last], angle[last]))
        passed = float(np.sum(np.abs(effort[last][1:] * np.diff(angle[last]))))
        gives = (
            f"a cycle at {rate:g} rad/s gives {work:.3g} J to the joint ({work / passed:.2g} of what passed)"
        )
        require(work <= 1e-6 * passed, f"{gives}: a sign")


def terms_do_not_count_samples(subject: Subject) -> None:
    """the value of a law term does not depend on how finely a run is sampled."""
    chain = hinge(subject, strong(subject))
    if any(term.is_inertia for term in chain.terms):
        _swings_alike(chain)
        return
    bare, given = sample_model(subject, 1, gravity=(0, 0, 0)).chain, []
    for step_s in (0.1, 0.025):
        time_s, angle = triangles((0.6, -0.2, 0.3), 0.1, step_s, holds_s=3.0)
        own, plain = (
            drive(c, HeldMotion.from_angles(time_s, angle, 9e3, 35.0)).effort for c in (chain, bare)
        )
        given.append((own - plain)[:: round(0.1 / step_s)])
    # At a corner of the motion the rate jumps, and the sample may be on either side of it.
    off = float(np.sort(np.abs(given[1] - given[0]))[:-8].max(initial=0.0))
    largest = float(np.abs(given[0]).max())
    change = f"four times as many samples change the term's part by {off:.3g} N·m of {largest:.3g}"
    how = "the memory must advance with dt_s or with the angle, not with each call"
    require(off <= SAMPLING_SHARE * largest, f"{change}: {how}")


def _swings_alike(chain: ChainModel) -> None:
    """Check a free swing instead, since corners of a prescribed motion would need infinite moments."""
    still = np.zeros((1, 1))
    inertia = float(mass_matrix(chain, still)[0, 0])
    inputs = dict.fromkeys(model_inputs(Model(chain)), 0.0)
    stiffness = -float(JointEfforts(chain).evaluate(still, inputs).dtau_du[0, 0, 0])
    period = 2.0 * math.pi * math.sqrt(inertia / stiffness)
    paths = []
    for samples in (60, 240):
        time_s = np.arange(2 * samples + 1) * period / samples
        load = LET_GO_RAD * stiffness * np.maximum(1.0 - 4.0 * time_s / period, 0.0)
        (path,) = follow_joint(chain, [History.from_arrays(inputs, time_s, moment_n_m=load)])
        paths.append(path[:: samples // 60])
    off, largest = float(np.abs(paths[1] - paths[0]).max()), float(np.abs(paths[0]).max())
    what = f"a swing of {largest:.3g} rad, sampled 60 and 240 times in its period, differs by {off:.3g} rad"
    require(off <= SAMPLING_SHARE * largest, f"{what}: the memory must advance with dt_s, not with each call")
