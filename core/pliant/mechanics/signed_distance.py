"""Signed distances of points from convex solids in the world: spheres, boxes, convex hulls of meshes.

The distance is negative inside. With its gradient n (a unit vector) and Hessian it gives contact forces and their
stiffness, and the slopes of a clearance.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
from scipy.spatial import ConvexHull

from pliant.errors import UserError
from pliant.records.design import Array
from pliant.records.shape import Shape

# Half-width of the central differences of a hull's gradient, m.
STEP_M = 1e-7
# A point closer to a centre or an edge than this has no direction.
NEAREST_M = 1e-12


class Distance(NamedTuple):
    """Signed distances (m,) of points in m, and their gradients (m, 3)."""

    value_m: Array
    normal: Array


class Solid(Protocol):
    """A convex solid at its place in the world."""

    def distance(self, points_m: Array) -> Distance:
        """Return signed distances of points (m, 3)."""

    def curvature(self, points_m: Array) -> Array:
        """Return the Hessians (m, 3, 3) of the distance, 1/m."""


def solid_from_shape(shape: Shape) -> Solid:
    """Return the solid of a collision shape.

    Raises:
        UserError: a shape without a signed distance here.
    """
    if shape.kind == "sphere":
        return Sphere(np.asarray(shape.position_m, float), shape.size_m[0])
    if shape.kind == "box":
        size, turn = np.asarray(shape.size_m, float), np.asarray(shape.rotation, float)
        return Box(np.asarray(shape.position_m, float), turn, size)
    if shape.kind == "mesh" and shape.mesh is not None:
        return Hull(shape.mesh.placed(shape.rotation, shape.position_m).vertices_m)
    raise UserError(f"an obstacle of kind '{shape.kind}' has no signed distance; use box, sphere or mesh.")


class Sphere:
    """A ball: d = |x − c| − r."""

    def __init__(self, centre_m: Array, radius_m: float) -> None:
        self._centre, self._radius = centre_m, radius_m

    def distance(self, points_m: Array) -> Distance:
        away = points_m - self._centre
        length = np.maximum(np.linalg.norm(away, axis=1), NEAREST_M)
        return Distance(length - self._radius, away / length[:, None])

    def curvature(self, points_m: Array) -> Array:
        length, normal = self.distance(points_m)
        return _round(normal, length + self._radius, np.ones_like(normal))


class Box:
    """A box of half edges h: outside, the distance from the nearest face, edge or corner; inside, from a face."""

    def __init__(self, centre_m: Array, rotation: Array, half_m: Array) -> None:
        self._centre, self._rotation, self._half = centre_m, rotation, half_m

    def distance(self, points_m: Array) -> Distance:
        local = (points_m - self._centre) @ self._rotation
        over = np.abs(local) - self._half
        beyond = np.maximum(over, 0.0)
        length = np.linalg.norm(beyond, axis=1)
        face = np.argmax(over, axis=1)
        inside = length < NEAREST_M
        normal = np.where(inside[:, None], np.eye(3)[face], beyond / np.maximum(length, NEAREST_M)[:, None])
        value = np.where(inside, over[np.arange(len(over)), face], length)
        return Distance(value, (normal * np.where(local < 0.0, -1.0, 1.0)) @ self._rotation.T)

    def curvature(self, points_m: Array) -> Array:
        local = (points_m - self._centre) @ self._rotation
        beyond = np.maximum(np.abs(local) - self._half, 0.0)
        length = np.linalg.norm(beyond, axis=1)
        normal = np.sign(local) * beyond / np.maximum(length, NEAREST_M)[:, None]
        hessian = _round(normal, length, (beyond > 0.0).astype(float))
        return np.asarray(self._rotation @ hessian @ self._rotation.T)


class Hull:
    """The convex hull of vertices: inside, the nearest face's plane; outside, the nearest triangle."""

    def __init__(self, vertices_m: Array) -> None:
        hull = ConvexHull(vertices_m)
        self._normals, self._offsets = hull.equations[:, :3], hull.equations[:, 3]
        self._corners = vertices_m[hull.simplices]

    def distance(self, points_m: Array) -> Distance:
        planes = points_m @ self._normals.T + self._offsets
        face = np.argmax(planes, axis=1)
        value, normal = planes[np.arange(len(planes)), face], self._normals[face].copy()
        outside = np.flatnonzero(value > NEAREST_M)
        if len(outside):
            away = points_m[outside] - self._nearest(points_m[outside])
            length = np.maximum(np.linalg.norm(away, axis=1), NEAREST_M)
            value[outside], normal[outside] = length, away / length[:, None]
        return Distance(value, normal)

    def curvature(self, points_m: Array) -> Array:
        steps = STEP_M * np.eye(3)
        slopes = [self.distance(points_m + s).normal - self.distance(points_m - s).normal for s in steps]
        return np.asarray(np.stack(slopes, axis=2) / (2.0 * STEP_M))

    def _nearest(self, points_m: Array) -> Array:
        """Return (m, 3) the nearest points of all triangles: in the plane where it projects inside, else on an edge."""
        a, b, c = np.moveaxis(self._corners, 1, 0)
        relative = points_m[:, None] - a
        normal = np.cross(b - a, c - a)
        size = np.einsum("fi,fi->f", normal, normal)
        v = np.einsum("mfi,fi->mf", np.cross(relative, c - a), normal) / size
        w = np.einsum("mfi,fi->mf", np.cross(b - a, relative), normal) / size
        projected = a + v[..., None] * (b - a) + w[..., None] * (c - a)
        candidates = [np.where(((v >= 0) & (w >= 0) & (v + w <= 1))[..., None], projected, np.inf)]
        for start, end in ((a, b), (b, c), (c, a)):
            along = end - start
            share = np.einsum("mfi,fi->mf", points_m[:, None] - start, along) / np.einsum(
                "fi,fi->f", along, along
            )
            candidates.append(start + np.clip(share, 0.0, 1.0)[..., None] * along)
        every = np.concatenate(candidates, axis=1)
        chosen = np.argmin(np.sum((every - points_m[:, None]) ** 2, axis=2), axis=1)
        return np.asarray(every[np.arange(len(points_m)), chosen])


def nearest(solids: Sequence[Solid], points_m: Array) -> Distance:
    """Return each point's distance from the nearest of several solids; infinite without any."""
    value, normal = np.full(len(points_m), np.inf), np.zeros((len(points_m), 3))
    for solid in solids:
        other = solid.distance(points_m)
        closer = other.value_m < value
        value = np.where(closer, other.value_m, value)
        normal = np.where(closer[:, None], other.normal, normal)
    return Distance(value, normal)


def _round(normal: Array, radius_m: Array, free: Array) -> Array:
    """Return (diag(free) − n nᵀ) / radius, the Hessian at a rounded surface; zero on faces, which are flat."""
    projected = np.eye(3) * free[:, None, :] - normal[:, :, None] * normal[:, None, :]
    scale = np.where(radius_m > NEAREST_M, 1.0 / np.maximum(radius_m, NEAREST_M), 0.0)
    return np.asarray(projected * scale[:, None, None])
