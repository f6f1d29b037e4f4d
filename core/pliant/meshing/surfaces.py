"""Surfaces and collision shapes of a module from the mesh of the solved piece; merging and stretching of shapes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pliant.meshing.cells import face_cell_kind
from pliant.records.design import Array
from pliant.records.fem import IntArray, ModuleMesh
from pliant.records.shape import HalfShapes, HalfSurfaces, Shape, TriangleMesh


def half_skins(mesh: ModuleMesh, mirror_y: bool = True) -> HalfSurfaces:
    """Return the skin of the meshed piece and its mirror images in y = 0 (if `mirror_y`) and x = 0."""
    faces = mesh.skin[:, face_cell_kind(mesh.skin).triangles].reshape(-1, 3)
    if mirror_y:
        # Faces on the mirror plane are inside the whole module.
        faces = faces[np.abs(mesh.nodes_m[faces, 1]).max(axis=1) > 1e-9]
    used, renumbered = np.unique(faces, return_inverse=True)
    end = TriangleMesh(mesh.nodes_m[used], renumbered.reshape(-1, 3).astype(np.int64))
    if mirror_y:
        end = end.joined(mirrored(end, 1))
    return HalfSurfaces(start=mirrored(end, 0), end=end)


def split_skins(mesh: ModuleMesh, span_m: float, mirror_y: bool = True) -> HalfSurfaces:
    """Return the skin of a mesh of a whole module, x from 0 to span, cut at the joint in its middle."""
    end = half_skins(mesh, mirror_y).end
    whole = TriangleMesh(end.vertices_m - np.array([span_m / 2, 0.0, 0.0]), end.faces)
    return HalfSurfaces(start=side(whole, -1.0), end=side(whole, 1.0))


def split_boxes(surfaces: HalfSurfaces) -> HalfShapes:
    """Return the bounding boxes of the two halves' surfaces."""
    start, end = (
        (box(part.vertices_m.min(axis=0), part.vertices_m.max(axis=0)),)
        for part in (surfaces.start, surfaces.end)
    )
    return HalfShapes(start=start, end=end)


def half_boxes(mesh: ModuleMesh, mirror_y: bool = True) -> HalfShapes:
    """Return the bounding boxes of the two halves."""
    low, high = mesh.nodes_m.min(axis=0), mesh.nodes_m.max(axis=0)
    if mirror_y:
        low[1] = -high[1]
    end = box(low, high)
    return HalfShapes(
        start=(box(np.array([-high[0], *low[1:]]), np.array([-low[0], *high[1:]])),), end=(end,)
    )


def box(low_m: Array, high_m: Array) -> Shape:
    """Return the box between two corners."""
    half = 0.5 * (np.asarray(high_m, float) - low_m)
    return Shape("box", tuple(half.tolist()), np.asarray(low_m, float) + half, np.eye(3))


def mirrored(surface: TriangleMesh, axis: int) -> TriangleMesh:
    """Return the mirror image across axis 0, 1, 2 = x, y, z, with face normals still outward."""
    signs = np.ones(3)
    signs[axis] = -1.0
    faces: IntArray = surface.faces[:, ::-1].copy()
    return TriangleMesh(surface.vertices_m * signs, faces)


def side(surface: TriangleMesh, sign: float) -> TriangleMesh:
    """Return the part of a surface where sign · x ≥ 0, triangles cut at x = 0."""
    faces = [piece for face in surface.faces for piece in _cut(surface.vertices_m[face], sign)]
    corners = np.array(faces, float).reshape(-1, 3)
    unique, ids = np.unique(corners, axis=0, return_inverse=True)
    return TriangleMesh(unique, ids.reshape(-1, 3).astype(np.int64))


def _cut(corners: Array, sign: float) -> list[Array]:
    """Return the zero to two triangles on one side of x = 0, by clipping corner after corner."""
    depth = sign * corners[:, 0]
    if np.all(depth >= 0):
        # Triangles in the plane belong to the end half.
        return [] if sign < 0 and np.all(depth == 0) else [corners]
    kept = []
    for here in range(3):
        there = (here + 1) % 3
        if depth[here] >= 0:
            kept.append(corners[here])
        if (depth[here] > 0 > depth[there]) or (depth[here] < 0 < depth[there]):
            # From the lower corner for both halves, so that both get the same point.
            low, high = (here, there) if corners[here, 0] < corners[there, 0] else (there, here)
            share = corners[low, 0] / (corners[low, 0] - corners[high, 0])
            point = corners[low] + share * (corners[high] - corners[low])
            point[0] = 0.0
            kept.append(point)
    return [np.array([kept[0], kept[k], kept[k + 1]]) for k in range(1, len(kept) - 1)]


def welded(surface: TriangleMesh) -> TriangleMesh:
    """Weld adjacent pieces to one skin: equal vertices are merged, and faces shared by two pieces are removed.

    Vertices closer than a millionth of the surface's size are equal.
    """
    grid = 1e-6 * float(np.ptp(surface.vertices_m, axis=0).max())
    _, first, renumbered = np.unique(
        np.round(surface.vertices_m / grid).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    faces = renumbered.reshape(-1)[surface.faces]
    _, kind, count = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True)
    kept = faces[count[kind.reshape(-1)] == 1]
    used, kept = np.unique(kept, return_inverse=True)
    return TriangleMesh(surface.vertices_m[first[used]], kept.reshape(-1, 3).astype(np.int64))


def stretched(shape: Shape, factor: float) -> Shape:
    """Return the shape with x scaled: exact for boxes, meshes and cylinders along the axes, else its bounding box."""
    along = np.array([factor, 1.0, 1.0])
    position = shape.position_m * along
    if shape.kind == "mesh" and shape.mesh is not None:
        turned = shape.mesh.vertices_m @ shape.rotation.T
        mesh = TriangleMesh(turned * along, shape.mesh.faces)
        return Shape("mesh", (), position, np.eye(3), mesh)
    reach = np.abs(shape.rotation[0])  # index of the shape's axis along x
    if shape.kind == "box" and np.isclose(reach.max(), 1.0):
        half = np.where(reach > 0.5, factor, 1.0) * shape.size_m
        return Shape("box", tuple(half.tolist()), position, shape.rotation)
    if shape.kind == "cylinder" and np.isclose(reach[2], 1.0):
        radius, half_length = shape.size_m
        return Shape("cylinder", (radius, factor * half_length), position, shape.rotation)
    high = np.array([support(shape, axis) for axis in np.eye(3)]) * along
    low = -np.array([support(shape, -axis) for axis in np.eye(3)]) * along
    return box(low, high)


def support(shape: Shape, direction: Array) -> float:
    """Return the largest x·d (m) over the points x of the shape, for a direction d (3,) in the shape's parent frame."""
    d = shape.rotation.T @ direction
    size = np.array(shape.size_m)
    centre = float(shape.position_m @ direction)
    if shape.kind == "mesh" and shape.mesh is not None:
        return centre + float((shape.mesh.vertices_m @ d).max())
    if shape.kind == "box":
        return centre + float(size @ np.abs(d))
    if shape.kind == "ellipsoid":
        return centre + float(np.linalg.norm(size * d))
    radius = size[0] * (np.hypot(d[0], d[1]) if shape.kind == "cylinder" else np.linalg.norm(d))
    return centre + float(radius) + (float(size[1] * abs(d[2])) if len(size) > 1 else 0.0)


def merged(shapes: Sequence[Shape]) -> tuple[Shape, ...]:
    """Merge boxes, or cylinders, that continue each other along x, without changing the solid.

    Fewer shapes give fewer contacts and no inner edges.
    """
    found: list[Shape] = []
    for shape in shapes:
        for k, other in enumerate(found):
            joined = _joined(other, shape)
            if joined is not None:
                found[k] = joined
                break
        else:
            found.append(shape)
    return tuple(found)


def _joined(first: Shape, second: Shape) -> Shape | None:
    """Return both as one shape if they have the same kind and section, are aligned along x, and touch or overlap."""
    if first.kind != second.kind or first.kind not in ("box", "cylinder"):
        return None
    if not np.allclose(first.rotation, second.rotation, atol=1e-9):
        return None
    axis = int(np.argmax(np.abs(first.rotation[0])))  # the shape's axis along x
    if not np.isclose(abs(first.rotation[0, axis]), 1.0) or (first.kind == "cylinder" and axis != 2):
        return None
    along = axis if first.kind == "box" else 1  # its index in `size_m`
    sections = [np.delete(shape.size_m, along) for shape in (first, second)]
    apart = second.position_m - first.position_m
    near = 1e-6 * max(*first.size_m, *second.size_m)
    reach = first.size_m[along] + second.size_m[along]
    if (
        not np.allclose(sections[0], sections[1], atol=near)
        or np.abs(apart[1:]).max() > near
        or abs(apart[0]) > reach + near
    ):
        return None
    ends = [(s.position_m[0] - s.size_m[along], s.position_m[0] + s.size_m[along]) for s in (first, second)]
    low, high = min(end[0] for end in ends), max(end[1] for end in ends)
    size = list(first.size_m)
    size[along] = (high - low) / 2
    return replace(first, size_m=tuple(size), position_m=np.array([(low + high) / 2, *first.position_m[1:]]))
