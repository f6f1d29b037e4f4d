"""Shapes for collisions and drawing."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array

ShapeKind = Literal["box", "sphere", "capsule", "cylinder", "ellipsoid", "mesh"]


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """A surface: vertices_m (v, 3) in metres, faces (f, 3) vertex ids, counter-clockwise seen from outside."""

    vertices_m: Array
    faces: NDArray[np.int64]

    def placed(self, rotation: Array, position_m: Array) -> TriangleMesh:
        """Return the same surface rotated, then translated."""
        return TriangleMesh(self.vertices_m @ np.asarray(rotation, float).T + position_m, self.faces)

    def joined(self, other: TriangleMesh) -> TriangleMesh:
        """Return both surfaces as one, without merging vertices."""
        faces = np.concatenate([self.faces, other.faces + len(self.vertices_m)])
        return TriangleMesh(np.concatenate([self.vertices_m, other.vertices_m]), faces)


@dataclass(frozen=True, eq=False)
class Shape:
    """A convex collision shape in the frame of the body that carries it.

    Attributes:
        kind: a primitive, or "mesh", the convex hull of `mesh`.
        size_m: box: half edges (3,); sphere: (radius,); capsule and cylinder: (radius, half length along the
            shape's z, a capsule's without its caps); ellipsoid: semi-axes (3,); mesh: ().
        position_m, rotation: (3,) and (3, 3) pose of the shape in the body's frame.
        mesh: the surface of kind "mesh".
        rigid: for pictures, which bend shapes that meet at a joint into one skin: this shape is not bent.
    """

    kind: ShapeKind
    size_m: tuple[float, ...]
    position_m: Array
    rotation: Array
    mesh: TriangleMesh | None = None
    rigid: bool = False

    def placed(self, rotation: Array, position_m: Array) -> Shape:
        """Return the same shape with its body's frame rotated, then translated."""
        turned = np.asarray(rotation, float)
        return replace(
            self,
            position_m=turned @ self.position_m + np.asarray(position_m, float),
            rotation=turned @ self.rotation,
        )


@dataclass(frozen=True)
class HalfShapes:
    """Collision shapes of a module's two halves in the module frame, as in `ModuleMass`."""

    start: tuple[Shape, ...]
    end: tuple[Shape, ...]


@dataclass(frozen=True, eq=False)
class HalfSurfaces:
    """Surfaces of a module's two halves in the module frame, for pictures and STL.

    Attributes:
        start, end: surfaces that pictures bend across the joint.
        rigid_start, rigid_end: surfaces that are not bent, such as a link; None if all is soft.
    """

    start: TriangleMesh
    end: TriangleMesh
    rigid_start: TriangleMesh | None = None
    rigid_end: TriangleMesh | None = None

    @property
    def parts(self) -> tuple[TriangleMesh, ...]:
        """Return all surfaces of the module."""
        every = (self.start, self.end, self.rigid_start, self.rigid_end)
        return tuple(part for part in every if part is not None)

    @property
    def whole(self) -> TriangleMesh:
        """The module as one surface, without merging vertices."""
        first, *others = self.parts
        for other in others:
            first = first.joined(other)
        return first
