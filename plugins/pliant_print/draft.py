"""Draft of a mould's faces, and what its halves and cores cannot be pulled off."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from pliant.records.design import Array
from pliant.records.shape import TriangleMesh
from pliant_print.boolean import solid, surface

LEAST_SHARE = 0.1  # of a vertex' largest eigenvalue: directions with less are not moved along
KEPT_M = 1e-7
UNDER_RAD = 0.01  # by which a face must look back to be an undercut: less is rounding of plane pieces


def drafted(half: Any, pull: Array, draft_rad: float, kept_m: Array | None = None) -> Any:
    """Return half of a shape, on one side of the plane through the origin across `pull`, with draft on its faces.

    Faces along the pull are inclined about the line at their mean depth, so that the volume hardly changes: near the
    parting plane the shape is wider, far from it narrower. Vertices at the points `kept_m` (k, 3) stay.
    """
    skin = surface(half)
    if draft_rad == 0.0 or not len(skin.faces):
        return half
    area, normal = _areas_and_normals(skin)
    lacking = np.tan(np.maximum(draft_rad - np.arcsin(np.clip(np.abs(normal @ pull), 0.0, 1.0)), 0.0))
    depth = np.abs(skin.vertices_m @ pull)
    share = area * lacking
    lever = (share @ depth[skin.faces].mean(axis=1)) / max(float(share.sum()), 1e-300) - depth
    weight = area / area.mean()
    # Each vertex moves d with n·d = what the face lacks, by least squares over its faces' areas.
    system = np.zeros((len(depth), 3, 3))
    right = np.zeros((len(depth), 3))
    for corner in range(3):
        vertex = skin.faces[:, corner]
        np.add.at(system, vertex, weight[:, None, None] * normal[:, :, None] * normal[:, None, :])
        np.add.at(right, vertex, (weight * lacking * lever[vertex])[:, None] * normal)
    moved = _least_squares(system, right)
    moved -= np.outer(moved @ pull, pull)
    if kept_m is not None and len(kept_m):
        distance, _ = cKDTree(kept_m).query(skin.vertices_m)
        moved[distance < KEPT_M] = 0.0
    return solid(TriangleMesh(skin.vertices_m + moved, skin.faces), "a drafted half")


def _least_squares(system: Array, right: Array) -> Array:
    """Return the smallest solutions of symmetric 3 × 3 systems, without directions that hardly enter them.

    The faces around a vertex of a curved surface have almost one normal: across it the vertex does not move.
    """
    values, vectors = np.linalg.eigh(system)
    kept = values > LEAST_SHARE * values[:, -1:]
    inverse = np.divide(1.0, values, out=np.zeros_like(values), where=kept & (values > 0))
    along = np.einsum("vji,vj->vi", vectors, right)
    return np.asarray(np.einsum("vij,vj->vi", vectors, inverse * along))


def undercut_share(skin: TriangleMesh, pull: Array, exit_plane_m: float | None = None) -> float:
    """Return the share of a surface that a pull of the mould cannot release.

    Args:
        skin: of the part (a half's pull) or reversed of a core.
        pull: unit vector; a face with n·pull < 0 holds the mould back.
        exit_plane_m: coordinate along the pull of faces that do not count: the parting plane, or a core's opening.
    """
    area, normal = _areas_and_normals(skin)
    under = normal @ pull < -np.sin(UNDER_RAD)
    if exit_plane_m is not None:
        near = 1e-4 * float(np.ptp(skin.vertices_m @ pull))
        under &= ~(np.abs(skin.vertices_m[skin.faces] @ pull - exit_plane_m) < near).all(axis=1)
    return float(area[under].sum() / area.sum())


def _areas_and_normals(skin: TriangleMesh) -> tuple[Array, Array]:
    corners = skin.vertices_m[skin.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    return length / 2, np.asarray(normal / np.maximum(length, 1e-300)[:, None])
