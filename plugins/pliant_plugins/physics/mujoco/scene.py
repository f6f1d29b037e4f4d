"""A scene in MuJoCo: arms on a moving carriage, free objects, contact with Coulomb friction.

The internal step is short while an arm is near an object or an object moves, and long in free space. Near is
what MuJoCo's collision detection lists: pairs of arm and object closer than the config's `near`. That list is
one step old, so free steps are so short that nothing moves further than half of `near` in one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
from numba import njit

from pliant.errors import UserError
from pliant.mechanics.rotations import matrix_of_quaternion, quaternion_of_matrix
from pliant.mechanics.statics import Loads
from pliant.mechanics.terms import Memory
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.rollout import Inputs
from pliant.records.scene import Contact, Scene, SceneState
from pliant.records.shape import Shape
from pliant_plugins.physics.compiled.motion import drive_arms
from pliant_plugins.physics.dynamic import ArmsScene, contact_of
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.mujoco.joints import ChainJoints
from pliant_plugins.physics.mujoco.mjcf import CARRIAGE_DOFS, CARRIAGE_KG, Geom, scene_mjcf
from pliant_plugins.physics.mujoco.warned import silent, unstable

# Everything that the next step depends on but inputs, which the snapshot's user gives again.
STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS | mujoco.mjtState.mjSTATE_WARMSTART
OBJECT_DOFS = 6
# An object that is slower rests.
REST_M_S = 2e-3
# Nothing may move further in a step than this share of the distance that counts as near: what is far in a
# list that is one step old is then still apart after the next.
SHARE = 0.5
# What stands for bodies that are not objects; these are numbered from 0.
ARM, FLOOR = -2, -1


class MujocoScene(ArmsScene):
    """A scene in MuJoCo, its arms driven by their laws at every step; see `SceneSimulation`."""

    def __init__(self, scene: Scene, config: MujocoConfig) -> None:
        """Raises `UserError` for a MuJoCo that is too old."""
        if not hasattr(mujoco.mjtIntegrator, "mjINT_DISCRETE"):
            raise UserError(
                f"scenes need MuJoCo 3.13 or later, which has the integrator 'discrete'; here is {mujoco.__version__}. "
                "Install it with: pip install --upgrade mujoco"
            )
        super().__init__(scene, [arm.chain for arm in scene.arms])
        self._config = config
        mjcf, geoms = scene_mjcf(scene, config)
        self._model = model = mujoco.MjModel.from_xml_string(mjcf)
        self._data = data = mujoco.MjData(model)
        self._arms = [
            ChainJoints(model, data, chain, statics, f"arm_{k}_")
            for k, (chain, statics) in enumerate(zip(self._chains, self._statics, strict=True))
        ]
        self._driver = Arms(model, data, self._arms, config.joint_damping)
        self._driver.apply(self._loads)
        self._parts = {model.geom(geom.name).id: geom.part for geom in geoms}
        self._nearness = Nearness(scene, model, geoms, config)
        first = model.nv - OBJECT_DOFS * len(scene.objects)
        self._object_poses = data.qpos[model.nq - 7 * len(scene.objects) :].reshape(-1, 7)
        self._object_rates = data.qvel[first:].reshape(-1, OBJECT_DOFS)
        self._first_object = model.nbody - len(scene.objects)
        carriage = slice(0, CARRIAGE_DOFS)
        self._carriage = (data.qpos[carriage], data.qvel[carriage], data.qfrc_applied[carriage])
        # Whether MuJoCo's contacts are those of the last step, and not of one before `restore`.
        self._has_contacts = False
        self._look()
        self._near = self._nearness.is_near(data)

    @property
    def joints(self) -> Sequence[ChainJoints]:
        return self._arms

    def apply(self, inputs: Sequence[Inputs]) -> None:
        super().apply(inputs)
        self._driver.apply(self._loads)

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
        data, contacts = self._data, []
        # In MuJoCo's order; its normal and its force are those on the second geom.
        for index in np.flatnonzero(data.contact.efc_address >= 0).tolist():
            contact, force = data.contact[index], np.zeros(6)
            frame = contact.frame.reshape(3, 3)
            mujoco.mj_contactForce(self._model, data, index, force)
            one, other = (self._parts[int(geom)] for geom in contact.geom)
            place, friction = contact.pos.copy(), force[1:3] @ frame[1:]
            order = "arm floor object"
            contacts.append(contact_of(one, other, place, 1.0 * frame[0], float(force[0]), friction, order))
        return tuple(contacts)


class Nearness:
    """Whether arms are near objects, and how fast anything moves."""

    def __init__(
        self, scene: Scene, model: mujoco.MjModel, geoms: Sequence[Geom], config: MujocoConfig
    ) -> None:
        self._bodies = np.full(model.ngeom, FLOOR)
        for geom in geoms:
            number = {"arm": ARM, "floor": FLOOR}.get(geom.part.kind, geom.part.number)
            self._bodies[model.geom(geom.name).id] = number
        reaches = [np.ones(CARRIAGE_DOFS)]
        for arm in scene.arms:
            reaches.append(np.repeat(_reaches(arm.chain), 3 if arm.chain.laws[0].joint == "spherical" else 1))
        self._arms = np.concatenate(reaches)
        self._objects = np.array([_extent(free.shapes) for free in scene.objects])
        self._long = config.timestep_s
        self._short = min(config.contact_timestep_s, config.timestep_s)
        self._room = SHARE * config.near_m

    def is_near(self, data: mujoco.MjData) -> bool:
        """Whether an arm is near an object by the last list of contacts, or an object touches nothing."""
        contacts = data.contact
        return bool(_is_near(contacts.geom, contacts.efc_address, self._bodies, len(self._objects)))

    def longest_step(self, rates: Array, near: bool) -> float:
        """Longest step (s) from the present velocities of all dofs."""
        if not len(self._objects):
            return self._long
        if near:
            return self._short
        arms, objects = _speeds(rates, self._arms, self._objects)
        if objects > REST_M_S:
            return self._short
        return max(self._short, min(self._long, self._room / max(arms + objects, 1e-9)))


@njit(cache=True)
def _is_near(geoms, rows, bodies, n_objects):  # type: ignore[no-untyped-def]
    """See `Nearness.is_near`; `bodies` are the geoms' objects, ARM or FLOOR, `rows` ≥ 0 where forces act."""
    touched = np.zeros(n_objects, np.bool_)
    for k in range(len(geoms)):
        for side in range(2):
            body = bodies[geoms[k, side]]
            if body == ARM:
                return True
            if body >= 0 and rows[k] >= 0:
                touched[body] = True
    return not touched.all()


@njit(cache=True)
def _speeds(rates, reaches, extents):  # type: ignore[no-untyped-def]
    """Bounds of the speed of any point of carriage and arms, and of the objects."""
    arms, objects = 0.0, 0.0
    n = len(reaches)
    for k in range(n):
        arms += abs(rates[k]) * reaches[k]
    for k in range(len(extents)):
        v = rates[n + 6 * k : n + 6 * k + 6]
        linear = np.sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2)
        objects = max(objects, linear + extents[k] * np.sqrt(v[3] ** 2 + v[4] ** 2 + v[5] ** 2))
    return arms, objects


def _reaches(chain: ChainModel) -> Array:
    """(n,) how far the farthest point beyond each joint is from it at most; 1 for prismatic joints."""
    n = chain.n_joints
    if chain.laws[0].joint == "prismatic":
        return np.ones(n)
    links = np.array([np.linalg.norm(joint.offset_m) for joint in chain.joints[1:]] + [0.0])
    own = [float(np.linalg.norm(chain.tip_offset_m)) if i == n - 1 else 0.0 for i in range(n)]
    if chain.shapes:
        own = [max(o, _extent(shapes)) for o, shapes in zip(own, chain.shapes[1:], strict=True)]
    reaches = np.empty(n)
    beyond = 0.0
    for i in range(n - 1, -1, -1):
        beyond = max(own[i], links[i] + beyond)
        reaches[i] = beyond
    return reaches


def _extent(shapes: Sequence[Shape]) -> float:
    """Farthest distance of any point of the shapes from the origin of their body, or a little more."""
    found = [0.0]
    for shape in shapes:
        if shape.mesh is not None:
            own = float(np.linalg.norm(shape.mesh.vertices_m, axis=1).max())
        else:
            own = float(np.linalg.norm(shape.size_m)) + (shape.size_m[0] if shape.kind == "capsule" else 0.0)
        found.append(float(np.linalg.norm(shape.position_m)) + own)
    return max(found)


class Arms:
    """The arms of a scene as its steps drive them."""

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, joints: Sequence[ChainJoints], damping: float
    ) -> None:
        self._joints, self._physical = joints, damping
        self._engine = (data.qpos, data.qvel, data.qfrc_applied, model.dof_damping)
        self._laws = None if any(arm.rested() is not None for arm in joints) else _joined(joints)
        table, last = [], 0
        for arm in joints:
            first, last = last, last + arm.n_joints
            table.append([first, last, arm.coordinate, arm.dof, arm.ball, arm.main])
        self._table = np.array(table, np.int64).reshape(-1, 6)
        self._axes = np.array([arm.layout[1] for arm in joints], np.int64).reshape(-1, 3)
        self._loads: Sequence[Loads] = ()
        # What law terms know of the past, arm by arm; None where an arm has none.
        self.memories: list[Memory | None] = [arm.rested() for arm in joints]
        self._pulled = False

    def apply(self, loads: Sequence[Loads]) -> None:
        """Loads of each arm from now on."""
        self._loads = loads
        self._pulled = any(of_arm.forces or of_arm.cords for of_arm in loads)
        for arm, of_arm in zip(self._joints, loads, strict=True):
            arm.push_tip(of_arm)
        if self._laws is not None:
            pairs = zip(self._joints, loads, strict=True)
            self._values = np.array([arm.statics.efforts.values(of_arm.actuation) for arm, of_arm in pairs])
            self._moments = np.array([of_arm.moment_n_m for of_arm in loads])

    def drive(self, step_s: float) -> None:
        """Forces of laws and loads for a step of this length, which the model has too."""
        if self._laws is None or self._pulled:
            for arm, loads, memory in zip(self._joints, self._loads, self.memories, strict=True):
                arm.drive(loads if memory is None else loads.after(memory.over(step_s)), self._physical)
            return
        table, inputs = (self._table, self._axes), (self._values, self._moments)
        drive_arms(self._laws, self._joints[0].terms, *table, inputs, self._physical, step_s, self._engine)

    def remember(self, step_s: float) -> None:
        """Let law terms remember a step of this length that has ended where the arms are."""
        for k, (arm, loads, memory) in enumerate(zip(self._joints, self._loads, self.memories, strict=True)):
            if memory is not None:
                self.memories[k] = arm.remember(loads.after(memory.over(step_s))).memory

    def recall(self, states: Sequence[Array | None]) -> None:
        """Set what law terms remember, for arms that are where they were then; rested where nothing is given."""
        self.memories = [arm.rested() for arm in self._joints]
        for k, (arm, memory) in enumerate(zip(self._joints, self.memories, strict=True)):
            known = states[k] if k < len(states) else None
            if memory is not None:
                given = memory.states if known is None else known.copy()
                self.memories[k] = replace(memory, previous=arm.q, states=given)


def _joined(joints: Sequence[ChainJoints]) -> Any:
    """Laws of all arms in a row; None where one has none, or actuators differ."""
    each = [arm.laws for arm in joints]
    known = [laws for laws in each if laws is not None]
    if not known or len(known) < len(each) or any(not np.array_equal(k[3], known[0][3]) for k in known):
        return None
    before = np.cumsum([0, *(len(laws[2]) for laws in known)])
    spans = [laws[1] + start for laws, start in zip(known, before, strict=False)]
    join = np.concatenate
    return join([k[0] for k in known]), join(spans), join([k[2] for k in known]), known[0][3]
