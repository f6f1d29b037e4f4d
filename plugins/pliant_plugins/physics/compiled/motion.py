"""Compiled: a chain in MuJoCo through samples of its inputs, with no Python between the steps.

One call runs MuJoCo's own `mj_step` through its address, and the laws and law terms through theirs. It holds no lock
of Python, so several chains move beside each other on threads.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from pliant.mechanics.terms import STEP as SLOPE_STEP
from pliant_plugins.physics.compiled.dof_forces import drive_axes, drive_balls, rotation_vector, to_torque
from pliant_plugins.physics.compiled.efforts import efforts
from pliant_plugins.physics.compiled.functions import TERM_SIGNATURE


@intrinsic
def call_term(typing_context, address, u, rate, dt, actuation, temperature, old, new, c):  # type: ignore[no-untyped-def]
    """Calls the law term at an address."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kinds = [context.get_value_type(kind) for kind in TERM_SIGNATURE.args]
        function = ir.FunctionType(context.get_value_type(types.float64), kinds)
        return builder.call(builder.inttoptr(arguments[0], function.as_pointer()), arguments[1:])

    return types.float64(types.int64, *TERM_SIGNATURE.args), generate


@intrinsic
def call_mujoco(typing_context, address, model, data):  # type: ignore[no-untyped-def]
    """Calls MuJoCo's function at an address with an mjModel* and an mjData*."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        function = ir.FunctionType(ir.VoidType(), [ir.IntType(64)] * 2)
        builder.call(builder.inttoptr(arguments[0], function.as_pointer()), arguments[1:])
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.int64), generate


@njit(cache=True, nogil=True)
def combine(terms, joint, u, before, dt, net, temperature, old, new, found):  # type: ignore[no-untyped-def]
    """Fills found (4,) with Σ moment, Π elastic, Π actuation, Σ rest of one coordinate; `new` is its next memory.

    terms: addresses (m,), rows (m, 5) of role, first and last parameter, first and last state; numbers (n, P) of each
    joint.
    """
    addresses, rows, numbers = terms
    parameters = numbers[joint]
    rate = (u - before) / dt if 0.0 < dt < np.inf else 0.0
    found[0], found[1], found[2], found[3] = 0.0, 1.0, 1.0, 0.0
    for k in range(len(addresses)):
        c, first, last = parameters[rows[k, 1] : rows[k, 2]], rows[k, 3], rows[k, 4]
        value = call_term(addresses[k], u, rate, dt, net, temperature, old[first:last], new[first:last], c)
        role = rows[k, 0]
        if role == 1 or role == 2:
            found[role] *= value
        else:
            found[role] += value


@njit(cache=True, nogil=True)
def coordinates(qpos, ball, axes, q):  # type: ignore[no-untyped-def]
    """Fills q (n, a) from MuJoCo's qpos (n,) or, of balls, (4 n,)."""
    phi = np.empty(3)
    for i in range(len(q)):
        if ball:
            rotation_vector(qpos[4 * i : 4 * i + 4], phi)
            for b in range(3):
                q[i, b] = phi[axes[b]]
        else:
            q[i, 0] = qpos[i]


@njit(cache=True, nogil=True)
def lead(qvel, ball, axes, dt, q):  # type: ignore[no-untyped-def]
    """Moves q (n, a) by dt · dq/dt; of balls dφ/dt = Jᵣ⁻¹ ω, and Jᵣ⁻¹(φ) is Jᵣ⁻ᵀ(−φ)."""
    back, rate = np.empty(3), np.empty(3)
    for i in range(len(q)):
        if ball:
            for b in range(3):
                back[axes[b]] = -q[i, b]
            to_torque(back, qvel[3 * i : 3 * i + 3], rate)
            for b in range(3):
                q[i, b] += dt * rate[axes[b]]
        else:
            q[i, 0] += dt * qvel[i]


@njit(cache=True, nogil=True)
def drive_terms(laws, terms, q, before, old, new, now, dt, tau, slope):  # type: ignore[no-untyped-def]
    """Fills tau (n, a) and its slope (n, a, a) at q with law terms: `JointEfforts.evaluate`.

    before (n, a), old (n, a, s): the memory; now: values of the actuators (k,) and temperature.
    """
    p, temperature = now
    n, a = q.shape
    net = 0.0
    for k in range(len(p)):
        net += laws[3][k] * p[k]
    values, slopes = np.empty((n, a, 4)), np.empty((n, a, 4))
    up, down, bent = np.empty(4), np.empty(4), q.copy()
    for i in range(n):
        for b in range(a):
            known = (before[i, b], dt, net, temperature, old[i, b], new[i, b])
            combine(terms, i, q[i, b] + SLOPE_STEP, *known, up)
            combine(terms, i, q[i, b] - SLOPE_STEP, *known, down)
            combine(terms, i, q[i, b], *known, values[i, b])
            for role in range(4):
                slopes[i, b, role] = (up[role] - down[role]) / (2 * SLOPE_STEP)
            bent[i, b] -= values[i, b, 3]
    none, unused = np.zeros(len(p)), np.empty((len(p), n, a))
    straight, straight_u = np.empty((n, a)), np.empty((n, a, a))
    elastic, elastic_u = np.empty((n, a)), np.empty((n, a, a))
    efforts(laws, q, p, tau, unused, slope)
    efforts(laws, q, none, straight, unused, straight_u)
    efforts(laws, bent, none, elastic, unused, elastic_u)
    for i in range(n):
        for b in range(a):
            v, s = values[i, b], slopes[i, b]
            actuated = tau[i, b] - straight[i, b]
            for c in range(a):
                slope[i, b, c] = v[2] * (slope[i, b, c] - straight_u[i, b, c])
                slope[i, b, c] += v[1] * elastic_u[i, b, c] * (1.0 - slopes[i, c, 3])
            slope[i, b, b] += s[1] * elastic[i, b] + s[2] * actuated + s[0]
            tau[i, b] = v[1] * elastic[i, b] + v[2] * actuated + v[0]


@njit(cache=True, nogil=True)
def force_dofs(q, tau, slope, ball, axes, main, moment, dt, plain, qvel, force, damping):  # type: ignore[no-untyped-def]
    """Fills force and damping of the dofs: T(u*) + h K v and c + h K of `ChainJoints`."""
    n, a = q.shape
    phi, effort, width = np.empty(3), np.empty(3), 3 if ball else 1
    for i in range(n):
        tau[i, main] -= moment
        for b in range(a):
            row = abs(slope[i, b, b])
            for c in range(a):
                if c != b:
                    row += 0.5 * abs(slope[i, b, c] + slope[i, c, b])
            at = axes[b] if ball else 0
            phi[at], effort[at] = q[i, b], tau[i, b]
            damping[width * i + at] = dt * row
        if ball:
            to_torque(phi, effort, force[3 * i : 3 * i + 3])
        else:
            force[i] = effort[0]
    for i in range(width * n):
        force[i] += damping[i] * qvel[i]
        damping[i] += plain


@njit(cache=True, nogil=True)
def drive_step(laws, terms, joints, views, drive, options, memory):  # type: ignore[no-untyped-def]
    """Fills force and damping of a chain with law terms for the step to come, with loads as they are during it.

    Args:
        laws, terms: as in `efforts` and `combine`.
        joints: as in `move`.
        views: into the engine: qpos, qvel, force, damping of the chain.
        drive: values of the actuators (k,), end moment, temperature.
        options: step, damping of the joints.
        memory: as in `move`, before the step.
    """
    ball, axes, main = joints
    qpos, qvel, force, damping = views
    p, moment, temperature = drive
    dt, plain = options
    before, states = memory
    n, a = before.shape
    q, tau, slope = np.empty((n, a)), np.empty((n, a)), np.empty((n, a, a))
    coordinates(qpos, ball, axes, q)
    lead(qvel, ball, axes, dt, q)
    drive_terms(laws, terms, q, before, states, states.copy(), (p, temperature), dt, tau, slope)
    force_dofs(q, tau, slope, ball, axes, main, moment, dt, plain, qvel, force, damping)


@njit(cache=True, nogil=True)
def remember_step(laws, terms, joints, qpos, drive, dt, memory):  # type: ignore[no-untyped-def]
    """Brings the memory to the end of a step that ended at qpos; arguments as in `drive_step`."""
    ball, axes, _ = joints
    p, _, temperature = drive
    before, states = memory
    n, a = before.shape
    q, new, found = np.empty((n, a)), states.copy(), np.empty(4)
    coordinates(qpos, ball, axes, q)
    net = 0.0
    for j in range(len(p)):
        net += laws[3][j] * p[j]
    for i in range(n):
        for b in range(a):
            known = (before[i, b], dt, net, temperature, states[i, b], new[i, b])
            combine(terms, i, q[i, b], *known, found)
    states[:], before[:] = new, q


@njit(cache=True, nogil=True)
def move(mujoco, laws, terms, joints, views, drive, counts, options, memory, record):  # type: ignore[no-untyped-def]
    """Goes through t samples in steps of one length; each sample's inputs hold for all steps that lead to it.

    Args:
        mujoco: addresses of mj_step, mj_kinematics, the model and the data.
        laws, terms: as in `efforts` and `combine`.
        joints: whether balls, `axes` (3,) and `main` as in `drive_balls`.
        views: into the engine: qpos, qvel, force, damping of the chain, tip force (3,), positions of bodies (b, 3).
        drive: values of actuators (t, k), end moments (t,), tip forces (t, 3), temperatures (t,).
        counts: (t,) steps to each sample.
        options: step, damping of the joints, share of its velocity that a step keeps.
        memory: coordinates (n, a) at the last step and states (n, a, s), both updated.
        record: qpos (t, …) and positions of bodies (t, b, 3) at the samples, to be filled; the latter may be empty.
    """
    step, kinematics, model, data = mujoco
    ball, axes, main = joints
    qpos, qvel, force, damping, tip, places = views
    p, moments, tips, temperatures = drive
    dt, plain, kept = options
    n = len(memory[0])
    none, own = np.zeros(n), (qpos, qvel, force, damping)
    for k in range(len(counts)):
        tip[:] = tips[k]
        now = (p[k], moments[k], temperatures[k])
        for _ in range(counts[k]):
            for i in range(len(qvel)):
                qvel[i] *= kept
            if len(terms[0]):
                drive_step(laws, terms, joints, own, now, (dt, plain), memory)
            elif ball:
                turns, f, d = qpos.reshape(n, 4), force.reshape(n, 3), damping.reshape(n, 3)
                drive_balls(laws, turns, axes, main, p[k], moments[k], none, 1.0, dt, plain, f, d)
            else:
                drive_axes(laws, qpos, p[k], moments[k], none, 1.0, dt, plain, force, damping)
            call_mujoco(step, model, data)
            if len(terms[0]):
                remember_step(laws, terms, joints, qpos, now, dt, memory)
        record[0][k] = qpos
        if len(record[1]):
            call_mujoco(kinematics, model, data)
            record[1][k] = places
