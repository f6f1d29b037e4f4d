"""A scene in MuJoCo: arms on a moving carriage, free objects, contact with Coulomb friction.

The internal step is short while an arm is near an object or an object moves, and long in free space. Near is
what MuJoCo's collision detection lists: pairs of arm and object closer than the config's `near`. That list is
one step old, so free steps are so short that nothing moves further than half of `near` in one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import mujoco
import numpy as np

from pliant.errors import ContractError, UserError
from pliant.interfaces.physics import SceneSimulation
from pliant.mechanics.rotations import matrix_of_quaternion, quaternion_of_matrix
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.design import Array
from pliant.records.rollout import Inputs, OutsideDomain
from pliant.records.scene import Contact, Scene, SceneState
from pliant_plugins.physics.mujoco.arms import Arms
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.mujoco.contacts import ContactReader
from pliant_plugins.physics.mujoco.joints import ChainJoints
from pliant_plugins.physics.mujoco.nearness import Nearness
from pliant_plugins.physics.mujoco.scene_mjcf import CARRIAGE_DOFS, CARRIAGE_KG, arm_prefix, scene_mjcf
from pliant_plugins.physics.mujoco.warned import silent, unstable

# Everything that the next step depends on but inputs, which the snapshot's user gives again.
STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS | mujoco.mjtState.mjSTATE_WARMSTART
OBJECT_DOFS = 6


class MujocoScene(SceneSimulation):
    """See `SceneSimulation`."""

    def __init__(self, scene: Scene, config: MujocoConfig) -> None:
        """Raises `UserError` for a MuJoCo that is too old."""
        if not hasattr(mujoco.mjtIntegrator, "mjINT_DISCRETE"):
            raise UserError(
                f"scenes need MuJoCo 3.13 or later, which has the integrator 'discrete'; here is {mujoco.__version__}. "
                "Install it with: pip install --upgrade mujoco"
            )
        self.scene = scene
        self._config = config
        document = scene_mjcf(scene, config)
        self._model = model = mujoco.MjModel.from_xml_string(document.mjcf)
        self._data = data = mujoco.MjData(model)
        statics = [ChainStatics(arm.chain) for arm in scene.arms]
        self._arms = [
            ChainJoints(model, data, arm.chain, one, arm_prefix(k))
            for k, (arm, one) in enumerate(zip(scene.arms, statics, strict=True))
        ]
        self._driver = Arms(model, data, self._arms, config.joint_damping)
        self._loads = [Loads.unactuated(arm.chain) for arm in scene.arms]
        self._driver.apply(self._loads)
        self._reader = ContactReader(model, data, document.geoms)
        self._nearness = Nearness(scene, model, document.geoms, config)
        first = model.nv - OBJECT_DOFS * len(scene.objects)
        self._object_poses = data.qpos[model.nq - 7 * len(scene.objects) :].reshape(-1, 7)
        self._object_rates = data.qvel[first:].reshape(-1, OBJECT_DOFS)
        self._first_object = model.nbody - len(scene.objects)
        carriage = slice(0, CARRIAGE_DOFS)
        self._carriage = (data.qpos[carriage], data.qvel[carriage], data.qfrc_applied[carriage])
        self._velocity = np.zeros(CARRIAGE_DOFS)
        self._time_s = 0.0
        # Whether MuJoCo's contacts are those of the last step, and not of one before `restore`.
        self._has_contacts = False
        self._look()
        self._near = self._nearness.is_near(data)

    def apply(self, inputs: Sequence[Inputs]) -> None:
        if len(inputs) != len(self._arms):
            raise ContractError(f"the scene has {len(self._arms)} arms and got inputs for {len(inputs)}")
        for joints, given in zip(self._arms, inputs, strict=True):
            joints.statics.efforts.values(given.actuation)
        self._loads = [Loads.of(arm.chain, given) for arm, given in zip(self.scene.arms, inputs, strict=True)]
        self._driver.apply(self._loads)

    def carry(self, velocity_m_s: Array) -> None:
        self._velocity = np.array(velocity_m_s, float)

    def push(self, index: int, force_n: Array, moment_n_m: Array | None = None) -> None:
        moment = np.zeros(3) if moment_n_m is None else moment_n_m
        self._data.xfrc_applied[self._first_object + index] = np.concatenate([force_n, moment])

    def step(self, duration_s: float) -> None:
        remaining = duration_s
        pushed = bool(self._data.xfrc_applied[self._first_object :].any())
        with silent():
            while remaining > 0.0:
                longest = self._nearness.longest_step(self._data.qvel, self._near or pushed)
                parts = math.ceil(remaining / longest - 1e-9)
                step_s = remaining / max(parts, 1)
                self._advance(step_s)
                remaining = remaining - step_s if parts > 1 else 0.0
        self._time_s += duration_s
        bad = unstable(self._data)
        if bad is not None:
            raise UserError(
                f"the motion of the scene became unbounded before {self._time_s:.4g} s ({bad}): shorten "
                f"physics.contact_timestep_s ({self._config.contact_timestep_s:g} s), raise physics.joint_damping, "
                "or look whether a law is used far outside its data"
            )

    def _advance(self, step_s: float) -> None:
        model, data = self._model, self._data
        model.opt.timestep = step_s
        self._driver.drive(step_s)
        # A force that brings the carriage to its velocity in one step: the arms feel its acceleration.
        place, velocity, force = self._carriage
        force[:] = CARRIAGE_KG / step_s * (self._velocity - velocity)
        there = place + step_s * self._velocity
        mujoco.mj_step(model, data)
        place[:], velocity[:] = there, self._velocity
        self._driver.remember(step_s)
        self._near, self._has_contacts = self._nearness.is_near(data), True

    def snapshot(self) -> SceneState:
        poses, rates = self._object_poses, self._object_rates
        rotations = matrix_of_quaternion(poses[:, 3:])
        spins = np.einsum("kij,kj->ki", rotations, rates[:, 3:])
        private = np.empty(mujoco.mj_stateSize(self._model, STATE))
        mujoco.mj_getState(self._model, self._data, private, STATE)
        return SceneState(
            time_s=self._time_s,
            carriage_m=self._data.qpos[:CARRIAGE_DOFS].copy(),
            coordinates=tuple(joints.q for joints in self._arms),
            rates=tuple(joints.rates for joints in self._arms),
            positions_m=poses[:, :3].copy(),
            rotations=rotations,
            velocities=np.concatenate([rates[:, :3], spins], axis=1),
            memories=tuple(None if m is None else m.states.copy() for m in self._driver.memories),
            private={"mujoco": private, "near": np.array([self._near])},
        )

    def restore(self, state: SceneState) -> None:
        data = self._data
        if "mujoco" in state.private:
            mujoco.mj_setState(self._model, data, state.private["mujoco"], STATE)
        else:
            self._place(state)
        self._driver.recall(state.memories)
        self._time_s, self._has_contacts = state.time_s, False
        if "near" in state.private:
            self._near = bool(state.private["near"][0])
        else:
            self._look()
            self._near = self._nearness.is_near(data)

    def _place(self, state: SceneState) -> None:
        """Return to a state that another engine left."""
        data = self._data
        data.qpos[:CARRIAGE_DOFS], data.qvel[:CARRIAGE_DOFS] = state.carriage_m, 0.0
        for joints, q, rates in zip(self._arms, state.coordinates, state.rates, strict=True):
            joints.place(q, rates)
        spins = np.einsum("kij,ki->kj", state.rotations, state.velocities[:, 3:])
        self._object_poses[:] = np.concatenate(
            [state.positions_m, quaternion_of_matrix(state.rotations)], axis=1
        )
        self._object_rates[:] = np.concatenate([state.velocities[:, :3], spins], axis=1)
        data.qacc_warmstart[:] = 0.0

    def _look(self) -> None:
        """Let MuJoCo find contacts and their forces in the present state, which stays as it is."""
        state = np.empty(mujoco.mj_stateSize(self._model, STATE))
        mujoco.mj_getState(self._model, self._data, state, STATE)
        with silent():
            mujoco.mj_forward(self._model, self._data)
        mujoco.mj_setState(self._model, self._data, state, STATE)
        self._has_contacts = True

    def markers(self, arm: int) -> Array:
        mujoco.mj_kinematics(self._model, self._data)
        return self._arms[arm].markers()

    def contacts(self) -> tuple[Contact, ...]:
        if not self._has_contacts:
            self._look()
        return self._reader.read()

    def outside_domain(self) -> tuple[OutsideDomain, ...]:
        found: list[OutsideDomain] = []
        before = 0
        for arm, joints, loads in zip(self.scene.arms, self._arms, self._loads, strict=True):
            of_arm = joints.statics.efforts.outside_domain(joints.q, loads.actuation, self._time_s)
            found += [replace(entry, module=entry.module + before) for entry in of_arm]
            before += arm.chain.n_joints
        return tuple(found)
