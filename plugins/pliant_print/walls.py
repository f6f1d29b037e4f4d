"""What a printer needs to know of a solid: its thinnest wall and its overhangs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pliant.records.design import Array
from pliant.records.shape import TriangleMesh
from pliant_print.boolean import MM, surface

OPPOSITE = 0.85  # least cosine of the angle between both sides of a wall; a wedge has less
LONGEST = 1.05  # of the thinnest wall so far: a longer first ray needs no second one
MOST_RAYS = 60_000
NEAR_CORNER = 0.96  # of the way from a triangle's centre to its corner
STEP = 1e-6  # of the ray's length: its start below the face


@dataclass(frozen=True)
class Wall:
    """The thinnest wall: its thickness and the point (3,) from which it was measured."""

    thickness_m: float
    point_m: tuple[float, float, float]


@dataclass(frozen=True)
class Overhang:
    """Faces that look down more steeply than a printer can without support.

    Attributes:
        up: the direction that is up on the printer, in the file's frame.
        share: of the whole surface, above the printer's limit, without the face on the bed.
        worst_rad: largest angle from the vertical.
    """

    up: str
    share: float
    worst_rad: float


def thinnest_wall(body: Any, rays: int = MOST_RAYS) -> Wall:
    """Return the thinnest wall of a manifold: the shortest way from a face to one about opposite.

    A ray goes inward from a face; a second one from the same point at equal angles to both faces, as across a wedge.
    Four rays start in each triangle, at its centre and near its corners; of very many triangles in every n-th. Edges
    where faces meet at an acute angle are no walls.
    """
    skin = surface(body)
    corners = MM * skin.vertices_m[skin.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normal, axis=1)
    real = np.flatnonzero(area > 1e-9 * area.max())
    real = real[:: max(1, 4 * len(real) // rays)]
    centre = corners[real].mean(axis=1, keepdims=True)
    starts = np.concatenate([centre, centre + NEAR_CORNER * (corners[real] - centre)], axis=1)
    normals = np.repeat(normal[real] / area[real, None], 4, axis=0)
    reach = float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    best, where = np.inf, np.zeros(3)
    for start, n in zip(starts.reshape(-1, 3), normals, strict=True):
        begin = start - STEP * reach * n
        first = _opposite(body, begin, -n, n, min(reach, 2 * best))
        if first is None or first[0] > LONGEST * best:
            continue
        across = first[1] - n  # perpendicular to the plane midway between both sides
        across /= np.linalg.norm(across)
        second = _opposite(body, begin, across, n, min(reach, 2 * best)) or first
        thick = second[0] + STEP * reach
        if 3 * STEP * reach < thick < best:
            best, where = thick, start
    return Wall(best / MM, (float(where[0] / MM), float(where[1] / MM), float(where[2] / MM)))


def _opposite(body: Any, start: Array, way: Array, normal: Array, reach: float) -> tuple[float, Array] | None:
    """Return distance and normal of the first face on a ray, if it is about opposite to a normal; else None."""
    end = start + reach * way
    hits = body.ray_cast(tuple(start.tolist()), tuple(end.tolist()))
    if not hits or -float(np.dot(hits[0].normal, normal)) < OPPOSITE:
        return None
    return float(np.linalg.norm(np.asarray(hits[0].position) - start)), np.asarray(hits[0].normal, float)


def overhang(skin: TriangleMesh, up: Array, name: str, limit_rad: float) -> Overhang:
    """Return the overhangs of a surface on its lowest plane, with `up` up."""
    corners = skin.vertices_m[skin.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normal, axis=1)
    height = corners @ np.asarray(up, float)
    size = float(np.ptp(height))
    lifted = height.max(axis=1) > height.min() + 1e-4 * size
    down = np.divide(-(normal @ up), area, out=np.zeros_like(area), where=area > 0)
    angle = np.arcsin(np.clip(down, -1.0, 1.0))
    over = lifted & (angle > limit_rad + 1e-6)
    worst = float(angle[lifted].max(initial=0.0))
    return Overhang(name, float(area[over].sum() / area.sum()), max(worst, 0.0))


def best_direction(skin: TriangleMesh, limit_rad: float) -> tuple[Overhang, Overhang]:
    """Return the overhangs of a chain upright on its base (x up), and those of the best of six directions."""
    every = []
    for axis, name in enumerate("xyz"):
        for sign, mark in ((1.0, ""), (-1.0, "-")):
            every.append(overhang(skin, sign * np.eye(3)[axis], mark + name, limit_rad))
    return every[0], min(every, key=lambda one: one.share)
