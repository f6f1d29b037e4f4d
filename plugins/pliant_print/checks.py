"""Checks of a surface before it is printed: closed, oriented, without triangles that cross."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from pliant.records.design import Array
from pliant.records.fem import IntArray
from pliant.records.shape import TriangleMesh

TOUCH = 1e-9  # of the size: triangles that cross by less only touch


@dataclass(frozen=True)
class SurfaceCheck:
    """Defects of a triangle surface.

    Attributes:
        open_edges: edges that do not join two triangles running the other way along them.
        crossings: pairs of triangles without a common corner of which one's edge passes through the other.
        volume_m3: enclosed volume; negative if the surface is inside out.
        triangles: their number.
    """

    open_edges: int
    crossings: int
    volume_m3: float
    triangles: int

    @property
    def sound(self) -> bool:
        """Return whether the surface is closed, oriented outward and does not cross itself."""
        return self.open_edges == 0 and self.crossings == 0 and self.volume_m3 > 0


def check_surface(surface: TriangleMesh) -> SurfaceCheck:
    """Return the defects of a surface whose shared vertices are merged."""
    a, b, c = (surface.vertices_m[surface.faces[:, k]] for k in range(3))
    volume = float(np.einsum("ki,ki->", a, np.cross(b, c)) / 6)
    return SurfaceCheck(open_edges(surface.faces), crossings(surface), volume, len(surface.faces))


def open_edges(faces: IntArray) -> int:
    """Return the number of edges of triangles that no other one runs along the other way, or several run along."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    n = int(faces.max()) + 1
    there, count = np.unique(edges[:, 0] * n + edges[:, 1], return_counts=True)
    back = np.unique(edges[:, 1] * n + edges[:, 0])
    return int(len(np.setdiff1d(there, back)) + (count > 1).sum())


def crossings(surface: TriangleMesh) -> int:
    """Return the number of pairs of triangles without common corners that cross, by sweeping along the longest side.

    Triangles that touch, or lie in one plane, do not count.
    """
    size = float(np.ptp(surface.vertices_m, axis=0).max())
    corners = surface.vertices_m[surface.faces] / size
    axis = int(np.argmax(np.ptp(surface.vertices_m, axis=0)))
    low, high = corners.min(axis=1), corners.max(axis=1)
    order = np.argsort(low[:, axis], kind="stable")
    return int(
        _crossings(
            np.ascontiguousarray(corners[order]),
            np.ascontiguousarray(surface.faces[order].astype(np.int64)),
            np.ascontiguousarray(low[order]),
            np.ascontiguousarray(high[order]),
            axis,
        )
    )


@numba.njit(cache=True)
def _six_volumes(a: Array, b: Array, c: Array, d: Array) -> float:
    """Return six times the signed volume of a tetrahedron."""
    bx, by, bz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    cx, cy, cz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    dx, dy, dz = d[0] - a[0], d[1] - a[1], d[2] - a[2]
    return bx * (cy * dz - cz * dy) - by * (cx * dz - cz * dx) + bz * (cx * dy - cy * dx)


@numba.njit(cache=True)
def _passes(p: Array, q: Array, triangle: Array) -> bool:
    """Return whether a segment passes through the inside of a triangle by more than a touch."""
    a, b, c = triangle[0], triangle[1], triangle[2]
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    area = np.sqrt(nx * nx + ny * ny + nz * nz)
    if area == 0.0:
        return False
    over = (nx * (p[0] - a[0]) + ny * (p[1] - a[1]) + nz * (p[2] - a[2])) / area
    under = (nx * (q[0] - a[0]) + ny * (q[1] - a[1]) + nz * (q[2] - a[2])) / area
    if over * under >= 0 or abs(over) < TOUCH or abs(under) < TOUCH:
        return False
    first = _six_volumes(p, q, a, b)
    second = _six_volumes(p, q, b, c)
    third = _six_volumes(p, q, c, a)
    least = TOUCH * area
    return (first > least and second > least and third > least) or (
        first < -least and second < -least and third < -least
    )


@numba.njit(cache=True)
def _crossings(corners: Array, faces: IntArray, low: Array, high: Array, axis: int) -> int:
    count = 0
    one, two = (axis + 1) % 3, (axis + 2) % 3
    for i in range(len(corners)):
        for j in range(i + 1, len(corners)):
            if low[j, axis] > high[i, axis]:
                break
            if low[j, one] > high[i, one] or high[j, one] < low[i, one]:
                continue
            if low[j, two] > high[i, two] or high[j, two] < low[i, two]:
                continue
            shared = False
            for a in range(3):
                for b in range(3):
                    shared = shared or faces[i, a] == faces[j, b]
            if shared:
                continue
            for a in range(3):
                b = (a + 1) % 3
                if _passes(corners[i, a], corners[i, b], corners[j]) or _passes(
                    corners[j, a], corners[j, b], corners[i]
                ):
                    count += 1
                    break
    return count
