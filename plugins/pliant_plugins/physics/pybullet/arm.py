"""A chain as one multibody of a Bullet client: joint coordinates in and out, efforts of the laws as torques.

PyBullet writes quaternions x, y, z, w. A spherical joint's rate and torque are in the child's frame,
dφ/dt = Jᵣ⁻¹ ω and torque = Jᵣ⁻ᵀ τ, and Bullet's child frame is the link's *principal* frame, not its URDF
frame: rotation, rate and torque of such a joint are turned by the principal axes on their way in and out.
"""

from __future__ import annotations

from types import ModuleType

import numpy as np

from pliant.errors import UserError
from pliant.mechanics.kinematics import ChainGeometry
from pliant.mechanics.rotations import (
    quaternion_of_vector,
    right_jacobian,
    right_jacobian_inverse,
    vector_of_quaternion,
)
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant_plugins.physics.pybullet.scaling import WorldScale
from pliant_plugins.physics.pybullet.urdf import principal

UNLIMITED_VELOCITY = 1e9
# Bullet's state of a body: seven numbers of the base, one of each hinge or slide, four of each ball joint.
STATE_SIZE, BASE_SIZE = 128, 7


def check_size(geometry: ChainGeometry) -> None:
    """Refuse chains that Bullet's state does not hold: beyond it joints go missing silently.

    Raises:
        UserError: the chain has too many joints.
    """
    most = (STATE_SIZE - BASE_SIZE) // (4 if geometry.kind == "spherical" else 1)
    if geometry.n_joints > most:
        raise UserError(
            f"physics 'pybullet' holds at most {most} {geometry.kind} joints and the chain has "
            f"{geometry.n_joints}: use physics 'quasistatic' or 'mujoco'"
        )


class BulletArm:
    """Joints of one multibody, in SI outside and scaled inside. Link i − 1 is body i, link n the tip."""

    def __init__(
        self,
        bullet: ModuleType,
        client: int,
        body: int,
        chain: ChainModel,
        scale: WorldScale | None = None,
    ) -> None:
        """Take hold of a loaded `chain_urdf` of exactly this `chain`, which is in the engine's scale."""
        self._bullet, self._client, self.body = bullet, client, body
        self._geometry = ChainGeometry.of(chain)
        self.ball = self._geometry.kind == "spherical"
        self.joints = list(range(chain.n_joints))
        self.tip = chain.n_joints
        slides = self._geometry.kind == "prismatic"
        scale = scale or WorldScale()
        self._scale = scale
        self._coordinate = scale.length if slides else 1.0
        self._effort = scale.force if slides else scale.torque
        # (n, 3, 3) principal axes of the moving bodies, as columns, and their transposes.
        self._principal = np.array([principal(body)[1] for body in chain.bodies[1:]])
        self.to_principal = self._principal.transpose(0, 2, 1)
        self._free()

    def state(self) -> tuple[Array, Array]:
        """Joint coordinates and their rates, both (n, a), read at once."""
        states: tuple[tuple[tuple[float, ...], ...], ...] = self._bullet.getJointStatesMultiDof(
            self.body, self.joints, physicsClientId=self._client
        )
        positions = np.array([state[0] for state in states], float)
        velocity = np.array([state[1] for state in states], float)
        if not self.ball:
            return positions / self._coordinate, velocity / self._coordinate
        phi = times(self._principal, vector_of_quaternion(np.roll(positions, 1, axis=1)))
        phi_rates = times(right_jacobian_inverse(phi), times(self._principal, velocity))
        return phi @ self._geometry.basis, phi_rates @ self._geometry.basis

    def place(self, q: Array, rates: Array) -> None:
        """Set joint coordinates and their rates."""
        if self.ball:
            phi, phi_rates = self._geometry.rotation_vectors(q), self._geometry.rotation_vectors(rates)
            positions = np.roll(quaternion_of_vector(times(self.to_principal, phi)), -1, axis=1)
            rates = times(self.to_principal, times(right_jacobian(phi), phi_rates))
        else:
            positions, rates = self._coordinate * q, self._coordinate * rates
        self._bullet.resetJointStatesMultiDof(
            self.body, self.joints, positions.tolist(), rates.tolist(), physicsClientId=self._client
        )

    def drive(self, effort: Array, q: Array) -> None:
        """Efforts (n, a) conjugate to the coordinates q (n, a) during the next step."""
        if self.ball:
            inverse = right_jacobian_inverse(self._geometry.rotation_vectors(q))
            effort = times(inverse.transpose(0, 2, 1), self._geometry.rotation_vectors(effort))
            effort = times(self.to_principal, effort)
        self.drive_torques(self._effort * effort)

    def drive_torques(self, torques: Array) -> None:
        """Torques (n, 1) or (n, 3) as Bullet takes them, during the next step."""
        self._bullet.setJointMotorControlMultiDofArray(
            self.body,
            self.joints,
            self._bullet.TORQUE_CONTROL,
            forces=torques.tolist(),
            physicsClientId=self._client,
        )

    def pull(self, link: int, force_n: Array, point_m: Array) -> None:
        """A world force at a world point of a link (−1: the base) during the next step."""
        self._bullet.applyExternalForce(
            self.body,
            link,
            (self._scale.force * np.asarray(force_n, float)).tolist(),
            (self._scale.length * np.asarray(point_m, float)).tolist(),
            self._bullet.WORLD_FRAME,
            physicsClientId=self._client,
        )

    def moving_markers(self) -> Array:
        """(n + 1, 3) joints and tip from Bullet's own kinematics."""
        states = self._bullet.getLinkStates(
            self.body, [*self.joints, self.tip], computeForwardKinematics=1, physicsClientId=self._client
        )
        # Entries 4 and 5 are the link's own frame; 0 and 1 would be its centre of mass.
        return np.array([state[4] for state in states], float) / self._scale.length

    def hold(self, force: float) -> None:
        """Motors on every axis toward rest with at most this force: 0 frees the joints, more is friction.

        Bullet gives every joint a motor of its own accord.
        """
        for joint in self.joints:
            if self.ball:
                self._bullet.setJointMotorControlMultiDof(
                    self.body,
                    joint,
                    self._bullet.POSITION_CONTROL,
                    targetPosition=[0.0, 0.0, 0.0, 1.0],
                    targetVelocity=[0.0, 0.0, 0.0],
                    positionGain=0.0,
                    velocityGain=1.0 if force else 0.0,
                    force=[force] * 3,
                    physicsClientId=self._client,
                )
            else:
                self._bullet.setJointMotorControl2(
                    self.body,
                    joint,
                    self._bullet.VELOCITY_CONTROL,
                    force=force,
                    physicsClientId=self._client,
                )

    def _free(self) -> None:
        """Remove what PyBullet adds by default: link damping, velocity limits and joint motors."""
        for link in range(-1, self.tip + 1):
            # One property per call: some combinations in one call are lost.
            for setting in ("linearDamping", "angularDamping", "jointDamping"):
                self._bullet.changeDynamics(self.body, link, physicsClientId=self._client, **{setting: 0.0})
            self._bullet.changeDynamics(
                self.body, link, maxJointVelocity=UNLIMITED_VELOCITY, physicsClientId=self._client
            )
        self.hold(0.0)


def times(matrices: Array, vectors: Array) -> Array:
    """(n, 3) products of n matrices and n vectors."""
    return np.asarray(np.einsum("nij,nj->ni", matrices, vectors))
