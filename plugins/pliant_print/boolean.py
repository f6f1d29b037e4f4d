"""Union, difference and trimming of solids by manifold3d (Apache-2.0); metres outside, millimetres inside."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pliant.errors import MissingDependencyError, PluginFailureError
from pliant.records.design import Array
from pliant.records.shape import TriangleMesh

MM = 1e3
# Coordinates are multiples of this (mm): written as metres and read again they are the same numbers, so that faces of
# two solids that lie on each other lie on each other exactly.
GRID_MM = 2.0**-24
CRUMB = 1e-9  # of the largest piece's volume: what rounding leaves
SIMPLE_MM = 1e-3  # by which a finished surface may deviate where triangles are merged


def library() -> Any:
    """Import and return manifold3d.

    Raises:
        MissingDependencyError: it is not installed.
    """
    try:
        import manifold3d
    except ImportError:
        raise MissingDependencyError("solids need manifold3d: pip install 'pliant[print]'.") from None
    return manifold3d


def solid(surface: TriangleMesh, name: str = "a surface") -> Any:
    """Return the manifold of a closed surface whose shared vertices are merged.

    Raises:
        PluginFailureError: the surface is not closed or not oriented.
    """
    m = library()
    mesh = m.Mesh64(
        vert_properties=np.ascontiguousarray(on_grid(surface.vertices_m)),
        tri_verts=np.ascontiguousarray(surface.faces, np.uint64),
    )
    made = m.Manifold(mesh)
    if made.status() != m.Error.NoError or made.is_empty():
        raise PluginFailureError(f"{name} is not the closed surface of a solid ({made.status()}).")
    return made


def on_grid(points_m: Array) -> Array:
    """Return points in mm on the grid of coordinates."""
    return np.asarray(GRID_MM * np.round(MM * np.asarray(points_m, float) / GRID_MM))


def regular(body: Any) -> Any:
    """Return the manifold with its coordinates on the grid, as after a rotation."""
    return solid(surface(body))


def simplified(body: Any) -> Any:
    """Return the manifold with fewer triangles where they lie in a plane, within a micrometre, without crumbs.

    A closed hollow is a piece of negative volume: pieces are put side by side, not united.
    """
    pieces = body.simplify(SIMPLE_MM).decompose()
    largest = max((abs(float(one.volume())) for one in pieces), default=0.0)
    return library().Manifold.compose([one for one in pieces if abs(float(one.volume())) > CRUMB * largest])


def surface(body: Any) -> TriangleMesh:
    """Return the surface of a manifold."""
    mesh = body.to_mesh64()
    return TriangleMesh(np.array(mesh.vert_properties[:, :3], float) / MM, np.array(mesh.tri_verts, np.int64))


def volume_m3(body: Any) -> float:
    """Return the enclosed volume of a manifold."""
    return float(body.volume()) / MM**3


def united(bodies: Iterable[Any]) -> Any:
    """Return the union of manifolds; empty for none."""
    m = library()
    return m.Manifold.batch_boolean(list(bodies), m.OpType.Add)


def placed(body: Any, rotation: Array, position_m: Array) -> Any:
    """Return the manifold rotated, then translated."""
    return body.transform(np.column_stack([rotation, MM * np.asarray(position_m, float)]))


def cylinder(start_m: ArrayLike, end_m: ArrayLike, radius_m: float, end_radius_m: float | None = None) -> Any:
    """Return a cylinder or truncated cone between two points."""
    start, end = np.asarray(start_m, float), np.asarray(end_m, float)
    length = float(np.linalg.norm(end - start))
    axis = (end - start) / length
    aside = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    aside /= np.linalg.norm(aside)
    rotation = np.column_stack([aside, np.cross(axis, aside), axis])
    radii = MM * radius_m, MM * (radius_m if end_radius_m is None else end_radius_m)
    return placed(library().Manifold.cylinder(MM * length, *radii, circular_segments=48), rotation, start)


def box(low_m: ArrayLike, high_m: ArrayLike) -> Any:
    """Return the box between two corners."""
    low, high = np.asarray(low_m, float), np.asarray(high_m, float)
    size = tuple((MM * (high - low)).tolist())
    return library().Manifold.cube(size).translate(tuple((MM * low).tolist()))
