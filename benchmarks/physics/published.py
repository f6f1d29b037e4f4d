"""The published formulation as a bare PyBullet script, without any of Pliant's engine code: the baseline.

Spherical joints with friction motors, steps of 1/2400 s, and at every step a law evaluated for each joint and
axis, whose efforts, component by component, are handed over as torques. What this script does per step is what
any script of that kind must do; it holds no check, no record and no conversion that could be left out.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from benchmarks.physics.helix import PRESSURE_PA

from pliant.mechanics.rotations import quaternion_of_matrix
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant_plugins.physics.pybullet.loader import load_pybullet

STEP_S = 1 / 2400
RAMP_S, DURATION_S = 1.0, 2.0
MOTOR_N_M = 1e-4
# τ (n, 3) at a pressure and joint angles (n, 3).
Efforts = Callable[[float, Array], Array]


@dataclass(frozen=True, eq=False)
class PublishedRun:
    """Where the 2 s run ended and the CPU time of its steps; loading is not counted."""

    angles_rad: Array
    markers_m: Array
    cpu_s: float


def run(
    chain: ChainModel, efforts: Efforts, load_kg: float, motor_n_m: float = MOTOR_N_M, step_s: float = STEP_S
) -> PublishedRun:
    """1 s of pressure ramp and 1 s of hold from the straight chain.

    Raises:
        MissingDependencyError: PyBullet is not installed.
    """
    pybullet = load_pybullet()
    client = pybullet.connect(pybullet.DIRECT)
    try:
        return _run(pybullet, client, chain, efforts, load_kg, motor_n_m, step_s)
    finally:
        pybullet.disconnect(client)


def _run(
    bullet: Any,
    client: int,
    chain: ChainModel,
    efforts: Efforts,
    load_kg: float,
    motor_n_m: float,
    step_s: float,
) -> PublishedRun:
    body = _load(bullet, client, chain)
    joints = list(range(chain.n_joints))
    tip = chain.n_joints
    bullet.setGravity(*[float(g) for g in chain.gravity_m_s2], physicsClientId=client)
    bullet.setTimeStep(step_s, physicsClientId=client)
    for joint in joints:
        bullet.setJointMotorControlMultiDof(
            body,
            joint,
            bullet.POSITION_CONTROL,
            targetPosition=[0, 0, 0, 1],
            targetVelocity=[0, 0, 0],
            positionGain=0,
            velocityGain=1,
            force=[motor_n_m] * 3,
            physicsClientId=client,
        )
    weight = [0.0, 0.0, -load_kg * float(np.linalg.norm(chain.gravity_m_s2))]
    start = time.process_time()
    for k in range(round(DURATION_S / step_s)):
        pressure = PRESSURE_PA * min(k * step_s / RAMP_S, 1.0)
        states = bullet.getJointStatesMultiDof(body, joints, physicsClientId=client)
        torque = efforts(pressure, rotation_vectors(np.array([state[0] for state in states])))
        bullet.setJointMotorControlMultiDofArray(
            body, joints, bullet.TORQUE_CONTROL, forces=torque.tolist(), physicsClientId=client
        )
        if load_kg:
            at = bullet.getLinkState(body, tip, physicsClientId=client)[4]
            bullet.applyExternalForce(body, tip, weight, at, bullet.WORLD_FRAME, physicsClientId=client)
        bullet.stepSimulation(physicsClientId=client)
    cpu_s = time.process_time() - start
    states = bullet.getJointStatesMultiDof(body, joints, physicsClientId=client)
    links = bullet.getLinkStates(body, [*joints, tip], computeForwardKinematics=1, physicsClientId=client)
    markers = np.array([chain.base_position_m, *(link[4] for link in links)], float)
    return PublishedRun(rotation_vectors(np.array([state[0] for state in states])), markers, cpu_s)


def rotation_vectors(quaternions: Array) -> Array:
    """(n, 3) of Bullet's quaternions x, y, z, w (n, 4)."""
    q = np.where(quaternions[:, 3:] < 0, -quaternions, quaternions)
    sine = np.sqrt((q[:, :3] ** 2).sum(axis=1))
    angle = 2 * np.arctan2(sine, q[:, 3])
    vectors: Array = q[:, :3] * np.where(sine > 1e-9, angle / np.maximum(sine, 1e-12), 2.0)[:, None]
    return vectors


def _load(bullet: Any, client: int, chain: ChainModel) -> int:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "helix.urdf"
        path.write_text(_urdf(chain), encoding="utf-8")
        body: int = bullet.loadURDF(
            str(path),
            [float(x) for x in chain.base_position_m],
            _quaternion(chain.base_rotation),
            useFixedBase=1,
            flags=bullet.URDF_USE_INERTIA_FROM_FILE,
            physicsClientId=client,
        )
    for link in range(bullet.getNumJoints(body, physicsClientId=client)):
        bullet.changeDynamics(body, link, maxJointVelocity=1e6, physicsClientId=client)
    return body


def _urdf(chain: ChainModel) -> str:
    """Links of cylinders about x: their inertia is diagonal in their own frame."""
    none = '<inertial><mass value="0"/>' + _inertia((0.0, 0.0, 0.0)) + "</inertial>"
    parts = [f'<robot name="helix"><link name="link_0">{none}</link>']
    for k, (joint, body) in enumerate(zip(chain.joints, chain.bodies[1:], strict=True), start=1):
        turn = float(np.arctan2(joint.rest_rotation[2, 1], joint.rest_rotation[1, 1]))
        parts.append(
            f'<link name="link_{k}"><inertial><origin xyz="{float(body.com_m[0])!r} 0 0"/>'
            f'<mass value="{body.mass_kg!r}"/>{_inertia(np.diag(body.inertia_kg_m2))}</inertial></link>'
            f'<joint name="joint_{k}" type="spherical"><parent link="link_{k - 1}"/><child link="link_{k}"/>'
            f'<origin xyz="{float(joint.offset_m[0])!r} 0 0" rpy="{turn!r} 0 0"/><axis xyz="1 0 0"/></joint>'
        )
    parts.append(
        f'<link name="tip">{none}</link><joint name="end" type="fixed"><parent link="link_{chain.n_joints}"/>'
        f'<child link="tip"/><origin xyz="{float(chain.tip_offset_m[0])!r} 0 0"/></joint></robot>'
    )
    return "\n".join(parts)


def _inertia(diagonal: Any) -> str:
    ixx, iyy, izz = (float(value) for value in diagonal)
    return f'<inertia ixx="{ixx!r}" iyy="{iyy!r}" izz="{izz!r}" ixy="0" ixz="0" iyz="0"/>'


def _quaternion(rotation: Array) -> list[float]:
    w, x, y, z = quaternion_of_matrix(rotation)
    return [float(x), float(y), float(z), float(w)]
