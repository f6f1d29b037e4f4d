"""A chain inside PyBullet: joint coordinates in and out, explicit torques of the laws at every step.

PyBullet writes quaternions x, y, z, w. A spherical joint's rate and torque are in the child's frame,
dφ/dt = Jᵣ⁻¹ ω and torque = Jᵣ⁻ᵀ τ, and Bullet's child frame is the link's *principal* frame, not its URDF
frame: rotation, rate and torque of such a joint are turned by the principal axes on their way in and out.
"""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

import numpy as np

from pliant.errors import UserError
from pliant.mechanics.inertia import longest_explicit_step, mass_matrix
from pliant.mechanics.rotations import (
    quaternion_of_matrix,
    quaternion_of_vector,
    right_jacobian,
    right_jacobian_inverse,
    vector_of_quaternion,
)
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant_plugins.physics.pybullet.config import PybulletConfig
from pliant_plugins.physics.pybullet.loader import load_pybullet
from pliant_plugins.physics.pybullet.urdf import chain_urdf, moving, principal

UNLIMITED_VELOCITY = 1e9
# Explicit relaxation is stable from inertia = h² k on; this margin covers coupling between the joints.
INERTIA_MARGIN = 2.0
PRISMATIC_COURANT = 0.9
# Bullet's state of a body: seven numbers of the base, one of each hinge or slide, four of each ball joint.
STATE_SIZE, BASE_SIZE = 128, 7


class BulletChain:
    """One client in DIRECT mode with one fixed multibody.

    Raises:
        UserError: the chain has more joints than Bullet's state holds; beyond it joints go missing silently.
    """

    def __init__(self, chain: ChainModel, statics: ChainStatics, config: PybulletConfig) -> None:
        self.statics = statics
        self._config = config
        self._geometry = statics.geometry
        self._ball = self._geometry.kind == "spherical"
        most = (STATE_SIZE - BASE_SIZE) // (4 if self._ball else 1)
        if chain.n_joints > most:
            raise UserError(
                f"physics 'pybullet' holds at most {most} {self._geometry.kind} joints and the chain has "
                f"{chain.n_joints}: use physics 'quasistatic' or 'mujoco'"
            )
        self.bullet = load_pybullet()
        self._model = chain.with_(bodies=tuple(moving(body) for body in chain.bodies))
        # (n, 3, 3) principal axes of the moving bodies, as columns.
        self._principal = np.array([principal(body)[1] for body in self._model.bodies[1:]])
        self._joints = list(range(chain.n_joints))
        self._tip = chain.n_joints
        self._relaxing_inertia = np.zeros(chain.n_joints)
        self.client = self.bullet.connect(self.bullet.DIRECT)
        self.body = self._load(chain)
        self._free_joints()
        self._moments = [
            self.bullet.getDynamicsInfo(self.body, j, physicsClientId=self.client)[2] for j in self._joints
        ]

    def close(self) -> None:
        """Disconnect the client; a second call does nothing."""
        if self.client >= 0:
            self.bullet.disconnect(physicsClientId=self.client)
            self.client = -1

    @property
    def q(self) -> Array:
        """(n, a) joint coordinates."""
        return self.state()[0]

    @property
    def rates(self) -> Array:
        """(n, a) dq/dt."""
        return self.state()[1]

    def state(self) -> tuple[Array, Array]:
        """Joint coordinates and their rates, both (n, a), read at once."""
        states: tuple[tuple[tuple[float, ...], ...], ...] = self.bullet.getJointStatesMultiDof(
            self.body, self._joints, physicsClientId=self.client
        )
        positions = np.array([state[0] for state in states], float)
        velocity = np.array([state[1] for state in states], float)
        if not self._ball:
            return positions, velocity
        phi = _times(self._principal, vector_of_quaternion(np.roll(positions, 1, axis=1)))
        phi_rates = _times(right_jacobian_inverse(phi), _times(self._principal, velocity))
        return phi @ self._geometry.basis, phi_rates @ self._geometry.basis

    def place(self, q: Array, rates: Array) -> None:
        """Set joint coordinates and their rates."""
        if self._ball:
            phi, phi_rates = self._geometry.rotation_vectors(q), self._geometry.rotation_vectors(rates)
            positions = np.roll(quaternion_of_vector(self._to_principal(phi)), -1, axis=1)
            rates = self._to_principal(_times(right_jacobian(phi), phi_rates))
        else:
            positions = q
        self.bullet.resetJointStatesMultiDof(
            self.body, self._joints, positions.tolist(), rates.tolist(), physicsClientId=self.client
        )

    def halt(self, q: Array) -> None:
        """Put the chain at q without velocity."""
        self.place(q, np.zeros_like(q))

    def advance(self, loads: Loads, q: Array, rates: Array, damping: float) -> None:
        """One step of the present timestep with the efforts at q, which are the present coordinates."""
        torque = self.statics.effort(q, loads) - damping * rates
        if self._ball:
            inverse = right_jacobian_inverse(self._geometry.rotation_vectors(q))
            torque = _times(inverse.transpose(0, 2, 1), self._geometry.rotation_vectors(torque))
            torque = self._to_principal(torque)
        self.bullet.setJointMotorControlMultiDofArray(
            self.body,
            self._joints,
            self.bullet.TORQUE_CONTROL,
            forces=torque.tolist(),
            physicsClientId=self.client,
        )
        if loads.tip_force_n.any():
            self.bullet.applyExternalForce(
                self.body,
                self._tip,
                loads.tip_force_n.tolist(),
                self.markers()[-1].tolist(),
                self.bullet.WORLD_FRAME,
                physicsClientId=self.client,
            )
        self.bullet.stepSimulation(physicsClientId=self.client)

    def travel(self, loads: Loads, duration_s: float) -> None:
        """Advance in real time in equal steps, no longer than explicit stiffness and damping allow."""
        damping = self._config.joint_damping
        longest = min(self._config.timestep_s, self.stable_step(loads, damping))
        n_steps = max(1, math.ceil(duration_s / longest - 1e-9))
        self.set_timestep(duration_s / n_steps)
        for _ in range(n_steps):
            q, rates = self.state()
            self.advance(loads, q, rates, damping)

    def relax_step(self, loads: Loads, q: Array, load_stiffness: Array, caution: float) -> None:
        """One pseudo-time step (`pliant.mechanics.relaxation`) against inertia scaled to the stiffness.

        Statics does not depend on moments of inertia, so they are free; prismatic joints move mass, which is
        not free because it weighs, and take a shorter step instead.
        """
        if self._geometry.kind == "prismatic":
            mass = mass_matrix(self._model, q)
            stiffness = caution * self.statics.balance(q, loads).stiffness
            self.set_timestep(longest_explicit_step(mass, stiffness, 0.0, PRISMATIC_COURANT))
        else:
            slopes = self.statics.efforts.evaluate(q, loads.actuation).dtau_du
            own = np.abs(np.linalg.eigvalsh(0.5 * (slopes + slopes.transpose(0, 2, 1)))).max(axis=1)
            wanted = INERTIA_MARGIN * caution * self._config.settle_timestep_s**2 * (own + load_stiffness)
            # Raising a few links at a time would unbalance the modes: all of them get headroom together.
            if (wanted > self._relaxing_inertia).any():
                self._relaxing_inertia = np.maximum(1.5 * wanted, self._relaxing_inertia)
                self._set_moments([(moment,) * 3 for moment in self._relaxing_inertia.tolist()])
        self.advance(loads, q, np.zeros_like(q), 0.0)

    def begin_relaxing(self) -> None:
        """Pseudo-time: the settle step, and inertia that the first step will choose."""
        self._relaxing_inertia = np.zeros(len(self._joints))
        self.set_timestep(self._config.settle_timestep_s)

    def end_relaxing(self) -> None:
        """Give the links their own inertia back."""
        self._set_moments(self._moments)

    def stable_step(self, loads: Loads, damping: float) -> float:
        """Longest step at which explicit efforts and damping are stable from the present state."""
        q = self.q
        mass = mass_matrix(self._model, q)
        return longest_explicit_step(mass, self.statics.balance(q, loads).stiffness, damping)

    def set_timestep(self, timestep_s: float) -> None:
        """Length of the next steps."""
        self.bullet.setTimeStep(timestep_s, physicsClientId=self.client)

    def markers(self) -> Array:
        """(n + 2, 3) base, joints and tip from Bullet's own kinematics."""
        states = self.bullet.getLinkStates(
            self.body, [*self._joints, self._tip], computeForwardKinematics=1, physicsClientId=self.client
        )
        # Entries 4 and 5 are the link's own frame; 0 and 1 would be its centre of mass.
        return np.array([self._geometry.base_position, *(state[4] for state in states)], float)

    def _to_principal(self, vectors: Array) -> Array:
        return _times(self._principal.transpose(0, 2, 1), vectors)

    def _load(self, chain: ChainModel) -> int:
        gravity = [float(value) for value in chain.gravity_m_s2]
        self.bullet.setGravity(*gravity, physicsClientId=self.client)
        quaternion = np.roll(quaternion_of_matrix(chain.base_rotation), -1)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "chain.urdf"
            path.write_text(chain_urdf(chain), encoding="utf-8")
            body: int = self.bullet.loadURDF(
                str(path),
                np.asarray(chain.base_position_m, float).tolist(),
                quaternion.tolist(),
                useFixedBase=True,
                flags=self.bullet.URDF_USE_INERTIA_FROM_FILE,
                physicsClientId=self.client,
            )
        return body

    def _free_joints(self) -> None:
        """Remove what PyBullet adds by default: link damping, velocity limits and joint motors."""
        for link in range(-1, self._tip + 1):
            # One property per call: some combinations in one call are lost.
            for setting in ("linearDamping", "angularDamping", "jointDamping"):
                self.bullet.changeDynamics(self.body, link, physicsClientId=self.client, **{setting: 0.0})
            self.bullet.changeDynamics(
                self.body, link, maxJointVelocity=UNLIMITED_VELOCITY, physicsClientId=self.client
            )
        for joint in self._joints:
            if self._ball:
                self.bullet.setJointMotorControlMultiDof(
                    self.body,
                    joint,
                    self.bullet.POSITION_CONTROL,
                    targetPosition=[0.0, 0.0, 0.0, 1.0],
                    targetVelocity=[0.0, 0.0, 0.0],
                    positionGain=0.0,
                    velocityGain=0.0,
                    force=[0.0, 0.0, 0.0],
                    physicsClientId=self.client,
                )
            else:
                self.bullet.setJointMotorControl2(
                    self.body, joint, self.bullet.VELOCITY_CONTROL, force=0.0, physicsClientId=self.client
                )

    def _set_moments(self, moments: list[tuple[float, float, float]]) -> None:
        for joint, moment in zip(self._joints, moments, strict=True):
            self.bullet.changeDynamics(
                self.body, joint, localInertiaDiagonal=list(moment), physicsClientId=self.client
            )


def _times(matrices: Array, vectors: Array) -> Array:
    product: Array = np.einsum("nij,nj->ni", matrices, vectors)
    return product
