"""A still of a MuJoCo model and the points in it at which effects act, drawn without OpenGL.

The geoms that MuJoCo shows by default are sampled densely into a depth buffer, seen from a corner.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from pliant.interfaces.model import SystemPicture
from pliant.records.design import Array
from pliant_mjcf.mjcf import element_names
from pliant_mjcf.surfaces import geom_triangles, sampled
from pliant_plugins.physics.mujoco.warned import silent

SIZE = (960, 640)
AZIMUTH, ELEVATION = np.radians(125.0), np.radians(-20.0)
MARGIN = 0.12  # of the picture, on each side
SHOWN_GROUPS = 3  # groups of geoms that MuJoCo shows by default are those below
PULLEY = -2  # in the list of a tendon's objects
PAPER = np.array([255, 255, 255], np.uint8)
CORD = np.array([0.85, 0.45, 0.15])
LIGHT = np.array([-0.3, -0.55, 0.78])
FLAT = (int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD), int(mujoco.mjtGeom.mjGEOM_SDF))


def draw(model: Any, places: Sequence[tuple[str, str]]) -> SystemPicture | None:
    """Return the model at its first keyframe, or as the MJCF states it; None where it shows nothing.

    Args:
        model: compiled.
        places: kind and name of the places to find: ``("joint", "elbow")``.
    """
    data = mujoco.MjData(model)
    with silent():
        if model.nkey:
            mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_forward(model, data)
    seen = [k for k in range(model.ngeom) if _is_shown(model, k)]
    pieces = [(*_placed(model, data, k), np.array(model.geom_rgba[k][:3])) for k in _coloured(model, seen)]
    if not pieces:
        return None
    view = _View(np.concatenate([corners.reshape(-1, 3) for corners, _, _ in pieces]))
    for corners, _, colour in pieces:
        view.add(corners, colour)
    for one, other in _cords(model, data):
        view.add_line(one, other, CORD)
    return SystemPicture(view.pixels(), tuple(_seen_at(model, data, view, *place) for place in places))


def _is_shown(model: Any, k: int) -> bool:
    return int(model.geom_type[k]) not in FLAT and int(model.geom_group[k]) < SHOWN_GROUPS


def _coloured(model: Any, seen: list[int]) -> list[int]:
    """Return the geoms that are not transparent; every geom if all are."""
    return [k for k in seen if model.geom_rgba[k][3] > 0.0] or seen


def _placed(model: Any, data: Any, k: int) -> tuple[Array, int]:
    """Return (t, 3, 3) corners of a geom's triangles in the world, and its number."""
    turn = data.geom_xmat[k].reshape(3, 3)
    return geom_triangles(model, k) @ turn.T + data.geom_xpos[k], k


def _cords(model: Any, data: Any) -> list[tuple[Array, Array]]:
    """Return the straight pieces of tendons in space."""
    points, objects = data.wrap_xpos.reshape(-1, 3), data.wrap_obj.ravel()
    return [
        (points[k], points[k + 1])
        for at, count in zip(data.ten_wrapadr, data.ten_wrapnum, strict=True)
        for k in range(int(at), int(at + count) - 1)
        if PULLEY not in (int(objects[k]), int(objects[k + 1]))
    ]


class _View:
    """A depth buffer of an orthographic view from a corner that shows all points (k, 3)."""

    def __init__(self, points: Array) -> None:
        a, e = AZIMUTH, ELEVATION
        forward = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([np.sin(a), -np.cos(a), 0.0])
        self.axes = np.stack([right, np.cross(right, forward), forward])
        flat = points @ self.axes[:2].T
        low, high = flat.min(axis=0), flat.max(axis=0)
        free = (1.0 - 2.0 * MARGIN) * np.array(SIZE)
        self.scale = float((free / np.maximum(high - low, 1e-9)).min())
        self.middle = 0.5 * (low + high)
        self.depth = np.full(SIZE[::-1], np.inf)
        self.colour = np.tile(PAPER, (*SIZE[::-1], 1))

    def at(self, points: Array) -> Array:
        """Return (k, 3) column, row and depth in pixels."""
        seen = points @ self.axes.T
        flat = (seen[:, :2] - self.middle) * self.scale
        return np.column_stack(
            [0.5 * SIZE[0] + flat[:, 0], 0.5 * SIZE[1] - flat[:, 1], self.scale * seen[:, 2]]
        )

    def add(self, corners: Array, colour: Array) -> None:
        """Draw (t, 3, 3) triangles."""
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(normal, axis=1)
        corners, normal = corners[length > 0.0], normal[length > 0.0] / length[length > 0.0, None]
        normal *= -np.sign(normal @ self.axes[2])[:, None]  # towards the camera
        light = 0.62 + 0.38 * np.clip(normal @ LIGHT, -0.4, 1.0)
        points, which = sampled(self.at(corners.reshape(-1, 3)).reshape(-1, 3, 3))
        self._put(points, np.clip(colour * light[which, None], 0.0, 1.0))

    def add_line(self, one: Array, other: Array, colour: Array) -> None:
        """Draw a line of three pixels' width."""
        ends = self.at(np.stack([one, other]))
        steps = np.linspace(0.0, 1.0, 2 + int(2.0 * np.abs(ends[1] - ends[0]).max()))[:, None]
        middle = ends[0] + steps * (ends[1] - ends[0])
        for dx, dy in ((0, 0), (1, 0), (0, 1), (-1, 0), (0, -1)):
            points = middle + np.array([dx, dy, -1.0])
            self._put(points, np.tile(colour, (len(points), 1)))

    def _put(self, points: Array, colours: Array) -> None:
        """Write the nearest point of each pixel."""
        column, row = np.floor(points[:, :2]).astype(int).T
        inside = (column >= 0) & (column < SIZE[0]) & (row >= 0) & (row < SIZE[1])
        column, row, depth, colours = column[inside], row[inside], points[inside, 2], colours[inside]
        order = np.argsort(-depth, kind="stable")  # the nearest is written last
        column, row, depth, colours = column[order], row[order], depth[order], colours[order]
        nearest = np.full(self.depth.shape, -1)
        nearest[row, column] = np.arange(len(row))
        there = nearest >= 0
        found = nearest[there]
        visible = depth[found] < self.depth[there]
        rows, columns = np.nonzero(there)
        rows, columns, found = rows[visible], columns[visible], found[visible]
        self.depth[rows, columns] = depth[found]
        self.colour[rows, columns] = np.round(255.0 * colours[found]).astype(np.uint8)

    def pixels(self) -> NDArray[np.uint8]:
        """Return the picture, with darker outlines where the depth jumps."""
        depth = np.where(np.isfinite(self.depth), self.depth, 1e6)
        edge = np.zeros(depth.shape, bool)
        for axis in (0, 1):
            jump = np.abs(np.diff(depth, axis=axis)) > 8.0
            pad = [(0, 1), (0, 0)] if axis == 0 else [(0, 0), (0, 1)]
            edge |= np.pad(jump, pad)
        colour = self.colour.copy()
        colour[edge] = (0.45 * colour[edge]).astype(np.uint8)
        return colour


def _seen_at(model: Any, data: Any, view: _View, place: str, name: str) -> tuple[float, float] | None:
    """Return column and row of a place; None for the world and unknown ones."""
    point = _point(model, data, place, name)
    if point is None:
        return None
    column, row, _ = view.at(point[None])[0]
    return float(column), float(row)


def _point(model: Any, data: Any, place: str, name: str) -> Array | None:
    """Return where a place is in the world; an actuator is where it acts, a sensor where its object is."""
    if place in ("joint", "tendon", "body"):
        number = element_names(model, place).get(name)
        if number is None:
            return None
        if place == "joint":
            return np.asarray(data.xanchor[number])
        if place == "body":
            return np.asarray(data.xipos[number])
        return _tendon_point(model, data, number)
    if place == "actuator":
        k = model.actuator(name).id
        kind, target = int(model.actuator_trntype[k]), int(model.actuator_trnid[k][0])
        if kind == int(mujoco.mjtTrn.mjTRN_TENDON):
            return _tendon_point(model, data, target)
        if kind == int(mujoco.mjtTrn.mjTRN_SITE):
            return np.asarray(data.site_xpos[target])
        joints = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
        return np.asarray(data.xanchor[target]) if kind in joints else None
    if place == "sensor":
        k = model.sensor(name).id
        points = {"JOINT": data.xanchor, "SITE": data.site_xpos, "BODY": data.xipos, "XBODY": data.xpos}
        kind_of = mujoco.mjtObj(int(model.sensor_objtype[k])).name.removeprefix("mjOBJ_")
        return np.asarray(points[kind_of][model.sensor_objid[k]]) if kind_of in points else None
    return None


def _tendon_point(model: Any, data: Any, tendon: int) -> Array | None:
    """Return the middle of a tendon's path; of a sum of joints, its first joint."""
    count, at = int(data.ten_wrapnum[tendon]), int(data.ten_wrapadr[tendon])
    if count:
        return np.asarray(data.wrap_xpos.reshape(-1, 3)[at : at + count].mean(axis=0))
    first = model.tendon_adr[tendon]
    is_joint = int(model.wrap_type[first]) == int(mujoco.mjtWrap.mjWRAP_JOINT)
    return np.asarray(data.xanchor[model.wrap_objid[first]]) if is_joint else None
