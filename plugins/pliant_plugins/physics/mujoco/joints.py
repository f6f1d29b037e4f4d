"""The joints of one chain inside a MuJoCo model: coordinates in and out, efforts of the laws at the dofs.

A ball joint's dofs are the angular velocity ω in the child's frame, dφ/dt = Jᵣ⁻¹ ω; an effort τ conjugate to
φ is the torque Jᵣ⁻ᵀ τ there, so the work is the same in both coordinates.
"""

from __future__ import annotations

import mujoco
import numpy as np

from pliant.mechanics.kinematics import Pose
from pliant.mechanics.rotations import (
    quaternion_of_vector,
    right_jacobian,
    right_jacobian_inverse,
    vector_of_quaternion,
)
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import ChainModel
from pliant.records.design import Array

NOT_NEEDED = np.empty(0)


class ChainJoints:
    """Views of a chain's part of `model` and `data`; its bodies' names begin with `prefix`."""

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        chain: ChainModel,
        statics: ChainStatics,
        prefix: str = "",
    ) -> None:
        self.statics = statics
        self._geometry = statics.geometry
        self._ball = self._geometry.kind == "spherical"
        self._model, self._data = model, data
        self.base, self.tip = model.body(f"{prefix}base").id, model.body(f"{prefix}tip").id
        n, first = chain.n_joints, int(model.body_jntadr[self.base + 1])
        coordinates, dofs = int(model.jnt_qposadr[first]), int(model.jnt_dofadr[first])
        self.dofs = slice(dofs, dofs + n * (3 if self._ball else 1))
        self._qpos = data.qpos[coordinates : coordinates + n * (4 if self._ball else 1)]
        self._qvel = data.qvel[self.dofs]
        self._applied = data.qfrc_applied[self.dofs]
        self._stiffness = model.jnt_stiffness[first : first + n]

    @property
    def q(self) -> Array:
        """(n, a) joint coordinates."""
        if not self._ball:
            return self._qpos.reshape(-1, 1).copy()
        coordinates: Array = vector_of_quaternion(self._qpos.reshape(-1, 4)) @ self._geometry.basis
        return coordinates

    @property
    def rates(self) -> Array:
        """(n, a) dq/dt."""
        if not self._ball:
            return self._qvel.reshape(-1, 1).copy()
        phi = vector_of_quaternion(self._qpos.reshape(-1, 4))
        rates: Array = np.einsum("nij,nj->ni", right_jacobian_inverse(phi), self._qvel.reshape(-1, 3))
        return rates @ self._geometry.basis

    def place(self, q: Array, rates: Array) -> None:
        """Set joint coordinates and their rates."""
        if self._ball:
            phi, phi_rate = self._geometry.rotation_vectors(q), self._geometry.rotation_vectors(rates)
            self._qpos[:] = quaternion_of_vector(phi).ravel()
            self._qvel[:] = np.einsum("nij,nj->ni", right_jacobian(phi), phi_rate).ravel()
        else:
            self._qpos[:] = q.ravel()
            self._qvel[:] = rates.ravel()

    def drive(
        self,
        loads: Loads,
        q: Array,
        extra_stiffness: Array | None = None,
        caution: float = 1.0,
        implicit: bool = True,
    ) -> Array:
        """Efforts of laws and end moment at the joints for the next step, from q, which is where they are.

        The joint's stiffness is set to the law's local slope k and the applied force to τ + k φ: the force is
        exactly τ, and the integrator knows its slope. With `extra_stiffness` (n,), k is `caution` times the
        slope's magnitude plus the extra; the force is still exactly τ. Returns k (n,); an integrator that is
        not `implicit` in stiffness gets τ alone.
        """
        effort = self.statics.efforts.evaluate(q, loads.actuation, loads.memory)
        slopes = -0.5 * (effort.dtau_du + effort.dtau_du.transpose(0, 2, 1))
        eigenvalues = np.linalg.eigvalsh(slopes) if self._ball else slopes[:, 0]
        if extra_stiffness is None:
            stiffness = np.maximum(eigenvalues, 0.0).max(axis=1)
        else:
            stiffness = caution * (np.abs(eigenvalues).max(axis=1) + extra_stiffness)
        tau = effort.tau
        tau[:, self._geometry.main] -= loads.moment_n_m
        force, phi = tau, q
        if self._ball:
            phi = self._geometry.rotation_vectors(q)
            inverse = right_jacobian_inverse(phi)
            force = np.einsum("nji,nj->ni", inverse, self._geometry.rotation_vectors(tau))
        if implicit:
            self._stiffness[:] = stiffness
            force = force + stiffness[:, None] * phi
        self._applied[:] = force.ravel()
        self._push(loads)
        return np.asarray(stiffness)

    def _push(self, loads: Loads) -> None:
        """Forces of the loads on the bodies, where these are now."""
        data = self._data
        data.xfrc_applied[self.tip, :3] = loads.tip_force_n
        if not loads.forces and not loads.cords:
            return
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_comPos(self._model, data)
        bodies, none = slice(self.base, self.tip), np.zeros(3)
        pose = Pose(data.xpos[bodies], data.xmat[bodies].reshape(-1, 3, 3), NOT_NEEDED, NOT_NEEDED)
        for pull in self.statics.acting(pose, loads):
            body = self.base + pull.body
            mujoco.mj_applyFT(self._model, data, pull.force_n, none, pull.point_m, body, data.qfrc_applied)

    def markers(self) -> Array:
        """(n + 2, 3) base, joints and tip as MuJoCo's kinematics have them now."""
        return self._data.xpos[self.base : self.tip + 1].copy()
