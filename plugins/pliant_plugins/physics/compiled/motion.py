"""Compiled: efforts of a chain as forces at MuJoCo's dofs, and whole motions without Python between the steps.

A hinge's or slide's dof is its coordinate. A ball's dofs are the angular velocity ω in the child's frame,
dφ/dt = Jᵣ⁻¹ ω, so an effort τ conjugate to φ is the torque there

    Jᵣ⁻ᵀ τ = τ − ½ φ × τ + d (φ (φ·τ) − θ² τ),   d = (1 − (θ/2) cot(θ/2)) / θ².

A slope k of −τ becomes the damping dt · k of the step to come: an engine that takes damping implicitly,
M Δv = dt (τ − dt k v⁺), then takes the stiffness implicitly, and the force itself stays exactly τ.

`move` calls MuJoCo's `mj_step`, the laws and the law terms by their addresses. It releases Python's lock, so that
several chains move in parallel threads.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from pliant.mechanics.terms import STEP as SLOPE_STEP
from pliant_plugins.physics.compiled.arrays import copy, copy_rows
from pliant_plugins.physics.compiled.efforts import efforts
from pliant_plugins.physics.compiled.terms import combine, joint_net_input

# Below this angle d cancels; its series to θ⁶ is then exact to rounding.
SMALL_ANGLE = 0.1


@intrinsic
def call_mujoco(typing_context, address, model, data):  # type: ignore[no-untyped-def]
    """Call MuJoCo's function at an address with an mjModel* and an mjData*."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        function = ir.FunctionType(ir.VoidType(), [ir.IntType(64)] * 2)
        builder.call(builder.inttoptr(arguments[0], function.as_pointer()), arguments[1:])
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.int64), generate


@njit(cache=True, nogil=True)
def rotation_vector(quaternion, phi):  # type: ignore[no-untyped-def]
    """Fill φ (3,) with θ ≤ π of a unit quaternion w, x, y, z of either sign."""
    sign = -1.0 if quaternion[0] < 0.0 else 1.0
    length = math.sqrt(quaternion[1] ** 2 + quaternion[2] ** 2 + quaternion[3] ** 2)
    ratio = 2.0 * sign
    if length > 1e-9:
        ratio = sign * 2.0 * math.atan2(length, sign * quaternion[0]) / length
    for a in range(3):
        phi[a] = ratio * quaternion[a + 1]


@njit(cache=True, nogil=True)
def to_torque(phi, effort, torque):  # type: ignore[no-untyped-def]
    """Fill Jᵣ⁻ᵀ τ (3,), the torque in the child's frame of an effort conjugate to φ."""
    square = phi[0] ** 2 + phi[1] ** 2 + phi[2] ** 2
    if square < SMALL_ANGLE**2:
        d = 1 / 12 + square / 720 + square**2 / 30240 + square**3 / 1209600
    else:
        half = 0.5 * math.sqrt(square)
        d = (1.0 - half / math.tan(half)) / square
    along = phi[0] * effort[0] + phi[1] * effort[1] + phi[2] * effort[2]
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        turned = phi[b] * effort[c] - phi[c] * effort[b]
        torque[a] = effort[a] - 0.5 * turned + d * (phi[a] * along - square * effort[a])


@njit(cache=True, nogil=True)
def coordinates(qpos, ball, axes, q):  # type: ignore[no-untyped-def]
    """Fill q (n, a) from MuJoCo's qpos (n,) or, of balls, (4 n,), of balls with a slide (5 n,)."""
    phi = np.empty(3)
    n, a = q.shape
    for i in range(n):
        if ball:
            at = (a + 1) * i
            rotation_vector(qpos[at : at + 4], phi)
            for b in range(3):
                q[i, b] = phi[axes[b]]
            if a > 3:
                q[i, 3] = qpos[at + 4]
        else:
            q[i, 0] = qpos[i]


@njit(cache=True, nogil=True)
def lead(qvel, ball, axes, dt, q):  # type: ignore[no-untyped-def]
    """Move q (n, a) by dt · dq/dt; of balls dφ/dt = Jᵣ⁻¹ ω, and Jᵣ⁻¹(φ) is Jᵣ⁻ᵀ(−φ)."""
    back, rate = np.empty(3), np.empty(3)
    n, a = q.shape
    for i in range(n):
        if ball:
            for b in range(3):
                back[axes[b]] = -q[i, b]
            to_torque(back, qvel[a * i : a * i + 3], rate)
            for b in range(3):
                q[i, b] += dt * rate[axes[b]]
            if a > 3:
                q[i, 3] += dt * qvel[a * i + 3]
        else:
            q[i, 0] += dt * qvel[i]


@njit(cache=True, nogil=True)
def drive_terms(laws, terms, q, before, old, new, now, dt, tau, slope):  # type: ignore[no-untyped-def]
    """Fill tau (n, a) and its slope (n, a, a) at q with law terms: `JointEfforts.evaluate`.

    before (n, a), old (n·a·s,): the memory; now: values of the actuators (k,) and temperature.
    """
    p, temperature = now
    n, a = q.shape
    states = len(old) // (n * a)
    values, slopes, bent = np.empty((n, a, 4)), np.empty((n, a, 4)), q.copy()
    for i in range(n):
        net = joint_net_input(laws[3], laws[4], i, p)
        for b in range(a):
            at = (i * a + b) * states
            known = (before[i, b], dt, net, temperature, old, at, new, at)
            up = combine(terms, i, q[i, b] + SLOPE_STEP, *known)
            down = combine(terms, i, q[i, b] - SLOPE_STEP, *known)
            value = combine(terms, i, q[i, b], *known)
            for role in range(4):
                values[i, b, role], slopes[i, b, role] = (
                    value[role],
                    (up[role] - down[role]) / (2 * SLOPE_STEP),
                )
            bent[i, b] -= value[3]
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
def drive(laws, terms, joints, views, inputs, options, extra, memory):  # type: ignore[no-untyped-def]
    """Fill force and damping of a chain's dofs for the next step, with the loads during it.

    With law terms these are T(u*) + h K v and c + h K of `ChainJoints`; slopes between axes count in full on both.

    Args:
        laws, terms: as in `efforts` and `combine`; `terms` may be empty.
        joints: whether balls; positions of the law's axes among x, y, z (3,); the column of the main bending axis; the
            extension that counts as much as a turn of 1 rad, of balls with a slide.
        views: into the engine: qpos, qvel, force, damping of the chain.
        inputs: values of the actuators (k,), end moment that opposes actuation, temperature.
        options: step to come, physical damping of each coordinate, caution.
        extra: (n,) the slope is taken as caution · (|k| + extra), of extensions caution · (|k| + extra / reach²).
        memory: coordinates (n, a) at the last step and states (n·a·s,) of the terms.
    """
    ball, axes, main, reach = joints
    qpos, qvel, force, damping = views
    p, moment, temperature = inputs
    dt, plain, caution = options
    before, states = memory
    n, a = before.shape
    q, tau, slope = np.empty((n, a)), np.empty((n, a)), np.empty((n, a, a))
    coordinates(qpos, ball, axes, q)
    timed = len(terms[0]) > 0
    if timed:
        lead(qvel, ball, axes, dt, q)
        drive_terms(laws, terms, q, before, states, states.copy(), (p, temperature), dt, tau, slope)
    else:
        efforts(laws, q, p, tau, np.empty((len(p), n, a)), slope)
    phi, effort, width = np.empty(3), np.empty(3), a
    for i in range(n):
        tau[i, main] -= moment
        for b in range(a):
            row, own = abs(slope[i, b, b]), reach if b == 3 else 1.0
            for c in range(a):
                if c != b:
                    row += 0.5 * abs(slope[i, b, c] + slope[i, c, b]) * ((reach if c == 3 else 1.0) / own)
            if b == 3:
                force[width * i + 3] = tau[i, 3]
                damping[width * i + 3] = dt * caution * (row + extra[i] / (own * own))
                continue
            at = axes[b] if ball else 0
            phi[at], effort[at] = q[i, b], tau[i, b]
            damping[width * i + at] = dt * caution * (row + extra[i])
        if ball:
            to_torque(phi, effort, force[width * i : width * i + 3])
        else:
            force[i] = effort[0]
    for i in range(width * n):
        if timed:
            force[i] += damping[i] * qvel[i]
        damping[i] += plain


@njit(cache=True, nogil=True)
def drive_arms(laws, arms, axes, reaches, p, moments, plain, dt, qpos, force, damping):  # type: ignore[no-untyped-def]
    """Drive all arms of a scene, which have no law terms, in one call of `drive`.

    Args:
        laws: those of all joints, arm after arm; the actuators' signs are common.
        arms: (m, 6) int64: first and last (exclusive) joint, first coordinate, first dof, how many coordinates a joint
            has (3 and 4: balls), column of the main axis.
        axes, reaches: (m, 3) and (m,) as in `drive`.
        p, moments: (m, k) and (m,): values of the actuators and end moment of each arm.
        qpos, force, damping: of the whole model; velocities matter to law terms only.
    """
    addresses, spans, parameters, signs, drives, less = laws
    terms = (np.empty(0, np.int64), np.empty((0, 5), np.int64), np.empty(0), 0)
    for k in range(len(arms)):
        first, last, at, dof, a = arms[k, 0], arms[k, 1], arms[k, 2], arms[k, 3], arms[k, 4]
        n, ball = last - first, a > 1
        own = (
            addresses[first:last],
            spans[first:last],
            parameters,
            signs,
            drives[first:last],
            less[first:last],
        )
        dofs = slice(dof, dof + a * n)
        views = (qpos[at : at + (a + 1 if ball else 1) * n], force[dofs], force[dofs], damping[dofs])
        now, still = (p[k], moments[k], 0.0), (np.zeros((n, a)), np.zeros(0))
        drive(
            own,
            terms,
            (ball, axes[k], arms[k, 5], reaches[k]),
            views,
            now,
            (dt, plain, 1.0),
            np.zeros(n),
            still,
        )


@njit(cache=True, nogil=True)
def remember(laws, terms, joints, qpos, inputs, dt, memory):  # type: ignore[no-untyped-def]
    """Advance the memory to the end of a step that ended at qpos; arguments as in `drive`."""
    ball, axes, _, _ = joints
    p, _, temperature = inputs
    before, states = memory
    n, a = before.shape
    q, new, each = np.empty((n, a)), states.copy(), len(states) // (n * a)
    coordinates(qpos, ball, axes, q)
    for i in range(n):
        net = joint_net_input(laws[3], laws[4], i, p)
        for b in range(a):
            at = (i * a + b) * each
            combine(terms, i, q[i, b], before[i, b], dt, net, temperature, states, at, new, at)
    copy(new, states)
    copy_rows(q, before)


@njit(cache=True, nogil=True)
def move(mujoco, laws, terms, joints, views, inputs, counts, options, memory, record):  # type: ignore[no-untyped-def]
    """Simulate t samples in steps of one length; each sample's inputs apply to all steps that lead to it.

    Args:
        mujoco: addresses of mj_step, mj_kinematics, the model and the data.
        laws, terms, joints: as in `drive`.
        views: into the engine: qpos, qvel, force, damping of the chain, tip force (3,), positions of bodies (b, 3).
        inputs: values of actuators (t, k), end moments (t,), tip forces (t, 3), temperatures (t,).
        counts: (t,) steps to each sample.
        options: step, damping of the joints, share of its velocity that a step keeps.
        memory: as in `drive`, updated.
        record: qpos (t, …) and positions of bodies (t, b, 3) at the samples, to be filled; the latter may be empty.
    """
    step, kinematics, model, data = mujoco
    qpos, qvel, force, damping, tip, places = views
    p, moments, tips, temperatures = inputs
    dt, plain, kept = options
    own, none = (qpos, qvel, force, damping), np.zeros(len(memory[0]))
    for k in range(len(counts)):
        copy(tips[k], tip)
        now = (p[k], moments[k], temperatures[k])
        for _ in range(counts[k]):
            for i in range(len(qvel)):
                qvel[i] *= kept
            drive(laws, terms, joints, own, now, (dt, plain, 1.0), none, memory)
            call_mujoco(step, model, data)
            if len(terms[0]):
                remember(laws, terms, joints, qpos, now, dt, memory)
        copy(qpos, record[0][k])
        if len(record[1]):
            call_mujoco(kinematics, model, data)
            copy_rows(places, record[1][k])
