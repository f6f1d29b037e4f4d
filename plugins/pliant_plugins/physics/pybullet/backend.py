"""The PyBullet engine: explicit torques of the laws at every step, equilibria by relaxation, scenes with contact."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import ClassVar

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.physics import Capabilities, PhysicsBackend
from pliant.interfaces.simulation import SceneSimulation
from pliant.mechanics.inertia import longest_explicit_step, mass_matrix
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.scene import Scene
from pliant_plugins.exporting.urdf import write_urdf
from pliant_plugins.physics.dynamic import DynamicSimulation
from pliant_plugins.physics.pybullet.arm import BulletArm, check_size, times
from pliant_plugins.physics.pybullet.client import Client
from pliant_plugins.physics.pybullet.config import PybulletConfig
from pliant_plugins.physics.pybullet.urdf import chain_tree, document, floored

# Explicit relaxation is stable from inertia = h² k on; this margin covers coupling between the joints.
INERTIA_MARGIN = 2.0
PRISMATIC_COURANT = 0.9


class BulletSimulation(DynamicSimulation):
    """One client with one fixed multibody.

    Raises:
        UserError: the chain has more joints than Bullet's state can store.
    """

    def __init__(self, chain: ChainModel, config: PybulletConfig) -> None:
        statics = ChainStatics(chain)
        self._config = config
        self._geometry = statics.geometry
        check_size(self._geometry)
        self._model = floored(chain)
        self._relaxing_inertia = np.zeros(chain.n_joints)
        self.client = Client()
        self.client.setGravity(*[float(value) for value in chain.gravity_m_s2])
        with tempfile.TemporaryDirectory() as folder:
            path, base = Path(folder) / "chain.urdf", (chain.base_position_m, chain.base_rotation)
            self.body = self.client.load(path, document(chain_tree(self._model)), *base, fixed=True)
        self.arm = BulletArm(self.client, self.body, self._model)
        self._moments = [self.client.getDynamicsInfo(self.body, j)[2] for j in self.arm.joints]
        super().__init__(chain, statics, self.arm, config.tolerance, config.max_settle_steps)

    def close(self) -> None:
        self.client.close()

    def step(self, duration_s: float) -> None:
        if duration_s > 0.0:
            self._travel(self.now(), duration_s)
            self._time_s += duration_s

    def _travel(self, loads: Loads, duration_s: float) -> None:
        """Advance in real time in equal steps, no longer than explicit stiffness and damping allow."""
        q, damping = self.q, self._config.joint_damping
        stiffness = self.statics.balance(q, loads).stiffness
        stable = longest_explicit_step(mass_matrix(self._model, q), stiffness, damping)
        n_steps = max(1, math.ceil(duration_s / min(self._config.timestep_s, stable) - 1e-9))
        self.client.setTimeStep(duration_s / n_steps)
        for _ in range(n_steps):
            q, rates = self.arm.state()
            self._advance(loads, q, rates, damping)

    def _advance(self, loads: Loads, q: Array, rates: Array, damping: float) -> None:
        """Make one step of the present timestep with the efforts at q, the present coordinates."""
        self.arm.drive(self.statics.effort(q, loads) - damping * rates, q)
        self.arm.pull_loads(self.statics, loads, q)
        self.client.stepSimulation()

    def relax_step(self, loads: Loads, q: Array, load_stiffness: Array, caution: float) -> None:
        """Make one pseudo-time step (`pliant.mechanics.relaxation`) against inertia scaled to the stiffness.

        Statics does not depend on moments of inertia, so they are free; prismatic joints move mass, which is
        not free because it weighs, and take a shorter step instead.
        """
        if self._geometry.kind == "prismatic":
            mass = mass_matrix(self._model, q)
            stiffness = caution * self.statics.balance(q, loads).stiffness
            self.client.setTimeStep(longest_explicit_step(mass, stiffness, 0.0, PRISMATIC_COURANT))
        else:
            slopes = self.statics.efforts.evaluate(q, loads.actuation).dtau_du
            own = np.abs(np.linalg.eigvalsh(0.5 * (slopes + slopes.transpose(0, 2, 1)))).max(axis=1)
            wanted = INERTIA_MARGIN * caution * self._config.settle_timestep_s**2 * (own + load_stiffness)
            # Raising a few links at a time would unbalance the modes: all of them get headroom together.
            if (wanted > self._relaxing_inertia).any():
                self._relaxing_inertia = np.maximum(1.5 * wanted, self._relaxing_inertia)
                self._set_moments([(moment,) * 3 for moment in self._relaxing_inertia.tolist()])
        self._advance(loads, q, np.zeros_like(q), 0.0)

    def begin_relaxing(self) -> None:
        """Begin pseudo-time: the settle step, and inertia that the first step chooses."""
        self._relaxing_inertia = np.zeros(len(self.arm.joints))
        self.client.setTimeStep(self._config.settle_timestep_s)

    def end_relaxing(self) -> None:
        """Give the links their own inertia back."""
        self._set_moments(self._moments)

    def markers(self) -> Array:
        return np.concatenate([self._geometry.base_position[None], self.arm.moving_markers()])

    def _set_moments(self, moments: list[tuple[float, float, float]]) -> None:
        for joint, moment in zip(self.arm.joints, moments, strict=True):
            self.client.changeDynamics(self.body, joint, localInertiaDiagonal=list(moment))


MOTOR_FORCE = 1e-4  # N·m on each axis
LINK_DAMPING = 0.04  # Bullet's default, linear and angular


class PublishedSimulation(BulletSimulation):
    """The published formulation of a chain in PyBullet, kept as the baseline of benchmarks.

    As in the public repository of Yao, Howard, Maiolino (Advanced Intelligent Systems 2026): a friction motor on
    every axis, Bullet's own link damping, fixed steps that nothing checks, one call of the law per joint and axis
    at every step, and efforts per component of the rotation vector applied as if they were torques. That mapping
    is not energy-consistent: settled spherical chains are millimetres away from the equilibrium of their laws.
    `settle` is the common relaxation, for which motors and damping are taken away.

    Raises:
        UserError: the chain has effects, which the formulation does not support.
    """

    def __init__(self, chain: ChainModel, config: PybulletConfig) -> None:
        if chain.terms:
            raise UserError(
                "physics.preset 'published' does not support effects: leave them out of 'effects'"
            )
        super().__init__(chain, config)
        self._braked_for_s = 0.0

    def _travel(self, loads: Loads, duration_s: float) -> None:
        """Advance in equal steps no longer than the config's, whatever the stiffness."""
        n_steps = max(1, math.ceil(duration_s / self._config.timestep_s - 1e-9))
        timestep_s = duration_s / n_steps
        self.client.setTimeStep(timestep_s)
        if timestep_s != self._braked_for_s:  # Bullet keeps a motor's impulse, not its force
            self._brake(MOTOR_FORCE, LINK_DAMPING)
            self._braked_for_s = timestep_s
        for _ in range(n_steps):
            q = self.q
            tau = self._joint_by_joint(loads, q)
            if self.arm.ball:  # components of the effort as torques about the child's axes
                tau = times(self.arm.to_principal, self._geometry.rotation_vectors(tau))
            self.arm.drive_torques(tau)
            self.arm.pull_loads(self.statics, loads, q)
            self.client.stepSimulation()

    def begin_relaxing(self) -> None:
        self._braked_for_s = 0.0
        self._brake(0.0, 0.0)
        super().begin_relaxing()

    def _joint_by_joint(self, loads: Loads, q: Array) -> Array:
        """Return (n, a) efforts by one call of a law per joint, axis and actuator."""
        n, a = q.shape
        tau = np.zeros((n, a))
        for i in range(n):
            joint = self.chain.joints[i]
            law = self.chain.laws[joint.law]
            actuators = self.chain.actuators[slice(*self.chain.actuator_range(joint))]
            if len(law.actuations) > 1:
                values = np.array([[loads.actuation[actuator.input] for actuator in actuators]])
                for axis in range(a):
                    tau[i, axis] = law.evaluate(values, q[i : i + 1]).tau[0, axis]
                continue
            for axis in range(a):
                for actuator in actuators:
                    pressure = np.array([loads.actuation[actuator.input]])
                    turn = actuator.turn(a)
                    tau[i, axis] += turn[axis] @ law.evaluate(pressure, q[i : i + 1] @ turn).tau[0]
        tau[:, self._geometry.main] -= loads.moment_n_m
        return tau

    def _brake(self, motor: float, damping: float) -> None:
        self.arm.hold(motor)
        links = range(self.arm.tip + 1)
        self.client.set_dynamics(self.body, links, linearDamping=damping, angularDamping=damping)


class Pybullet(PhysicsBackend):
    """PyBullet (Bullet's articulated bodies) with explicit torques of the laws."""

    capabilities: ClassVar[Capabilities] = Capabilities(
        ("revolute", "spherical", "prismatic"), dynamic=True, free_bases=True
    )
    export_format: ClassVar[str] = "urdf"
    config: PybulletConfig

    def effort_tolerance(self) -> float:
        """Return the config's."""
        return self.config.tolerance

    def added_damping(self) -> str:
        """Return the joint damping, where it is not 0."""
        damping = self.config.joint_damping
        return f"joint_damping {damping:g} N·m·s/rad" if damping else ""

    def build(self, chain: ChainModel) -> BulletSimulation:
        kind = PublishedSimulation if self.config.preset == "published" else BulletSimulation
        return kind(chain, self.config)

    def build_scene(self, scene: Scene) -> SceneSimulation:
        if self.config.preset == "published":
            raise UserError(
                "physics.preset 'published' is a baseline for single chains: leave it out for tasks with contact"
            )
        # Law functions are compiled for scenes only: single chains do not wait for numba.
        from pliant_plugins.physics.pybullet.scene import BulletScene

        return BulletScene(scene, self.config)

    def preparing(self, chain: ChainModel, histories: bool = True) -> str | None:
        if self.config.preset == "published":
            return (
                "physics.preset 'published' steps through time as published, but equilibria, which this task asks "
                "for, are found as without it."
            )
        return None

    def export(self, chain: ChainModel, path: Path, looks: ChainModel | None = None) -> tuple[Path, ...]:
        return write_urdf(chain, path, looks)
