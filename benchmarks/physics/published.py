"""The published formulation as a bare PyBullet script, without any of Pliant's engine code: the baseline.

Spherical joints with friction motors, steps of 1/2400 s, and at every step a law evaluated for each joint and
axis, whose efforts, component by component, are applied as torques. Per step this script does only the necessary work
of such a script, without checks, records or avoidable conversions.

Its laws are per-axis networks of the study's size (2-64-64-1, ReLU, single precision), evaluated one sample at a
time. The study trained them on FEM data. Here the hidden layers are random and the output layer is the least-squares
fit to the true law on a grid, which takes a second instead of minutes: an evaluation costs as much as the study's, and
the chain moves similarly; `fit_errors` returns the quality of the fit.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from benchmarks.physics.helix import DURATION_S, PRESSURE_PA, RAMP_S, Ended
from numpy.typing import NDArray

from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.law import Domain, Effort, JointKind, JointLaw, LawRecord
from pliant_plugins.physics.pybullet.client import Client
from pliant_plugins.surrogates.polynomial.axes import AxesLaw

STEP_S = 1 / 2400
MOTOR_N_M = 1e-4
# τ (n, 3) at a pressure and joint angles (n, 3).
Efforts = Callable[[float, Array], Array]


def run(
    chain: ChainModel, efforts: Efforts, load_kg: float, motor_n_m: float = MOTOR_N_M, step_s: float = STEP_S
) -> Ended:
    """Run 1 s of pressure ramp and 1 s of hold from the straight chain.

    Raises:
        MissingDependencyError: PyBullet is not installed.
    """
    with closing(Client()) as bullet:
        return _run(bullet, chain, efforts, load_kg, motor_n_m, step_s)


def _run(
    bullet: Client, chain: ChainModel, efforts: Efforts, load_kg: float, motor_n_m: float, step_s: float
) -> Ended:
    body = bullet_body(bullet, chain)
    joints = list(range(chain.n_joints))
    tip = chain.n_joints
    bullet.setGravity(*[float(g) for g in chain.gravity_m_s2])
    bullet.setTimeStep(step_s)
    friction = {"positionGain": 0, "velocityGain": 1, "force": [motor_n_m] * 3}
    still = {"targetPosition": [0, 0, 0, 1], "targetVelocity": [0, 0, 0]}
    for joint in joints:
        bullet.setJointMotorControlMultiDof(body, joint, bullet.POSITION_CONTROL, **still, **friction)
    weight = [0.0, 0.0, -load_kg * float(np.linalg.norm(chain.gravity_m_s2))]
    start = time.process_time()
    for k in range(round(DURATION_S / step_s)):
        pressure = PRESSURE_PA * min(k * step_s / RAMP_S, 1.0)
        states = bullet.getJointStatesMultiDof(body, joints)
        torque = efforts(pressure, rotation_vectors(np.array([state[0] for state in states])))
        bullet.setJointMotorControlMultiDofArray(body, joints, bullet.TORQUE_CONTROL, forces=torque.tolist())
        if load_kg:
            at = bullet.getLinkState(body, tip)[4]
            bullet.applyExternalForce(body, tip, weight, at, bullet.WORLD_FRAME)
        bullet.stepSimulation()
    cpu_s = time.process_time() - start
    states = bullet.getJointStatesMultiDof(body, joints)
    links = bullet.getLinkStates(body, [*joints, tip], computeForwardKinematics=1)
    markers = np.array([chain.base_position_m, *(link[4] for link in links)], float)
    return Ended(rotation_vectors(np.array([state[0] for state in states])), markers, cpu_s)


def rotation_vectors(quaternions: Array) -> Array:
    """Return (n, 3) of Bullet's quaternions x, y, z, w (n, 4)."""
    q = np.where(quaternions[:, 3:] < 0, -quaternions, quaternions)
    sine = np.sqrt((q[:, :3] ** 2).sum(axis=1))
    angle = 2 * np.arctan2(sine, q[:, 3])
    return q[:, :3] * np.where(sine > 1e-9, angle / np.maximum(sine, 1e-12), 2.0)[:, None]


def bullet_body(bullet: Client, chain: ChainModel) -> int:
    """Return the chain on a fixed base, without limits of velocity."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "helix.urdf"
        body = bullet.load(path, _urdf(chain), chain.base_position_m, chain.base_rotation, fixed=True)
    bullet.set_dynamics(body, range(bullet.getNumJoints(body)), maxJointVelocity=1e6)
    return body


def _urdf(chain: ChainModel) -> str:
    """Return links of cylinders about x: their inertia is diagonal in their own frame."""
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


WIDTH = 64
ANGLES_RAD = (-0.8, 0.9)
Single = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Network:
    """y = W₃ᵀ relu(W₂ᵀ relu(W₁ᵀ x + b₁) + b₂) + b₃ of x = (p / 15 kPa, u)."""

    weights: tuple[Single, Single, Single, Single, Single, Single]

    def value(self, pressure_pa: float, angle_rad: float) -> float:
        """Return τ of one sample, N·m."""
        w1, b1, w2, b2, w3, b3 = self.weights
        x = np.array([pressure_pa / PRESSURE_PA, angle_rad], np.float32)
        hidden = np.maximum(x @ w1 + b1, 0)
        hidden = np.maximum(hidden @ w2 + b2, 0)
        return float((hidden @ w3 + b3)[0])

    def slopes(self, pressure_pa: float, angle_rad: float) -> Array:
        """Return (∂τ/∂p, ∂τ/∂u) of one sample."""
        w1, b1, w2, b2, w3, _ = self.weights
        first = np.array([pressure_pa / PRESSURE_PA, angle_rad], np.float32) @ w1 + b1
        second = np.maximum(first, 0) @ w2 + b2
        slopes = w1 @ ((first > 0) * (w2 @ ((second > 0) * w3[:, 0])))
        return np.asarray(slopes / [PRESSURE_PA, 1.0], float)


@dataclass(frozen=True, eq=False)
class NetworkLaw(JointLaw):
    """Three networks, one for each of x, y, z; no sample shares a call with another."""

    networks: tuple[Network, Network, Network]
    domain: Domain
    joint: JointKind = "spherical"
    axes: tuple[str, ...] = ("x", "y", "z")
    actuation_name: str = "pressure_pa"

    def efforts(self, pressure_pa: float, angles_rad: Array) -> Array:
        """Return τ (n, 3) of n joints as in the study: one call per joint and axis, no slopes."""
        return np.array([self.effort(pressure_pa, u) for u in angles_rad])

    def effort(self, pressure_pa: float, angles_rad: Array) -> list[float]:
        """Return τ (3,) of one joint."""
        return [net.value(pressure_pa, u) for net, u in zip(self.networks, angles_rad, strict=True)]

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        """Return τ and slopes, joint by joint and axis by axis."""
        n = len(deformation)
        tau, dtau_dp, dtau_du = np.empty((n, 3)), np.empty((n, 3)), np.zeros((n, 3, 3))
        for i in range(n):
            tau[i] = self.effort(actuation[i], deformation[i])
            for k, net in enumerate(self.networks):
                dtau_dp[i, k], dtau_du[i, k, k] = net.slopes(actuation[i], deformation[i, k])
        return Effort(tau, dtau_dp, dtau_du)

    def record(self) -> LawRecord:
        """Return the network's weights as JSON values."""
        arrays = {
            f"{axis}_{k}": np.asarray(weight, float)
            for axis, net in zip(self.axes, self.networks, strict=True)
            for k, weight in enumerate(net.weights)
        }
        return LawRecord("network_benchmark", {"axes": list(self.axes)}, arrays)


def network_law(law: AxesLaw, seed: int = 0) -> NetworkLaw:
    """Return networks for the three axes of a law."""
    random = np.random.default_rng(seed)
    nets = [_fitted(law, axis, random) for axis in range(3)]
    return NetworkLaw((nets[0], nets[1], nets[2]), law.domain)


def fit_errors(law: AxesLaw, networks: NetworkLaw) -> dict[str, float]:
    """Return RMS error over the range of the effort, per axis, on random samples that were not fitted."""
    random = np.random.default_rng(1)
    p, u = PRESSURE_PA * random.random(500), random.uniform(*ANGLES_RAD, 500)
    errors = {}
    for k, axis in enumerate(law.axes):
        true = law.laws[k].evaluate(p, u[:, None]).tau[:, 0]
        net = np.array([networks.networks[k].value(*sample) for sample in zip(p, u, strict=True)])
        errors[axis] = float(np.sqrt(np.mean((net - true) ** 2)) / np.ptp(true))
    return errors


def _fitted(law: AxesLaw, axis: int, random: np.random.Generator) -> Network:
    """Fit random hidden layers, with the output layer by ridge regression on a grid."""
    grid = np.meshgrid(np.linspace(0, PRESSURE_PA, 31), np.linspace(*ANGLES_RAD, 121))
    p, u = (values.ravel() for values in grid)
    target = law.laws[axis].evaluate(p, u[:, None]).tau[:, 0]
    w1 = random.normal(size=(2, WIDTH))
    b1 = -(random.uniform([[0.0], [ANGLES_RAD[0]]], [[1.0], [ANGLES_RAD[1]]], (2, WIDTH)) * w1).sum(axis=0)
    w2, b2 = random.normal(size=(WIDTH, WIDTH)) / 8, random.normal(size=WIDTH) / 4
    hidden = np.maximum(np.stack([p / PRESSURE_PA, u], axis=1) @ w1 + b1, 0)
    hidden = np.maximum(hidden @ w2 + b2, 0)
    columns = np.column_stack([hidden, np.ones(len(u))])
    ridge = 1e-5 * np.sqrt(len(u)) * np.eye(WIDTH + 1)
    scale = np.abs(target).max()
    right = np.concatenate([target / scale, np.zeros(WIDTH + 1)])
    w3 = scale * np.linalg.lstsq(np.vstack([columns, ridge]), right, rcond=None)[0]
    layers = [w1, b1, w2, b2, w3[:-1, None], w3[-1:]]
    return Network(tuple(np.asarray(layer, np.float32) for layer in layers))
