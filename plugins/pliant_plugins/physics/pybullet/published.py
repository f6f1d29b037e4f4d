"""The published formulation of a chain in PyBullet, kept as the baseline of benchmarks.

As in the public repository of Yao, Howard, Maiolino (Advanced Intelligent Systems 2026): a friction motor on
every axis, Bullet's own link damping, fixed steps that nothing checks, one call of the law per joint and axis
at every step, and efforts per component of the rotation vector applied as if they were torques. That mapping
is not energy-consistent: settled spherical chains are millimetres away from the equilibrium of their laws.
"""

from __future__ import annotations

import math

import numpy as np

from pliant.errors import UserError
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant_plugins.physics.pybullet.arm import times
from pliant_plugins.physics.pybullet.config import PybulletConfig
from pliant_plugins.physics.pybullet.engine import BulletChain

MOTOR_FORCE = 1e-4  # N·m on each axis
LINK_DAMPING = 0.04  # Bullet's default, linear and angular


class PublishedChain(BulletChain):
    """`travel` as published; `settle` is the common relaxation, for which motors and damping are taken away.

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
