"""Plane ends of a closed surface: their loops, and prisms over them with the same vertices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pliant.errors import PluginFailureError
from pliant.records.design import Array
from pliant.records.fem import IntArray
from pliant.records.shape import TriangleMesh
from pliant_print.boolean import MM, library

Mask = NDArray[np.bool_]
EQUAL = 0.98  # of the largest distance from a loop
SAME = 1e-7  # of the size: closer vertices are one


@dataclass(frozen=True, eq=False)
class Loop:
    """A closed line in a plane across x.

    Attributes:
        ids: (k,) vertices of the surface, the material on the left seen from +x.
        points_m: (k, 2), y and z.
        void: number of the void whose wall begins there; −1 for an outer edge.
    """

    ids: IntArray
    points_m: Array
    void: int = -1

    @property
    def area_m2(self) -> float:
        """The enclosed area, negative for a hole."""
        y, z = self.points_m.T
        return float(0.5 * (y @ np.roll(z, -1) - z @ np.roll(y, -1)))

    @property
    def is_hole(self) -> bool:
        return self.area_m2 < 0


def merged(surface: TriangleMesh) -> TriangleMesh:
    """Merge equal vertices, remove faces that two pieces share, and faces without three vertices."""
    near = SAME * float(np.ptp(surface.vertices_m, axis=0).max())
    pairs = cKDTree(surface.vertices_m).query_pairs(near, output_type="ndarray")
    n = len(surface.vertices_m)
    graph = sparse.coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    _, first = np.unique(label, return_index=True)
    faces = label[surface.faces]
    real = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    faces = faces[real]
    _, kind, count = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True)
    faces = faces[count[kind.reshape(-1)] == 1]
    used, faces = np.unique(faces, return_inverse=True)
    return TriangleMesh(surface.vertices_m[first[used]], faces.reshape(-1, 3).astype(np.int64))


def on_plane(surface: TriangleMesh, x_m: float, size_m: float) -> Mask:
    """Return which faces lie in the plane x, within a millionth of the size."""
    near = np.abs(surface.vertices_m[:, 0] - x_m) < 1e-6 * size_m
    mask: Mask = np.asarray(near[surface.faces].all(axis=1))
    return mask


def end_loops(surface: TriangleMesh, chosen: Mask, labels: IntArray | None = None) -> list[Loop]:
    """Return the loops around faces of one plane; `labels` are those of the surface's vertices (`Loop.void`)."""
    faces = surface.faces[chosen]
    if not len(faces):
        return []
    corners = surface.vertices_m[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 0].sum()
    if normal < 0:
        faces = faces[:, ::-1]
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    inside = set(map(tuple, edges[:, ::-1].tolist()))
    follow: dict[int, list[int]] = {}
    for a, b in edges.tolist():
        if (a, b) not in inside:
            follow.setdefault(a, []).append(b)
    found = []
    while follow:
        start = next(iter(follow))
        line, here = [start], start
        while True:
            nexts = follow[here]
            here = nexts.pop()
            if not nexts:
                del follow[line[-1]]
            if here == start:
                break
            if here not in follow:
                raise PluginFailureError("the end of a solid is not bounded by closed lines.")
            line.append(here)
        ids = np.array(line, np.int64)
        void = -1 if labels is None else int(labels[ids].max())
        found.append(Loop(ids, surface.vertices_m[ids, 1:], void))
    return found


def filled(loops: Sequence[Loop]) -> tuple[Array, IntArray]:
    """Return points (n, 2) and triangles of the plane region within outer loops and outside holes."""
    starts = np.cumsum([0] + [len(one.ids) for one in loops])
    polygons = [MM * one.points_m for one in loops]
    triangles = np.asarray(library().triangulate(polygons), np.int64).reshape(-1, 3)
    return np.concatenate([one.points_m for one in loops]), triangles if starts[-1] else triangles[:0]


def prism(loops: Sequence[Loop], start_m: float, end_m: float) -> TriangleMesh:
    """Return the closed prism over a plane region between two x, start < end."""
    points, faces = filled(loops)
    n = len(points)
    low, high = (np.column_stack([np.full(n, x), points]) for x in (start_m, end_m))
    sides, first = [], 0
    for one in loops:
        here = first + np.arange(len(one.ids))
        there = np.roll(here, -1)
        sides += [np.column_stack([here, there, there + n]), np.column_stack([here, there + n, here + n])]
        first += len(one.ids)
    every = np.concatenate([faces[:, ::-1], faces + n, *sides])
    return TriangleMesh(np.concatenate([low, high]), every.astype(np.int64))


def reversed_loop(loop: Loop) -> Loop:
    """Return the loop the other way round: a hole as an outer edge."""
    return Loop(loop.ids[::-1].copy(), loop.points_m[::-1].copy(), loop.void)


def deepest_point(loop: Loop, holes: Sequence[Loop] = (), on_y0: bool = False) -> tuple[Array, float]:
    """Return the point (2,) inside the loop that is farthest from it, and its distance, on a grid of 41 × 41.

    Of points that are almost as far, as in the middle of a rectangle, it is the one nearest to the loop's centre or,
    with `on_y0`, to the plane y = 0. Points in `holes` are outside.
    """
    every = [loop, *holes]
    points = np.concatenate([one.points_m for one in every])
    low, high = loop.points_m.min(axis=0), loop.points_m.max(axis=0)
    axes = [np.linspace(a, b, 43)[1:-1] for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    ends = np.concatenate([np.roll(one.points_m, -1, axis=0) for one in every])
    grid = grid[_inside(grid, points, ends)]
    along = ends - points
    share = np.einsum("gkj,kj->gk", grid[:, None] - points, along) / (along**2).sum(axis=1)
    nearest = points + np.clip(share, 0, 1)[..., None] * along
    distance = np.linalg.norm(grid[:, None] - nearest, axis=2).min(axis=1)
    off = np.abs(grid[:, 0]) if on_y0 else np.linalg.norm(grid - (low + high) / 2, axis=1)
    best = int(np.argmin(np.where(distance > EQUAL * distance.max(), off, np.inf)))
    return grid[best], float(distance[best])


def _inside(grid: Array, start: Array, end: Array) -> Array:
    """Return which points lie inside a polygon, by the parity of crossings."""
    above = (start[:, 1] > grid[:, None, 1]) != (end[:, 1] > grid[:, None, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        at = start[:, 0] + (grid[:, None, 1] - start[:, 1]) * (end[:, 0] - start[:, 0]) / (
            end[:, 1] - start[:, 1]
        )
    return np.asarray((above & (grid[:, None, 0] < at)).sum(axis=1) % 2 == 1)
