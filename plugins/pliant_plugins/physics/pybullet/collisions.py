"""Collision shapes in URDF: primitives as they are, ellipsoids and meshes as convex hulls in files beside it."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from scipy.spatial import ConvexHull

from pliant.errors import UserError
from pliant.records.design import Array
from pliant.records.shape import Shape
from pliant_plugins.physics.pybullet.xml_values import add_origin, text

# Bullet's support function looks at every vertex of a hull; this many keep an ellipsoid within 0.3 % of its size.
ELLIPSOID_POINTS = 320
GOLDEN_ANGLE_RAD = np.pi * (3.0 - np.sqrt(5.0))


class CollisionWriter:
    """Adds shapes to links; hulls go to OBJ files in `folder`, which is made when the first comes.

    File names are absolute, or relative to `start`.
    """

    def __init__(self, folder: Path, start: Path | None = None) -> None:
        self.folder, self._start = folder, start
        self.written: list[Path] = []

    def add(self, link: ElementTree.Element, shapes: Iterable[Shape]) -> None:
        """One `collision` element per shape.

        Raises:
            UserError: a mesh without volume has no convex hull.
        """
        for shape in shapes:
            collision = ElementTree.SubElement(link, "collision")
            add_origin(collision, shape.position_m, shape.rotation)
            self._geometry(ElementTree.SubElement(collision, "geometry"), shape)

    def _geometry(self, geometry: ElementTree.Element, shape: Shape) -> None:
        if not add_primitive(geometry, shape):
            path = self.folder / f"hull_{len(self.written) + 1}.obj"
            self.folder.mkdir(exist_ok=True)
            write_hull(path, hull_points(shape))
            self.written.append(path)
            name = path if self._start is None else path.relative_to(self._start)
            ElementTree.SubElement(geometry, "mesh", filename=name.as_posix())


def add_primitive(geometry: ElementTree.Element, shape: Shape) -> bool:
    """The shape as URDF has it; False, and nothing, for ellipsoids and meshes."""
    if shape.kind == "box":
        ElementTree.SubElement(geometry, "box", size=text(2.0 * np.asarray(shape.size_m)))
    elif shape.kind == "sphere":
        ElementTree.SubElement(geometry, "sphere", radius=text(shape.size_m))
    elif shape.kind in ("cylinder", "capsule"):
        radius, half = shape.size_m
        ElementTree.SubElement(geometry, shape.kind, radius=text([radius]), length=text([2.0 * half]))
    else:
        return False
    return True


def hull_points(shape: Shape) -> Array:
    """(v, 3) points whose convex hull stands for an ellipsoid or a mesh, in the shape's own frame."""
    if shape.kind == "ellipsoid":
        return np.asarray(shape.size_m) * _sphere_points(ELLIPSOID_POINTS)
    if shape.mesh is None:
        raise UserError("a collision shape of kind 'mesh' has no mesh: give it a TriangleMesh")
    return np.asarray(shape.mesh.vertices_m, float)


def write_hull(path: Path, points: Array) -> None:
    """The convex hull of points (v, 3) as an OBJ file.

    Raises:
        UserError: the points lie in a plane.
    """
    try:
        hull = ConvexHull(points)
    except (ValueError, RuntimeError) as error:  # QhullError is a RuntimeError
        raise UserError(
            "a collision mesh is flat or has fewer than four points, so it has no volume: give a solid"
        ) from error
    centre = points[hull.vertices].mean(axis=0)
    number = {int(vertex): k + 1 for k, vertex in enumerate(hull.vertices)}
    lines = [f"v {text(points[vertex])}" for vertex in hull.vertices]
    for triangle in hull.simplices:
        a, b, c = points[triangle]
        outward = float(np.cross(b - a, c - a) @ (a - centre)) > 0.0
        corners = triangle if outward else triangle[::-1]
        lines.append("f " + " ".join(str(number[int(vertex)]) for vertex in corners))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _sphere_points(count: int) -> Array:
    """(count, 3) nearly even points of the unit sphere (Fibonacci lattice), lifted to the sphere's mean radius."""
    height = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    around = GOLDEN_ANGLE_RAD * np.arange(count)
    across = np.sqrt(1.0 - height**2)
    points = np.stack([across * np.cos(around), across * np.sin(around), height], axis=1)
    # The hull of points on a sphere lies inside it: half the sag of a facet is given back.
    sag = 2.0 * np.pi / (3.0 * np.sqrt(3.0) * count) * 2.0
    lifted: Array = points * (1.0 + 0.5 * sag)
    return lifted
