"""States at the start of runs: from first readings, at rest under the first inputs, or as the MJCF states them.

The state of rest is the nearest stable equilibrium (`pliant_mjcf.equilibrium`). Where contacts or dry friction act, it
is reached by dynamic relaxation with kinetic damping: the model moves under its own forces, and all velocities are set
to zero whenever the kinetic energy begins to fall (Barnes, Computers & Structures 33, 1989).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from pliant.errors import UserError, closest
from pliant.records.design import Array
from pliant_mjcf.channels import Read
from pliant_mjcf.config import FIRST, SETTLED
from pliant_mjcf.equilibrium import settle
from pliant_mjcf.mjcf import SCALAR_JOINTS, names_of

STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)
SETTLING_S = 20.0  # longest simulated time of a relaxation
# Largest acceleration at rest, relative to the largest at the beginning, and what contacts may leave of it.
AT_REST, NEARLY_AT_REST = 1e-9, 1e-3
FILTERS = (
    int(mujoco.mjtDyn.mjDYN_FILTER),
    int(mujoco.mjtDyn.mjDYN_FILTEREXACT),
    int(mujoco.mjtDyn.mjDYN_MUSCLE),
)

# What a study may state: a word, a keyframe, positions by joint, or nothing.
Initial = str | Mapping[str, float] | None


def check_initial(where: str, initial: Initial, model: Any) -> None:
    """Raise `UserError` for an unknown keyframe or joint."""
    if isinstance(initial, str) and initial not in (FIRST, SETTLED):
        keys = [name for name in names_of(model, "key") if name]
        if initial not in keys:
            known = [FIRST, SETTLED, *keys]
            raise UserError(
                f"{where}: 'initial' is '{initial}', which is no keyframe; it may be {', '.join(known)}, or "
                f"{{joint: position}}{closest(initial, known)}"
            )
    if isinstance(initial, Mapping):
        joints = [model.joint(k).name for k in range(model.njnt) if int(model.jnt_type[k]) in SCALAR_JOINTS]
        for name in initial:
            if name not in joints:
                raise UserError(
                    f"{where}: 'initial' names joint '{name}'; the hinges and slides are "
                    f"{', '.join(filter(None, joints)) or 'none'}{closest(name, joints)}"
                )


def start_state(
    model: Any, initial: Initial, first: Mapping[str, float], reads: Sequence[Read], control: Array
) -> Array:
    """Return the state of a run's start, for `mj_setState` with mjSTATE_INTEGRATION.

    Args:
        model: the compiled model.
        initial: what the study states; None: the first readings where all joints are read, else at rest.
        first: the first readings by output.
        reads: the outputs.
        control: (nu,) the first inputs.
    """
    data = mujoco.MjData(model)
    read = _read_joints(model, first, reads)
    if isinstance(initial, str) and initial not in (FIRST, SETTLED):
        mujoco.mj_resetDataKeyframe(model, data, model.key(initial).id)
        hold_inputs(model, data, control, activations=False)
        data.time = 0.0
        return state_of(model, data)
    if isinstance(initial, Mapping):
        read = {int(model.jnt_qposadr[model.joint(name).id]): value for name, value in initial.items()}
        return _posed(model, data, read, {}, control)
    by_readings = bool(read) if initial == FIRST else initial is None and len(read) == model.nq
    if by_readings:
        return _posed(model, data, read, _read_joints(model, first, reads, velocities=True), control)
    return _settled(model, data, control)


def state_of(model: Any, data: Any) -> Array:
    """Return the state of data as one row; delayed sensors have always read what they read now."""
    delayed = np.flatnonzero(model.sensor_history[:, 0])
    if len(delayed):
        prompt, now = model.__copy__(), mujoco.MjData(model)
        prompt.sensor_delay[:] = 0.0
        now.qpos[:], now.qvel[:], now.act[:], now.ctrl[:] = data.qpos, data.qvel, data.act, data.ctrl
        mujoco.mj_forward(prompt, now)
    for k in delayed.tolist():
        values = now.sensordata[model.sensor_adr[k] : model.sensor_adr[k] + model.sensor_dim[k]]
        past = np.tile(values, (int(model.sensor_history[k][0]), 1))
        mujoco.mj_initSensorHistory(model, data, k, None, past, 0.0)
    state = np.empty(mujoco.mj_stateSize(model, STATE))
    mujoco.mj_getState(model, data, state, STATE)
    return state


def _read_joints(
    model: Any, first: Mapping[str, float], reads: Sequence[Read], velocities: bool = False
) -> dict[int, float]:
    """Return the address in qpos, or in qvel, of each joint that was read, with its first reading."""
    addresses = model.jnt_dofadr if velocities else model.jnt_qposadr
    return {
        int(addresses[model.joint(one.joint).id]): first[one.channel.name]
        for one in reads
        if one.joint and one.of_velocity == velocities and one.channel.name in first
    }


def _posed(
    model: Any, data: Any, positions: Mapping[int, float], velocities: Mapping[int, float], control: Array
) -> Array:
    for address, value in positions.items():
        data.qpos[address] = value
    for address, value in velocities.items():
        data.qvel[address] = value
    hold_inputs(model, data, control)
    return state_of(model, data)


def hold_inputs(model: Any, data: Any, control: Array, activations: bool = True) -> None:
    """Let the actuators be as after a long time under these inputs."""
    low, high = model.actuator_ctrlrange.T
    held = np.where(model.actuator_ctrllimited, np.clip(control, low, high), control)
    data.ctrl[:] = held
    mujoco.mj_forward(model, data)
    data.qacc_warmstart[:] = 0.0
    for k in range(model.nu):
        if length := int(model.actuator_history[k][0]):  # a delay
            mujoco.mj_initCtrlHistory(model, data, k, None, np.full((length, 1), held[k]))
        address = int(model.actuator_actadr[k])
        if not activations or address < 0 or model.actuator_actnum[k] != 1:
            continue
        kind = int(model.actuator_dyntype[k])
        if kind in FILTERS:
            data.act[address] = held[k]
        elif kind == int(mujoco.mjtDyn.mjDYN_INTEGRATOR):
            data.act[address] = data.actuator_length[k]
        if model.actuator_actlimited[k]:
            data.act[address] = np.clip(data.act[address], *model.actuator_actrange[k])


def _settled(model: Any, data: Any, control: Array) -> Array:
    """Return the state of rest under constant inputs; that of qpos0 if it is not reached within `SETTLING_S`."""
    hold_inputs(model, data, control)
    beginning = state_of(model, data)
    mujoco.mj_forward(model, data)
    if not model.nv:
        return beginning
    outcome = settle(model, data, AT_REST)
    if outcome != "unknown":
        return _resting(model, data) if outcome == "rest" else beginning
    mujoco.mj_setState(model, data, beginning, STATE)
    mujoco.mj_forward(model, data)
    scale = max(float(np.abs(data.qacc).max()), 1.0)
    energy, residual, released = 0.0, np.inf, True
    for _ in range(int(SETTLING_S / model.opt.timestep)):
        mujoco.mj_step(model, data)
        if data.warning.number.any():
            return beginning
        if released:  # this step began without velocity: its acceleration is the missing balance of forces
            residual = float(np.abs(data.qacc).max()) / scale
            if residual < AT_REST and _is_constant(data):
                break
        now = float(data.qvel @ _momentum(model, data))
        released = now < energy
        if released:
            data.qvel[:] = 0.0
        energy = 0.0 if released else now
    return _resting(model, data) if residual < NEARLY_AT_REST else beginning


def _momentum(model: Any, data: Any) -> Array:
    found = np.empty(model.nv)
    mujoco.mj_mulM(model, data, found, data.qvel)
    return found


def _is_constant(data: Any) -> bool:
    """Return whether the actuators' activations have come to rest."""
    return not len(data.act_dot) or bool(np.abs(data.act_dot).max() < 1e-6)


def _resting(model: Any, data: Any) -> Array:
    """Return the state without velocity and at time zero."""
    data.qvel[:] = 0.0
    data.qacc_warmstart[:] = 0.0
    data.time = 0.0
    return state_of(model, data)
