"""How long the next step of a scene may be."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numba import njit

from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.scene import Scene
from pliant.records.shape import Shape
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.mujoco.mjcf import CARRIAGE_DOFS, Geom

# An object that is slower rests.
REST_M_S = 2e-3
# Nothing may move further in a step than this share of the distance that counts as near: what is far in a
# list that is one step old is then still apart after the next.
SHARE = 0.5
# What stands for bodies that are not objects; these are numbered from 0.
ARM, FLOOR = -2, -1


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
