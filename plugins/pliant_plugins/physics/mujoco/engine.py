"""A chain inside MuJoCo: joint coordinates in and out, efforts of the laws applied at every step.

A ball joint's dofs are the angular velocity ω in the child's frame, dφ/dt = Jᵣ⁻¹ ω; an effort τ conjugate to
φ is the torque Jᵣ⁻ᵀ τ there, so the work is the same in both coordinates.
"""

from __future__ import annotations

import math
import warnings

import mujoco
import numpy as np

from pliant.mechanics.inertia import longest_explicit_step, mass_matrix, regular
from pliant.mechanics.rotations import (
    quaternion_of_vector,
    right_jacobian,
    right_jacobian_inverse,
    vector_of_quaternion,
)
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.mujoco.mjcf import INERTIA_FLOOR_KG_M2, MASS_FLOOR_KG, chain_mjcf

FALLBACK = "mujoco {} has no integrator 'discrete' (3.13 or later has): using implicitfast with shorter steps"


def has_discrete_integrator() -> bool:
    """Whether this MuJoCo takes joint stiffness implicitly."""
    return hasattr(mujoco.mjtIntegrator, "mjINT_DISCRETE")


class MujocoChain:
    """The compiled model and its data."""

    def __init__(self, chain: ChainModel, statics: ChainStatics, config: MujocoConfig) -> None:
        self.statics = statics
        self._config = config
        self._chain = chain
        self.implicit = has_discrete_integrator()
        if not self.implicit:
            warnings.warn(FALLBACK.format(mujoco.__version__), RuntimeWarning, stacklevel=2)
        document = chain_mjcf(chain, "discrete" if self.implicit else "implicitfast")
        self.model = mujoco.MjModel.from_xml_string(document)
        self.data = mujoco.MjData(self.model)
        self._geometry = statics.geometry
        self._ball = self._geometry.kind == "spherical"
        self._heard: list[str] = []
        self._listener = None
        self._tip = self.model.body("tip").id
        self._base = self.model.body("base").id

    @property
    def q(self) -> Array:
        """(n, a) joint coordinates."""
        qpos = self.data.qpos
        if not self._ball:
            return np.array(qpos).reshape(-1, 1)
        coordinates: Array = vector_of_quaternion(qpos.reshape(-1, 4)) @ self._geometry.basis
        return coordinates

    @property
    def rates(self) -> Array:
        """(n, a) dq/dt."""
        if not self._ball:
            return np.array(self.data.qvel).reshape(-1, 1)
        phi = self._geometry.rotation_vectors(self.q)
        rates: Array = np.einsum("nij,nj->ni", right_jacobian_inverse(phi), self.data.qvel.reshape(-1, 3))
        return rates @ self._geometry.basis

    def set_stepping(self, timestep_s: float, damping: float) -> None:
        """Length of the next steps, and the viscous damping of every joint coordinate in them."""
        self.model.opt.timestep = timestep_s
        self.model.dof_damping[:] = damping
        self.model.dof_armature[:] = 0.0

    def stable_step(self, loads: Loads, damping: float) -> float:
        """Longest step of an integrator that does not know the laws' slopes."""
        pieces = tuple(regular(body, MASS_FLOOR_KG, INERTIA_FLOOR_KG_M2) for body in self._chain.bodies)
        mass = mass_matrix(self._chain.with_(bodies=pieces), self.q)
        return longest_explicit_step(mass, self.statics.balance(self.q, loads).stiffness, damping)

    def place(self, q: Array, rates: Array) -> None:
        """Set joint coordinates and their rates."""
        if self._ball:
            phi, phi_rate = self._geometry.rotation_vectors(q), self._geometry.rotation_vectors(rates)
            self.data.qpos[:] = quaternion_of_vector(phi).ravel()
            self.data.qvel[:] = np.einsum("nij,nj->ni", right_jacobian(phi), phi_rate).ravel()
        else:
            self.data.qpos[:] = q.ravel()
            self.data.qvel[:] = rates.ravel()

    def advance(
        self, loads: Loads, q: Array, extra_stiffness: Array | None = None, caution: float = 1.0
    ) -> None:
        """One step of `model.opt.timestep` from coordinates q, which are the present ones.

        The joint's stiffness is set to the law's local slope k and the applied force to τ + k φ: the force is
        exactly τ, and the integrator knows its slope. With `extra_stiffness` (n,), k is `caution` times the
        slope's magnitude plus the extra; the force is still exactly τ.
        """
        effort = self.statics.efforts.evaluate(q, loads.actuation)
        slopes = -0.5 * (effort.dtau_du + effort.dtau_du.transpose(0, 2, 1))
        eigenvalues = np.linalg.eigvalsh(slopes) if self._ball else slopes[:, 0]
        if extra_stiffness is None:
            stiffness = np.maximum(eigenvalues, 0.0).max(axis=1)
        else:
            stiffness = caution * (np.abs(eigenvalues).max(axis=1) + extra_stiffness)
        phi = self._geometry.rotation_vectors(q)
        tau = effort.tau
        tau[:, self._geometry.main] -= loads.moment_n_m
        if self._ball:
            inverse = right_jacobian_inverse(phi)
            force = np.einsum("nji,nj->ni", inverse, self._geometry.rotation_vectors(tau))
        else:
            force, phi = tau, q
        if self.implicit:
            self.model.jnt_stiffness[:] = stiffness
            force = force + stiffness[:, None] * phi
        elif extra_stiffness is not None:
            # Without implicit stiffness the relaxation moves against inertia of the same size.
            per_dof = np.repeat(stiffness, force.shape[1])
            self.model.dof_armature[:] = self.model.opt.timestep**2 * per_dof
        self.data.qfrc_applied[:] = force.ravel()
        self.data.xfrc_applied[self._tip, :3] = loads.tip_force_n
        mujoco.mj_step(self.model, self.data)

    def halt(self, q: Array) -> None:
        """Put the chain at q without velocity."""
        self.place(q, np.zeros_like(q))

    def begin_relaxing(self) -> None:
        """Pseudo-time of the settle step, without physical damping.

        What MuJoCo says of bold moves is not passed on: they are undone, and the end is judged by the statics.
        """
        self.set_stepping(self._config.settle_timestep_s, damping=0.0)
        self._listen()

    def end_relaxing(self) -> None:
        """`travel` sets its own step, damping and armature."""
        self._stop_listening()

    def travel(self, loads: Loads, duration_s: float) -> None:
        """Advance in real time in equal steps no longer than the config's (without implicit stiffness: stable).

        Where MuJoCo calls the motion unstable, that is a RuntimeWarning.
        """
        damping, longest = self._config.joint_damping, self._config.timestep_s
        if not self.implicit:
            longest = min(longest, self.stable_step(loads, damping))
        n_steps = max(1, math.ceil(duration_s / longest - 1e-9))
        self.set_stepping(duration_s / n_steps, damping)
        self._listen()
        try:
            for _ in range(n_steps):
                self.advance(loads, self.q)
        finally:
            heard = self._stop_listening()
        if heard:
            warnings.warn(f"mujoco: {heard[0]}", RuntimeWarning, stacklevel=2)

    def _listen(self) -> None:
        """Hear MuJoCo's warnings, which it would print and append to a MUJOCO_LOG.TXT in the present folder."""
        self._heard = []
        self._listener = mujoco.get_mju_user_warning()
        mujoco.set_mju_user_warning(self._heard.append)

    def _stop_listening(self) -> list[str]:
        mujoco.set_mju_user_warning(self._listener)
        return self._heard

    def close(self) -> None:
        """MuJoCo frees its memory with the object."""

    def relax_step(self, loads: Loads, q: Array, load_stiffness: Array, caution: float) -> None:
        """One pseudo-time step (`pliant.mechanics.relaxation`): the loads' stiffness is made implicit too."""
        self.advance(loads, q, load_stiffness, caution)

    def markers(self) -> Array:
        """(n + 2, 3) base, joints and tip from MuJoCo's own kinematics."""
        mujoco.mj_kinematics(self.model, self.data)
        return np.array(self.data.xpos[self._base : self._tip + 1])
