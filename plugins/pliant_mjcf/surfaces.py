"""Triangles of MuJoCo's geoms, and points that cover them."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array

AROUND, ALONG = 28, 14  # pieces of a round surface
MOST_STEPS = 400  # of a triangle's side


def geom_triangles(model: Any, k: int) -> Array:
    """Return (t, 3, 3) corners of a geom's triangles, in its own frame."""
    kind, size = mujoco.mjtGeom(int(model.geom_type[k])), np.array(model.geom_size[k])
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        return mesh_triangles(model, int(model.geom_dataid[k]))
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return _box() * size
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return _capsule(0.0) * size[0]
    if kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
        return _capsule(0.0) * size
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        return _capsule(float(size[1] / size[0])) * size[0]
    return _cylinder() * np.array([size[0], size[0], size[1]])


def mesh_triangles(model: Any, mesh: int) -> Array:
    """Return (t, 3, 3) corners of a mesh; of none for a mesh without faces."""
    if mesh < 0:
        return np.zeros((0, 3, 3))
    vertices = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]]
    faces = model.mesh_face[model.mesh_faceadr[mesh] :][: model.mesh_facenum[mesh]]
    return np.asarray(vertices, float)[faces]


def sampled(corners: Array) -> tuple[Array, NDArray[np.intp]]:
    """Return points (k, 3) no farther apart than a pixel on triangles (t, 3, 3), and each point's triangle."""
    sides = np.abs(corners - np.roll(corners, 1, axis=1))[:, :, :2].max(axis=(1, 2), initial=0.0)
    steps = np.clip(np.ceil(1.5 * sides).astype(int), 1, MOST_STEPS)
    points, which = [], []
    for count in np.unique(steps):
        some = np.flatnonzero(steps == count)
        i, j = np.meshgrid(np.arange(count + 1), np.arange(count + 1))
        inside = i + j <= count
        u, v = i[inside] / count, j[inside] / count
        a, b, c = corners[some].transpose(1, 0, 2)
        found = a[:, None] + u[None, :, None] * (b - a)[:, None] + v[None, :, None] * (c - a)[:, None]
        points.append(found.reshape(-1, 3))
        which.append(np.repeat(some, len(u)))
    if not points:
        return np.zeros((0, 3)), np.zeros(0, np.intp)
    return np.concatenate(points), np.concatenate(which)


def _grid(points: Array) -> Array:
    """Return (t, 3, 3) triangles between neighbours of (m, n, 3) points."""
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    return np.concatenate([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)]).reshape(-1, 3, 3)


def _capsule(half: float) -> Array:
    """Return a capsule of radius 1 along z with cylinder half-length `half`; a sphere at 0."""
    around = np.linspace(0.0, 2.0 * np.pi, AROUND + 1)
    up = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 2 * (ALONG // 2) + 1)
    up = np.insert(up, ALONG // 2, 0.0)  # the equator is two circles
    shift = np.repeat([-half, half], len(up) // 2)
    rings = np.stack(
        [
            np.cos(up)[:, None] * np.cos(around),
            np.cos(up)[:, None] * np.sin(around),
            np.broadcast_to((np.sin(up) + shift)[:, None], (len(up), len(around))),
        ],
        axis=-1,
    )
    return _grid(rings)


def _cylinder() -> Array:
    """Return a cylinder of radius 1 and half-length 1 along z."""
    around = np.linspace(0.0, 2.0 * np.pi, AROUND + 1)
    circle = np.stack([np.cos(around), np.sin(around)], axis=1)
    rings = [
        np.column_stack([r * circle, np.full(len(circle), z)]) for r, z in ((0, -1), (1, -1), (1, 1), (0, 1))
    ]
    return _grid(np.stack(rings))


def _box() -> Array:
    """Return the cube from −1 to 1."""
    square = np.array([[[-1.0, -1.0, 1.0], [-1.0, 1.0, 1.0]], [[1.0, -1.0, 1.0], [1.0, 1.0, 1.0]]])
    face = _grid(square)
    turned = [np.roll(sign * face, shift, axis=2) for shift in range(3) for sign in (1.0, -1.0)]
    return np.concatenate(turned)
