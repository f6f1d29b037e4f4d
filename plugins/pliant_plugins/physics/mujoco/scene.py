"""A scene in MuJoCo: arms on a moving carriage, free objects, contact with Coulomb friction.

The internal step is short while an arm is near what it can touch or an object moves, and long in free space. Near is
what MuJoCo's collision detection lists: pairs of an arm and another body closer than the config's `near`. That list is
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
from pliant.mechanics.rotations import matrix_from_quaternion, quaternion_from_matrix
from pliant.mechanics.terms import TermMemory
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.law import travels
from pliant.records.rollout import Inputs
from pliant.records.scene import Contact, Scene, SceneState
from pliant.records.shape import Shape
from pliant_plugins.physics.compiled.motion import drive_arms
from pliant_plugins.physics.dynamic import ArmsScene, ordered_contact
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.mujoco.joints import ChainJoints
from pliant_plugins.physics.mujoco.mjcf import CARRIAGE_DOFS, CARRIAGE_KG, scene_mjcf
from pliant_plugins.physics.mujoco.warned import silent, unstable

# Everything that the next step depends on but inputs, which the snapshot's user gives again.
STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS | mujoco.mjtState.mjSTATE_WARMSTART
OBJECT_DOFS = 6
# An object that is slower rests.
REST_M_S = 2e-3
# Largest motion in a step as a share of the distance that counts as near: bodies that are far in a list of
# the last step are then still apart after the next.
SHARE = 0.5
# Codes of bodies that are not objects; objects are numbered from 0.
ARM, FIXED = -2, -1


class MujocoScene(ArmsScene):
    """A scene in MuJoCo, its arms driven by their laws at every step; see `SceneSimulation`."""

    def __init__(self, scene: Scene, config: MujocoConfig) -> None:
        """Build the scene. Raises `UserError` for a MuJoCo that is too old."""
        if not hasattr(mujoco.mjtIntegrator, "mjINT_DISCRETE"):
            raise UserError(
                f"scenes need MuJoCo 3.13 or later, which has the integrator 'discrete'; here is {mujoco.__version__}. "
                "Install it with: pip install --upgrade mujoco"
            )
        super().__init__(scene, [arm.chain for arm in scene.arms])
        self._config = config
        self._steps_s = (min(config.contact_timestep_s, config.timestep_s), config.timestep_s)
        self._room_m = SHARE * config.near_m
        mjcf, geoms = scene_mjcf(scene, config)
        self._model = model = mujoco.MjModel.from_xml_string(mjcf)
        self._data = data = mujoco.MjData(model)
        self._arms = [
            ChainJoints(model, data, chain, statics, f"arm_{k}_")
            for k, (chain, statics) in enumerate(zip(self._chains, self._statics, strict=True))
        ]
        # Memory of law terms, arm by arm; None if an arm has none.
        self._memories: list[TermMemory | None] = [arm.rested() for arm in self._arms]
        self._engine = (data.qpos, data.qfrc_applied, model.dof_damping)
        self._laws = _joined(self._arms)
        ends = np.cumsum([0, *(arm.n_joints for arm in self._arms)])
        of_arm = enumerate(self._arms)
        table = [
            [*ends[k : k + 2], arm.coordinate, arm.dof, len(arm.statics.geometry.axes), arm.main]
            for k, arm in of_arm
        ]
        axes = np.array([arm.layout[1] for arm in self._arms], np.int64).reshape(-1, 3)
        reach = np.array([arm.layout[3] for arm in self._arms])
        self._table = (np.array(table, np.int64).reshape(-1, 6), axes, reach)
        self._take()
        self._parts = {model.geom(geom.name).id: geom.part for geom in geoms}
        self._bodies = np.full(model.ngeom, FIXED)
        for geom, part in self._parts.items():
            self._bodies[geom] = {"arm": ARM, "floor": FIXED, "obstacle": FIXED}.get(part.kind, part.number)
        reaches = [_reaches(chain) for chain in self._chains]
        self._reaches = np.concatenate([np.ones(CARRIAGE_DOFS), *reaches])
        self._extents = _object_extents(scene)
        names = [f"object_{k}" for k in range(len(scene.objects))]
        self._object_bodies = np.array([model.body(name).id for name in names], np.int64)
        free = model.body_jntadr[self._object_bodies]
        self._pose_at = model.jnt_qposadr[free][:, None] + np.arange(7)
        self._rates_at = model.jnt_dofadr[free][:, None] + np.arange(OBJECT_DOFS)
        dofs = [np.arange(arm.dof, arm.dof + arm.n_joints * arm.n_axes) for arm in self._arms]
        # Of carriage, arms and objects in this order; MuJoCo numbers arms after the object that carries them.
        self._dofs = np.concatenate([np.arange(CARRIAGE_DOFS), *dofs, self._rates_at.ravel()])
        carriage = slice(0, CARRIAGE_DOFS)
        self._carriage = (data.qpos[carriage], data.qvel[carriage], data.qfrc_applied[carriage])
        fixed = bool(scene.obstacles) or scene.floor_m is not None
        self._can_touch = bool(scene.objects) or scene.arms_touch or fixed
        # Whether MuJoCo's contacts are those of the last step, and not of one before `restore`.
        self._has_contacts = False
        self._look()
        self._near = self._is_near()

    @property
    def joints(self) -> Sequence[ChainJoints]:
        return self._arms

    def apply(self, inputs: Sequence[Inputs]) -> None:
        super().apply(inputs)
        self._take()

    def _take(self) -> None:
        """Set the loads of each arm."""
        self._pulled = any(loads.forces or loads.cords for loads in self._loads)
        pairs = list(zip(self._arms, self._loads, strict=True))
        for arm, loads in pairs:
            arm.push_tip(loads)
        if self._laws is not None:
            values = np.array([arm.statics.efforts.values(loads.actuation) for arm, loads in pairs])
            self._inputs = (values, np.array([loads.moment_n_m for _, loads in pairs]))

    def push(self, index: int, force_n: Array, moment_n_m: Array | None = None) -> None:
        moment = np.zeros(3) if moment_n_m is None else moment_n_m
        self._data.xfrc_applied[self._object_bodies[index]] = np.concatenate([force_n, moment])

    def step(self, duration_s: float) -> None:
        remaining = duration_s
        pushed = bool(self._data.xfrc_applied[self._object_bodies].any())
        with silent():
            while remaining > 0.0:
                longest = self._longest_step(self._near or pushed)
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
                "or check whether a law is used far outside its data"
            )

    def _is_near(self) -> bool:
        """Return whether an arm is near an object by the last list of contacts, or an object touches nothing."""
        contacts = self._data.contact
        return bool(_is_near(contacts.geom, contacts.efc_address, self._bodies, len(self._extents)))

    def _longest_step(self, near: bool) -> float:
        """Return longest step (s) from the present velocities of all dofs."""
        short, long = self._steps_s
        if not self._can_touch:
            return long
        if near:
            return short
        arms, objects = _speeds(self._data.qvel[self._dofs], self._reaches, self._extents)
        if objects > REST_M_S:
            return short
        both = 2.0 * arms if self.scene.arms_touch else arms
        return max(short, min(long, self._room_m / max(both + objects, 1e-9)))

    def _advance(self, step_s: float) -> None:
        model, data, damping = self._model, self._data, self._config.joint_damping
        model.opt.timestep = step_s
        if self._laws is None or self._pulled:
            for arm, loads, memory in zip(self._arms, self._loads, self._memories, strict=True):
                arm.drive(loads if memory is None else loads.after(memory.over(step_s)), damping)
        else:
            drive_arms(self._laws, *self._table, *self._inputs, damping, step_s, *self._engine)
        # A force that brings the carriage to its velocity in one step: the arms feel its acceleration.
        place, velocity, force = self._carriage
        force[:] = CARRIAGE_KG / step_s * (self._velocity - velocity)
        there = place + step_s * self._velocity
        mujoco.mj_step(model, data)
        place[:], velocity[:] = there, self._velocity
        # Law terms remember a step that has ended where the arms are.
        for k, memory in enumerate(self._memories):
            if memory is not None:
                loads = self._loads[k].after(memory.over(step_s))
                self._memories[k] = self._arms[k].remember(loads).memory
        self._near, self._has_contacts = self._is_near(), True

    def snapshot(self) -> SceneState:
        poses, rates = self._data.qpos[self._pose_at], self._data.qvel[self._rates_at]
        rotations = matrix_from_quaternion(poses[:, 3:])
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
            memories=tuple(None if m is None else m.states.copy() for m in self._memories),
            private={"mujoco": private, "near": np.array([self._near])},
        )

    def restore(self, state: SceneState) -> None:
        data = self._data
        if "mujoco" in state.private:
            mujoco.mj_setState(self._model, data, state.private["mujoco"], STATE)
        else:
            self._place(state)
        # At rest by default.
        self._memories = [arm.rested() for arm in self._arms]
        for k, (arm, memory) in enumerate(zip(self._arms, self._memories, strict=True)):
            known = state.memories[k] if k < len(state.memories) else None
            if memory is not None:
                given = memory.states if known is None else known.copy()
                self._memories[k] = replace(memory, previous=arm.q, states=given)
        self._time_s, self._has_contacts = state.time_s, False
        if "near" in state.private:
            self._near = bool(state.private["near"][0])
        else:
            self._look()
            self._near = self._is_near()

    def _place(self, state: SceneState) -> None:
        """Return to a state that another engine left."""
        data = self._data
        data.qpos[:CARRIAGE_DOFS], data.qvel[:CARRIAGE_DOFS] = state.carriage_m, 0.0
        for joints, q, rates in zip(self._arms, state.coordinates, state.rates, strict=True):
            joints.place(q, rates)
        spins = np.einsum("kij,ki->kj", state.rotations, state.velocities[:, 3:])
        data.qpos[self._pose_at] = np.concatenate(
            [state.positions_m, quaternion_from_matrix(state.rotations)], axis=1
        )
        data.qvel[self._rates_at] = np.concatenate([state.velocities[:, :3], spins], axis=1)
        data.qacc_warmstart[:] = 0.0

    def _look(self) -> None:
        """Let MuJoCo find contacts and their forces in the present state without changing it."""
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
            order = "arm floor obstacle object"
            apart = float(contact.dist)
            contacts.append(
                ordered_contact(one, other, place, 1.0 * frame[0], float(force[0]), friction, order, apart)
            )
        return tuple(contacts)


@njit(cache=True)
def _is_near(geoms, rows, bodies, n_objects):  # type: ignore[no-untyped-def]
    """See `MujocoScene._is_near`; `bodies` are the geoms' objects, ARM or FIXED, `rows` ≥ 0 where forces act."""
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
    """Return bounds of the speed of any point of carriage and arms, and of the objects."""
    arms, objects = 0.0, 0.0
    n = len(reaches)
    for k in range(n):
        arms += abs(rates[k]) * reaches[k]
    for k in range(len(extents)):
        v = rates[n + 6 * k : n + 6 * k + 6]
        linear = np.sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2)
        objects = max(objects, linear + extents[k] * np.sqrt(v[3] ** 2 + v[4] ** 2 + v[5] ** 2))
    return arms, objects


def _object_extents(scene: Scene) -> Array:
    """Return (k,) farthest distance of any point of each object, and of the arms that it carries, from its origin."""
    extents = [_extent(free.shapes) for free in scene.objects]
    for number, arm in enumerate(scene.arms):
        if arm.base_object is not None:
            place, _ = scene.base_on_object(number)
            own = (
                float(np.linalg.norm(place))
                + arm.chain.length_m
                + max(map(_extent, arm.chain.shapes), default=0.0)
            )
            extents[arm.base_object] = max(extents[arm.base_object], own)
    return np.array(extents)


def _reaches(chain: ChainModel) -> Array:
    """Return (n·a,) largest speeds of a point beyond each joint at a rate of 1; links as long as at rest."""
    n, along = chain.n_joints, np.array(travels(chain.laws[0].joint, chain.axes))
    links = np.array([np.linalg.norm(joint.offset_m) for joint in chain.joints[1:]] + [0.0])
    own = [float(np.linalg.norm(chain.tip_offset_m)) if i == n - 1 else 0.0 for i in range(n)]
    if chain.shapes:
        own = [max(o, _extent(shapes)) for o, shapes in zip(own, chain.shapes[1:], strict=True)]
    reaches = np.empty(n)
    beyond = 0.0
    for i in range(n - 1, -1, -1):
        beyond = max(own[i], links[i] + beyond)
        reaches[i] = beyond
    return np.where(along, 1.0, reaches[:, None]).ravel()


def _extent(shapes: Sequence[Shape]) -> float:
    """Return farthest distance of any point of the shapes from the origin of their body, or a little more."""
    found = [0.0]
    for shape in shapes:
        if shape.mesh is not None:
            own = float(np.linalg.norm(shape.mesh.vertices_m, axis=1).max())
        else:
            own = float(np.linalg.norm(shape.size_m)) + (shape.size_m[0] if shape.kind == "capsule" else 0.0)
        found.append(float(np.linalg.norm(shape.position_m)) + own)
    return max(found)


def _joined(joints: Sequence[ChainJoints]) -> Any:
    """Join the laws of all arms; None if one has none or has terms, or actuators differ."""
    each = [arm.laws if arm.rested() is None else None for arm in joints]
    known = [laws for laws in each if laws is not None]
    if not known or len(known) < len(each) or any(not np.array_equal(k[3], known[0][3]) for k in known):
        return None
    before = np.cumsum([0, *(len(laws[2]) for laws in known)])
    spans = [laws[1] + start for laws, start in zip(known, before, strict=False)]
    join = np.concatenate
    return (
        *(join([k[0] for k in known]), join(spans), join([k[2] for k in known]), known[0][3]),
        *(join([k[4] for k in known]), join([k[5] for k in known])),
    )
