"""A chain inside PyBullet, on a fixed base: explicit torques of the laws at every step."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

import numpy as np

from pliant.errors import UserError
from pliant.mechanics.inertia import longest_explicit_step, mass_matrix
from pliant.mechanics.rotations import quaternion_of_matrix
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant_plugins.physics.pybullet.arm import BulletArm, check_size, times
from pliant_plugins.physics.pybullet.config import PybulletConfig
from pliant_plugins.physics.pybullet.loader import load_pybullet
from pliant_plugins.physics.pybullet.urdf import chain_urdf, floored

# Explicit relaxation is stable from inertia = h² k on; this margin covers coupling between the joints.
INERTIA_MARGIN = 2.0
PRISMATIC_COURANT = 0.9


class BulletChain:
    """One client in DIRECT mode with one fixed multibody.

    Raises:
        UserError: the chain has more joints than Bullet's state holds.
    """

    def __init__(self, chain: ChainModel, statics: ChainStatics, config: PybulletConfig) -> None:
        self.statics = statics
        self._config = config
        self._geometry = statics.geometry
        check_size(self._geometry)
        self.bullet = load_pybullet()
        self._model = floored(chain)
        self._relaxing_inertia = np.zeros(chain.n_joints)
        self.client = self.bullet.connect(self.bullet.DIRECT)
        self.arm = BulletArm(self.bullet, self.client, self._load(self._model), self._model)
        self.body = self.arm.body
        self._moments = [
            self.bullet.getDynamicsInfo(self.body, j, physicsClientId=self.client)[2] for j in self.arm.joints
        ]

    def close(self) -> None:
        """Disconnect the client; a second call does nothing."""
        if self.client >= 0:
            self.bullet.disconnect(physicsClientId=self.client)
            self.client = -1

    @property
    def q(self) -> Array:
        """(n, a) joint coordinates."""
        return self.arm.state()[0]

    @property
    def rates(self) -> Array:
        """(n, a) rates dq/dt of the joint coordinates."""
        return self.arm.state()[1]

    def place(self, q: Array, rates: Array) -> None:
        """Set joint coordinates and their rates."""
        self.arm.place(q, rates)

    def halt(self, q: Array) -> None:
        """Put the chain at q without velocity."""
        self.place(q, np.zeros_like(q))

    def advance(self, loads: Loads, q: Array, rates: Array, damping: float) -> None:
        """One step of the present timestep with the efforts at q, which are the present coordinates."""
        self.arm.drive(self.statics.effort(q, loads) - damping * rates, q)
        self._pull(loads, q)
        self.bullet.stepSimulation(physicsClientId=self.client)

    def travel(self, loads: Loads, duration_s: float) -> None:
        """Advance in real time in equal steps, no longer than explicit stiffness and damping allow."""
        damping = self._config.joint_damping
        longest = min(self._config.timestep_s, self.stable_step(loads, damping))
        n_steps = max(1, math.ceil(duration_s / longest - 1e-9))
        self.set_timestep(duration_s / n_steps)
        for _ in range(n_steps):
            q, rates = self.arm.state()
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
        self._relaxing_inertia = np.zeros(len(self.arm.joints))
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
        return np.concatenate([self._geometry.base_position[None], self.arm.moving_markers()])

    def _pull(self, loads: Loads, q: Array) -> None:
        """Tip force, point forces and cords during the next step."""
        if loads.tip_force_n.any():
            self.arm.pull(self.arm.tip, loads.tip_force_n, self.markers()[-1])
        if loads.forces or loads.cords:
            for acting in self.statics.acting(self._geometry.forward(q), loads):
                if acting.body:
                    self.arm.pull(acting.body - 1, acting.force_n, acting.point_m)

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

    def _set_moments(self, moments: list[tuple[float, float, float]]) -> None:
        for joint, moment in zip(self.arm.joints, moments, strict=True):
            self.bullet.changeDynamics(
                self.body, joint, localInertiaDiagonal=list(moment), physicsClientId=self.client
            )


MOTOR_FORCE = 1e-4  # N·m on each axis
LINK_DAMPING = 0.04  # Bullet's default, linear and angular


class PublishedChain(BulletChain):
    """The published formulation of a chain in PyBullet, kept as the baseline of benchmarks.

    As in the public repository of Yao, Howard, Maiolino (Advanced Intelligent Systems 2026): a friction motor on
    every axis, Bullet's own link damping, fixed steps that nothing checks, one call of the law per joint and axis
    at every step, and efforts per component of the rotation vector applied as if they were torques. That mapping
    is not energy-consistent: settled spherical chains are millimetres away from the equilibrium of their laws.
    `settle` is the common relaxation, for which motors and damping are taken away.

    Raises:
        UserError: the chain has effects, which the formulation does not know.
    """

    def __init__(self, chain: ChainModel, statics: ChainStatics, config: PybulletConfig) -> None:
        if chain.terms:
            raise UserError("physics.preset 'published' knows no effects: leave them out of 'effects'")
        super().__init__(chain, statics, config)
        self._chain = chain
        self._braked_for_s = 0.0

    def travel(self, loads: Loads, duration_s: float) -> None:
        """Advance in equal steps no longer than the config's, whatever the stiffness."""
        n_steps = max(1, math.ceil(duration_s / self._config.timestep_s - 1e-9))
        self._brake_for(duration_s / n_steps)
        for _ in range(n_steps):
            q = self.q
            self._drive(self._joint_by_joint(loads, q))
            self._pull(loads, q)
            self.bullet.stepSimulation(physicsClientId=self.client)

    def begin_relaxing(self) -> None:
        self._braked_for_s = 0.0
        self._brake(0.0, 0.0)
        super().begin_relaxing()

    def _joint_by_joint(self, loads: Loads, q: Array) -> Array:
        """(n, a) efforts by one call of a law per joint, axis and actuator."""
        n, a = q.shape
        tau = np.zeros((n, a))
        for i in range(n):
            law = self._chain.laws[self._chain.joints[i].law]
            for axis in range(a):
                for actuator in self._chain.actuators:
                    pressure = np.array([loads.actuation[actuator.input]])
                    effort = law.evaluate(pressure, actuator.sign * q[i : i + 1])
                    tau[i, axis] += actuator.sign * effort.tau[0, axis]
        tau[:, self._geometry.main] -= loads.moment_n_m
        return tau

    def _drive(self, tau: Array) -> None:
        """Components of the effort as torques about the child's axes."""
        if self.arm.ball:
            tau = times(self.arm.to_principal, self._geometry.rotation_vectors(tau))
        self.arm.drive_torques(tau)

    def _brake_for(self, timestep_s: float) -> None:
        """The step's length, and brakes that fit it: Bullet keeps a motor's impulse, not its force."""
        self.set_timestep(timestep_s)
        if timestep_s != self._braked_for_s:
            self._brake(MOTOR_FORCE, LINK_DAMPING)
            self._braked_for_s = timestep_s

    def _brake(self, motor: float, damping: float) -> None:
        self.arm.hold(motor)
        for link in range(self.arm.tip + 1):
            for setting in ("linearDamping", "angularDamping"):
                self.bullet.changeDynamics(self.body, link, physicsClientId=self.client, **{setting: damping})
