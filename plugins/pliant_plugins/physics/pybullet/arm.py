"""A chain as one multibody of a Bullet client: joint coordinates in and out, efforts of the laws as torques.

PyBullet writes quaternions x, y, z, w. A spherical joint's rate and torque are in the child's frame,
dφ/dt = Jᵣ⁻¹ ω and torque = Jᵣ⁻ᵀ τ, and Bullet's child frame is the link's *principal* frame, not its URDF
frame: rotation, rate and torque of such a joint are turned by the principal axes on their way in and out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pliant.errors import UserError
from pliant.mechanics.kinematics import ChainGeometry
from pliant.mechanics.rotations import (
    quaternion_from_vector,
    right_jacobian,
    right_jacobian_inverse,
    vector_from_quaternion,
)
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import ChainModel
from pliant.records.design import Array, MassProperties
from pliant.records.shape import Shape, TriangleMesh
from pliant_plugins.physics.pybullet.client import Client
from pliant_plugins.physics.pybullet.urdf import principal

UNLIMITED_VELOCITY = 1e9
# Bullet's state of a body: seven numbers of the base, one of each hinge or slide, four of each ball joint.
STATE_SIZE, BASE_SIZE = 128, 7


class WorldScale:
    """A world scaled in length: Bullet's contact margins and thresholds are made for bodies of a metre.

    With lengths × s, densities and times unchanged: masses × s³, forces × s⁴, torques and inertias × s⁵, and
    accelerations, gravity among them, × s. Angles and their rates stay.
    """

    def __init__(self, length: float = 1.0) -> None:
        self.length, self.mass, self.force, self.torque = length, length**3, length**4, length**5

    def chain(self, chain: ChainModel) -> ChainModel:
        """Return the chain for the engine; its laws are not scaled, because efforts are evaluated outside."""
        return chain.with_(
            joints=tuple(replace(j, offset_m=self.length * np.asarray(j.offset_m)) for j in chain.joints),
            bodies=tuple(self.piece(body) for body in chain.bodies),
            tip_offset_m=self.length * np.asarray(chain.tip_offset_m),
            base_position_m=self.length * np.asarray(chain.base_position_m),
            gravity_m_s2=self.length * np.asarray(chain.gravity_m_s2),
            payload_kg=self.mass * chain.payload_kg,
            shapes=tuple(tuple(self.shape(shape) for shape in shapes) for shapes in chain.shapes),
        )

    def piece(self, piece: MassProperties) -> MassProperties:
        """Return a rigid piece for the engine."""
        return MassProperties(
            self.mass * piece.mass_kg,
            self.length * np.asarray(piece.com_m),
            self.torque * np.asarray(piece.inertia_kg_m2),
        )

    def shape(self, shape: Shape) -> Shape:
        """Return a collision shape for the engine."""
        mesh = shape.mesh
        return replace(
            shape,
            size_m=tuple(self.length * size for size in shape.size_m),
            position_m=self.length * np.asarray(shape.position_m),
            mesh=TriangleMesh(self.length * mesh.vertices_m, mesh.faces) if mesh is not None else None,
        )


def check_size(*geometries: ChainGeometry) -> None:
    """Refuse the chains of one body where Bullet's state does not hold them: beyond it joints go missing silently.

    Raises:
        UserError: the chains have too many joints.
    """
    sizes = [(4 if one.kind == "spherical" else 1) for one in geometries]
    count = sum(one.n_joints for one in geometries)
    if sum(one.n_joints * size for one, size in zip(geometries, sizes, strict=True)) > STATE_SIZE - BASE_SIZE:
        most = (STATE_SIZE - BASE_SIZE) // max(sizes)
        what = "the chain has" if len(geometries) == 1 else f"the {len(geometries)} chains of one body have"
        raise UserError(
            f"physics 'pybullet' holds at most {most} {geometries[0].kind} joints and {what} {count}: use physics "
            "'quasistatic' or 'mujoco'"
        )


class BulletArm:
    """Joints of a chain in a multibody, in SI outside and scaled inside.

    Link `first` + i − 1 is body i, link `first` + n the tip; `first` is 0 unless an object carries several chains.
    """

    def __init__(
        self, client: Client, body: int, chain: ChainModel, scale: WorldScale | None = None, first: int = 0
    ) -> None:
        """Take hold of the loaded links of exactly this `chain`, which is in the engine's scale."""
        self._client, self.body = client, body
        self._geometry = ChainGeometry.from_chain(chain)
        self.ball = self._geometry.kind == "spherical"
        self.joints = list(range(first, first + chain.n_joints))
        self.tip = first + chain.n_joints
        slides = self._geometry.kind == "prismatic"
        self._scale = scale = scale or WorldScale()
        self._coordinate = scale.length if slides else 1.0
        self._effort = scale.force if slides else scale.torque
        # (n, 3, 3) principal axes of the moving bodies, as columns, and their transposes.
        self._principal = np.array([principal(body)[1] for body in chain.bodies[1:]])
        self.to_principal = self._principal.transpose(0, 2, 1)
        # What PyBullet adds by default: link damping, velocity limits and joint motors.
        links = [-1, *self.joints, self.tip]
        client.set_dynamics(body, links, linearDamping=0.0, angularDamping=0.0, jointDamping=0.0)
        client.set_dynamics(body, links, maxJointVelocity=UNLIMITED_VELOCITY)
        self.hold(0.0)

    @property
    def q(self) -> Array:
        """(n, a) joint coordinates."""
        return self.state()[0]

    @property
    def rates(self) -> Array:
        """(n, a) rates dq/dt of the joint coordinates."""
        return self.state()[1]

    def state(self) -> tuple[Array, Array]:
        """Return joint coordinates and their rates, both (n, a), read at once."""
        states = self._client.getJointStatesMultiDof(self.body, self.joints)
        positions = np.array([state[0] for state in states], float)
        velocity = np.array([state[1] for state in states], float)
        if not self.ball:
            return positions / self._coordinate, velocity / self._coordinate
        phi = times(self._principal, vector_from_quaternion(np.roll(positions, 1, axis=1)))
        phi_rates = times(right_jacobian_inverse(phi), times(self._principal, velocity))
        return phi @ self._geometry.basis, phi_rates @ self._geometry.basis

    def place(self, q: Array, rates: Array) -> None:
        """Set joint coordinates and their rates."""
        if self.ball:
            phi, phi_rates = self._geometry.rotation_vectors(q), self._geometry.rotation_vectors(rates)
            positions = np.roll(quaternion_from_vector(times(self.to_principal, phi)), -1, axis=1)
            rates = times(self.to_principal, times(right_jacobian(phi), phi_rates))
        else:
            positions, rates = self._coordinate * q, self._coordinate * rates
        self._client.resetJointStatesMultiDof(self.body, self.joints, positions.tolist(), rates.tolist())

    def drive(self, effort: Array, q: Array) -> None:
        """Apply efforts (n, a) conjugate to the coordinates q (n, a) during the next step."""
        if self.ball:
            inverse = right_jacobian_inverse(self._geometry.rotation_vectors(q))
            effort = times(inverse.transpose(0, 2, 1), self._geometry.rotation_vectors(effort))
            effort = times(self.to_principal, effort)
        self.drive_torques(self._effort * effort)

    def drive_torques(self, torques: Array) -> None:
        """Apply torques (n, 1) or (n, 3) in Bullet's format during the next step."""
        control = self._client.TORQUE_CONTROL
        self._client.setJointMotorControlMultiDofArray(
            self.body, self.joints, control, forces=torques.tolist()
        )

    def pull(self, link: int, force_n: Array, point_m: Array) -> None:
        """Apply a world force at a world point of a link (−1: the base) during the next step."""
        force = (self._scale.force * np.asarray(force_n, float)).tolist()
        point = (self._scale.length * np.asarray(point_m, float)).tolist()
        self._client.applyExternalForce(self.body, link, force, point, self._client.WORLD_FRAME)

    def pull_loads(
        self,
        statics: ChainStatics,
        loads: Loads,
        q: Array,
        moved: tuple[Array, Array | None] | None = None,
    ) -> None:
        """Apply tip force, point forces and cords in the next step, of a chain `moved` as by `Pose.moved`."""
        if loads.tip_force_n.any():
            self.pull(self.tip, loads.tip_force_n, self.moving_markers()[-1])
        if loads.forces or loads.cords:
            pose = statics.geometry.forward(q)
            if moved is not None:
                pose = pose.moved(*moved)
            for acting in statics.acting(pose, loads):
                if acting.body:
                    self.pull(self.joints[acting.body - 1], acting.force_n, acting.point_m)

    def moving_markers(self) -> Array:
        """Return (n + 1, 3) joints and tip from Bullet's own kinematics."""
        links = [*self.joints, self.tip]
        states = self._client.getLinkStates(self.body, links, computeForwardKinematics=1)
        # Entries 4 and 5 are the link's own frame; 0 and 1 would be its centre of mass.
        return np.array([state[4] for state in states], float) / self._scale.length

    def hold(self, force: float) -> None:
        """Set motors on every axis toward rest with at most this force: 0 frees the joints, a positive force acts as
        friction.

        Bullet creates a motor on every joint by default.
        """
        client = self._client
        for joint in self.joints:
            if self.ball:
                client.setJointMotorControlMultiDof(
                    self.body,
                    joint,
                    client.POSITION_CONTROL,
                    targetPosition=[0.0, 0.0, 0.0, 1.0],
                    targetVelocity=[0.0, 0.0, 0.0],
                    positionGain=0.0,
                    velocityGain=1.0 if force else 0.0,
                    force=[force] * 3,
                )
            else:
                client.setJointMotorControl2(self.body, joint, client.VELOCITY_CONTROL, force=force)


def times(matrices: Array, vectors: Array) -> Array:
    """Return (n, 3) products of n matrices and n vectors."""
    return np.asarray(np.einsum("nij,nj->ni", matrices, vectors))
