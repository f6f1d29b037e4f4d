"""Compiled: efforts of a chain's laws as forces at the dofs of a dynamics engine, with their slopes.

A hinge's or slide's dof is its coordinate. A ball's dofs are the angular velocity ω in the child's frame,
dφ/dt = Jᵣ⁻¹ ω, so an effort τ conjugate to φ is the torque there

    Jᵣ⁻ᵀ τ = τ − ½ φ × τ + d (φ (φ·τ) − θ² τ),   d = (1 − (θ/2) cot(θ/2)) / θ².

A slope k of −τ becomes the damping dt · k of the step to come: an engine that takes damping implicitly,
M Δv = dt (τ − dt k v⁺), then takes the stiffness implicitly, and the force itself stays exactly τ.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from pliant_plugins.physics.compiled.efforts import efforts

# Below this angle d cancels; its series to θ⁶ is then exact to rounding.
SMALL_ANGLE = 0.1


@njit(cache=True, nogil=True)
def drive_axes(laws, qpos, p, moment, extra, caution, dt, plain, force, damping):  # type: ignore[no-untyped-def]
    """Fills force and damping (n,) of hinges or slides at qpos (n,).

    Args:
        laws, p: as in `efforts`.
        moment: end moment that opposes actuation.
        extra, caution: the slope is taken as caution · (|k| + extra), extra (n,).
        dt: step to come.
        plain: physical damping of each coordinate.
    """
    n = len(qpos)
    tau, slope = np.empty((n, 1)), np.empty((n, 1, 1))
    efforts(laws, qpos.copy().reshape(n, 1), p, tau, np.empty((len(p), n, 1)), slope)
    for i in range(n):
        force[i] = tau[i, 0] - moment
        damping[i] = plain + dt * caution * (abs(slope[i, 0, 0]) + extra[i])


@njit(cache=True, nogil=True)
def drive_balls(laws, quaternions, axes, main, p, moment, extra, caution, dt, plain, force, damping):  # type: ignore[no-untyped-def]
    """Fills force and damping (n, 3) of balls at unit quaternions (n, 4) w, x, y, z.

    `axes` (3,) are the positions of the law's axes among x, y, z, `main` the column of the main bending axis;
    the rest as in `drive_axes`. Slopes between axes count in full on both.
    """
    n = len(quaternions)
    q, phi = np.empty((n, 3)), np.empty(3)
    for i in range(n):
        rotation_vector(quaternions[i], phi)
        for b in range(3):
            q[i, b] = phi[axes[b]]
    tau, slope = np.empty((n, 3)), np.empty((n, 3, 3))
    efforts(laws, q, p, tau, np.empty((len(p), n, 3)), slope)
    effort = np.empty(3)
    for i in range(n):
        tau[i, main] -= moment
        for b in range(3):
            phi[axes[b]], effort[axes[b]] = q[i, b], tau[i, b]
            row = abs(slope[i, b, b])
            for c in range(3):
                if c != b:
                    row += 0.5 * abs(slope[i, b, c] + slope[i, c, b])
            damping[i, axes[b]] = plain + dt * caution * (row + extra[i])
        to_torque(phi, effort, force[i])


@njit(cache=True, nogil=True)
def rotation_vector(quaternion, phi):  # type: ignore[no-untyped-def]
    """Fills φ (3,) with θ ≤ π of a unit quaternion w, x, y, z of either sign."""
    sign = -1.0 if quaternion[0] < 0.0 else 1.0
    length = math.sqrt(quaternion[1] ** 2 + quaternion[2] ** 2 + quaternion[3] ** 2)
    ratio = 2.0 * sign
    if length > 1e-9:
        ratio = sign * 2.0 * math.atan2(length, sign * quaternion[0]) / length
    for a in range(3):
        phi[a] = ratio * quaternion[a + 1]


@njit(cache=True, nogil=True)
def to_torque(phi, effort, torque):  # type: ignore[no-untyped-def]
    """Fills Jᵣ⁻ᵀ τ (3,), the torque in the child's frame of an effort conjugate to φ."""
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
def drive_arms(laws, arms, axes, p, moments, plain, dt, qpos, force, damping):  # type: ignore[no-untyped-def]
    """Fills force and damping of all arms of a scene in one call, in the engine's own arrays of dofs.

    Args:
        laws: those of all joints, arm after arm; the actuators' signs are common.
        arms: (m, 6) int64: first and last (exclusive) joint, first coordinate, first dof, whether balls, column of
            the main axis.
        axes: (m, 3) as in `drive_balls`.
        p: (m, k) and moments (m,): values of the actuators and end moment of each arm.
        qpos, force, damping: of the whole model.
    """
    addresses, spans, parameters, signs = laws
    for k in range(len(arms)):
        first, last, at, dof = arms[k, 0], arms[k, 1], arms[k, 2], arms[k, 3]
        n = last - first
        own = (addresses[first:last], spans[first:last], parameters, signs)
        none = np.zeros(n)
        if arms[k, 4]:
            f, d = force[dof : dof + 3 * n].reshape(n, 3), damping[dof : dof + 3 * n].reshape(n, 3)
            turns = qpos[at : at + 4 * n].reshape(n, 4)
            drive_balls(own, turns, axes[k], arms[k, 5], p[k], moments[k], none, 1.0, dt, plain, f, d)
        else:
            f, d = force[dof : dof + n], damping[dof : dof + n]
            drive_axes(own, qpos[at : at + n], p[k], moments[k], none, 1.0, dt, plain, f, d)
