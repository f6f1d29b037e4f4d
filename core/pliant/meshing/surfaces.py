"""Surfaces and collision boxes of a module from the mesh of the piece that is solved, and from mirror images."""

from __future__ import annotations

import numpy as np

from pliant.records.design import Array
from pliant.records.fem import IntArray, ModuleMesh
from pliant.records.shape import HalfShapes, HalfSurfaces, Shape, TriangleMesh

# The 3 × 3 nodes of a quadratic face as eight triangles, local node a + 3b.
FACE = np.array(
    [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [3, 4, 7], [3, 7, 6], [4, 5, 8], [4, 8, 7]], np.int64
)


def half_skins(mesh: ModuleMesh, mirror_y: bool = True) -> HalfSurfaces:
    """The skin of the meshed piece and its mirror images in y = 0 (if `mirror_y`) and x = 0."""
    faces = mesh.skin[:, FACE].reshape(-1, 3)
    if mirror_y:
        # Faces on the mirror plane are inside the whole module.
        faces = faces[np.abs(mesh.nodes_m[faces, 1]).max(axis=1) > 1e-9]
    used, renumbered = np.unique(faces, return_inverse=True)
    end = TriangleMesh(mesh.nodes_m[used], renumbered.reshape(-1, 3).astype(np.int64))
    if mirror_y:
        end = end.joined(mirrored(end, 1))
    return HalfSurfaces(start=mirrored(end, 0), end=end)


def half_boxes(mesh: ModuleMesh, mirror_y: bool = True) -> HalfShapes:
    """The boxes around the two halves."""
    low, high = mesh.nodes_m.min(axis=0), mesh.nodes_m.max(axis=0)
    if mirror_y:
        low[1] = -high[1]
    end = box(low, high)
    return HalfShapes(
        start=(box(np.array([-high[0], *low[1:]]), np.array([-low[0], *high[1:]])),), end=(end,)
    )


def box(low_m: Array, high_m: Array) -> Shape:
    """The box between two corners."""
    half = 0.5 * (np.asarray(high_m, float) - low_m)
    return Shape("box", tuple(half.tolist()), np.asarray(low_m, float) + half, np.eye(3))


def mirrored(surface: TriangleMesh, axis: int) -> TriangleMesh:
    """The mirror image across axis 0, 1, 2 = x, y, z; its faces are turned so that they still look outward."""
    signs = np.ones(3)
    signs[axis] = -1.0
    faces: IntArray = surface.faces[:, ::-1].copy()
    return TriangleMesh(surface.vertices_m * signs, faces)
