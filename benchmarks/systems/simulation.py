"""Places of forces in a simulation of several runs: what they see, and how they push."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from benchmarks.systems.force_equations import Force, Now
from benchmarks.systems.shapes import Array


def push(
    model: Any, data: Sequence[Any], force: tuple[str, list[int], Force], controls: Array, time_s: float
) -> list[Any]:
    """Apply the force of this step to all runs; return the damping that it adds at each run's coordinates."""
    what, chosen, equation = force
    q, v, drive = (one[:, chosen] for one in seen(model, data, what))
    now = Now(q, v, drive, commands(model, controls, what, chosen), time_s, float(model.opt.timestep))
    pushed, damped = (np.broadcast_to(np.asarray(one, float), q.shape) for one in equation(now))
    found: list[Any] = []
    for r, one in enumerate(data):
        one.qfrc_applied[:] = 0.0
        if what == "tendon":
            along = pushed[r] - damped[r] * v[r]
            one.qfrc_applied[:] = tendon_jacobian(model, one)[chosen].T @ along
            found.append(None)
            continue
        dofs = model.jnt_dofadr[chosen]
        one.qfrc_applied[dofs] = pushed[r]
        more = np.zeros(model.nv)
        more[dofs] = damped[r]
        found.append(more)
    return found


def seen(model: Any, data: Sequence[Any], what: str) -> tuple[Array, Array, Array]:
    """Return (r, n) positions, speeds and drives of all joints or tendons."""
    if what == "joint":
        dofs = model.jnt_dofadr
        q = np.array([one.qpos[model.jnt_qposadr] for one in data])
        return q, np.array([d.qvel[dofs] for d in data]), np.array([d.qfrc_actuator[dofs] for d in data])
    own = np.zeros((model.ntendon, model.nu))
    for k in range(model.nu):
        if is_tendon(model, k):
            own[model.actuator_trnid[k, 0], k] = model.actuator_gear[k, 0]
    q, v = np.array([d.ten_length for d in data]), np.array([d.ten_velocity for d in data])
    return q, v, np.array([own @ d.actuator_force for d in data])


def commands(model: Any, controls: Array, what: str, chosen: Sequence[int]) -> Array:
    """Return (r, n) the command of the actuator at each place; 0 without one."""
    found = np.zeros((len(controls), len(chosen)))
    for k in range(model.nu):
        if is_tendon(model, k) == (what == "tendon") and model.actuator_trnid[k, 0] in chosen:
            found[:, list(chosen).index(int(model.actuator_trnid[k, 0]))] = controls[:, k]
    return found


def drive_gains(model: Any, chosen: Sequence[int], tendon: bool) -> Array:
    found = np.zeros(len(chosen))
    for k in range(model.nu):
        if is_tendon(model, k) == tendon and model.actuator_trnid[k, 0] in chosen:
            found[list(chosen).index(int(model.actuator_trnid[k, 0]))] = model.actuator_gainprm[k, 0]
    return found


def is_tendon(model: Any, actuator: int) -> bool:
    return bool(model.actuator_trntype[actuator] == mujoco.mjtTrn.mjTRN_TENDON)


def tendon_jacobian(model: Any, data: Any) -> Array:
    dense = np.zeros((model.ntendon, model.nv))
    for k in range(model.ntendon):
        start, count = int(model.ten_J_rowadr[k]), int(model.ten_J_rownnz[k])
        dense[k, model.ten_J_colind[start : start + count]] = data.ten_J[start : start + count]
    return dense
