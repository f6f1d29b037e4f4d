"""What a module looks like: its family's surface, or a drawn one from a file, cut at the joint."""

from __future__ import annotations

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.family import ActuatorFamily
from pliant.meshing.stl import read_stl
from pliant.records.design import Array
from pliant.records.shape import HalfSurfaces, TriangleMesh

# A drawn module's length along x, of the module's: beyond it the unit is wrong, or another part was meant.
SHORTEST, LONGEST = 0.2, 5.0


def seen_surface(family: ActuatorFamily) -> HalfSurfaces:
    """The family's surface, or the one of its config's `visual`, in the module frame.

    Raises:
        UserError: the file is missing, no STL, empty, or of another size than a module.
    """
    config = family.config
    if config.visual is None:
        return family.surface()
    surface = read_stl(config.visual, config.visual_scale)
    length, module = float(np.ptp(surface.vertices_m[:, 0])), family.module_length_m
    if not SHORTEST * module < length < LONGEST * module:
        raise UserError(
            f"family.visual '{config.visual.name}' is {length:.4g} m long along x with visual_scale "
            f"{config.visual_scale:g}, but a module is {module:.4g} m long; the file is in metres and in the module "
            "frame (x along the chain, origin at the joint); a file in millimetres needs 'visual_scale: 0.001'."
        )
    return HalfSurfaces(start=side(surface, -1.0), end=side(surface, 1.0))


def side(surface: TriangleMesh, sign: float) -> TriangleMesh:
    """The part of a surface where sign · x ≥ 0, triangles cut at x = 0."""
    faces = [piece for face in surface.faces for piece in _cut(surface.vertices_m[face], sign)]
    corners = np.array(faces, float).reshape(-1, 3)
    unique, ids = np.unique(corners, axis=0, return_inverse=True)
    return TriangleMesh(unique, ids.reshape(-1, 3).astype(np.int64))


def _cut(corners: Array, sign: float) -> list[Array]:
    """The triangles, none to two, that lie on one side of x = 0, by clipping corner after corner."""
    depth = sign * corners[:, 0]
    if np.all(depth >= 0):
        # What lies in the plane belongs to the end half.
        return [] if sign < 0 and np.all(depth == 0) else [corners]
    kept = []
    for here in range(3):
        there = (here + 1) % 3
        if depth[here] >= 0:
            kept.append(corners[here])
        if (depth[here] > 0 > depth[there]) or (depth[here] < 0 < depth[there]):
            # From the lower corner on both sides of the cut, so that both halves get the same point.
            low, high = (here, there) if corners[here, 0] < corners[there, 0] else (there, here)
            share = corners[low, 0] / (corners[low, 0] - corners[high, 0])
            point = corners[low] + share * (corners[high] - corners[low])
            point[0] = 0.0
            kept.append(point)
    return [np.array([kept[0], kept[k], kept[k + 1]]) for k in range(1, len(kept) - 1)]
