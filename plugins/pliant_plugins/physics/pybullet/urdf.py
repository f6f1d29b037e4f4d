"""URDF of chains and free bodies: one link per body, inertias on their principal axes, collision shapes on request.

Primitives collide exactly, ellipsoids and meshes as convex hulls in separate files."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import atan2, cos, hypot, sin
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import scipy  # scipy.spatial only where a chain is drawn up

from pliant.errors import UserError
from pliant.mechanics.inertia import regular
from pliant.mechanics.kinematics import ChainGeometry
from pliant.records.chain import ChainModel
from pliant.records.design import Array, MassProperties
from pliant.records.shape import Shape


def add_origin(element: ElementTree.Element, position: Array, rotation: Array) -> None:
    """Add an `origin` with a position and fixed-axis angles."""
    ElementTree.SubElement(element, "origin", xyz=text(position), rpy=text(roll_pitch_yaw(rotation)))


def roll_pitch_yaw(rotation: Array) -> tuple[float, float, float]:
    """Return angles with R = Rz(yaw) Ry(pitch) Rx(roll), accurate also at a pitch of ±90°."""
    R = np.asarray(rotation, float)
    yaw = atan2(R[1, 0], R[0, 0])
    pitch = atan2(-R[2, 0], hypot(R[0, 0], R[1, 0]))
    # Roll from the axes with yaw undone: no division by cos(pitch).
    sine = sin(yaw) * R[0, 2] - cos(yaw) * R[1, 2]
    cosine = cos(yaw) * R[1, 1] - sin(yaw) * R[0, 1]
    return atan2(sine, cosine), pitch, yaw


def text(values: Iterable[float]) -> str:
    """Return numbers as an attribute, without loss."""
    return " ".join(repr(float(value)) for value in values)


# Bullet's support function looks at every vertex of a hull; this many keep an ellipsoid within 0.3 % of its size.
ELLIPSOID_POINTS = 320
GOLDEN_ANGLE_RAD = np.pi * (3.0 - np.sqrt(5.0))


class CollisionWriter:
    """A writer of shapes to links; hulls are OBJ files in `folder`, which is created for the first one.

    File names are absolute, or relative to `start`.
    """

    def __init__(self, folder: Path, start: Path | None = None) -> None:
        self.folder, self._start = folder, start
        self.written: list[Path] = []

    def add(self, link: ElementTree.Element, shapes: Iterable[Shape]) -> None:
        """Add one `collision` element per shape.

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
    """Add the shape as URDF; return False, without adding it, for ellipsoids and meshes."""
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
    """Return points (v, 3) whose convex hull represents an ellipsoid or a mesh, in the shape's frame."""
    if shape.kind == "ellipsoid":
        return np.asarray(shape.size_m) * _sphere_points(ELLIPSOID_POINTS)
    if shape.mesh is None:
        raise UserError("a collision shape of kind 'mesh' has no mesh: give it a TriangleMesh")
    return np.asarray(shape.mesh.vertices_m, float)


def write_hull(path: Path, points: Array) -> None:
    """Write the convex hull of points (v, 3) as an OBJ file.

    Raises:
        UserError: the points lie in a plane.
    """
    try:
        hull = scipy.spatial.ConvexHull(points)
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
    """Return (count, 3) nearly even points of a sphere (Fibonacci lattice), scaled to the mean radius."""
    height = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    around = GOLDEN_ANGLE_RAD * np.arange(count)
    across = np.sqrt(1.0 - height**2)
    points = np.stack([across * np.cos(around), across * np.sin(around), height], axis=1)
    # The hull of points on a sphere is inside it: half the sag of a facet is compensated.
    sag = 2.0 * np.pi / (3.0 * np.sqrt(3.0) * count) * 2.0
    return np.asarray(points * (1.0 + 0.5 * sag))


JOINT_TYPES = {"revolute": "continuous", "spherical": "spherical", "prismatic": "prismatic"}
# A body without mass or inertia would make Bullet's recursion singular. The mass floor weighs 1e-11 N; the
# inertia floor is that of a 1 g piece of 1 mm and bounds the step that explicit stiffness needs.
MASS_FLOOR_KG = 1e-12
INERTIA_FLOOR_KG_M2 = 1e-9


def chain_tree(
    chain: ChainModel, base: MassProperties | None = None, collisions: CollisionWriter | None = None
) -> ElementTree.Element:
    """Return a chain's links and joints, with bodies unchanged (`floored` makes them fit for Bullet).

    Link names: base, body_1…n, tip (fixed to the last body, carries the payload).

    Args:
        base: mass of the base link; zero by default, for a fixed base.
        collisions: writes the chain's shapes; None for no collisions.
    """
    root = ElementTree.Element("robot", name="chain")
    add_link(root, "base", base or MassProperties.none(), chain.shapes[0] if chain.shapes else (), collisions)
    add_moving_links(root, chain, collisions)
    return root


def object_tree(
    piece: MassProperties,
    shapes: Iterable[Shape],
    chains: Mapping[int, ChainModel],
    collisions: CollisionWriter,
) -> ElementTree.Element:
    """Return a free body as the link "object", and the moving links of chains whose base piece is part of it.

    Args:
        piece, shapes: of the link, base pieces included.
        chains: by number of the arm k, their base poses in the object's frame; names begin with `arm_k_`.
        collisions: writes the shapes.
    """
    root = ElementTree.Element("robot", name="object")
    add_link(root, "object", piece, shapes, collisions)
    for number, chain in chains.items():
        add_moving_links(root, chain, collisions, "object", f"arm_{number}_")
    return root


def add_moving_links(
    root: ElementTree.Element,
    chain: ChainModel,
    collisions: CollisionWriter | None = None,
    base: str = "base",
    prefix: str = "",
) -> None:
    """Add links and joints of body 1…n and tip; at a base named otherwise the base's pose is in its frame."""
    geometry = ChainGeometry.from_chain(chain)
    shapes = chain.shapes if collisions is not None and chain.shapes else ((),) * (chain.n_joints + 1)
    for i in range(chain.n_joints):
        name = f"{prefix}body_{i + 1}"
        add_link(root, name, chain.bodies[i + 1], shapes[i + 1], collisions)
        parent = base if i == 0 else f"{prefix}body_{i}"
        joint = add_joint(root, f"{prefix}joint_{i + 1}", JOINT_TYPES[geometry.kind], parent, name)
        place, turn = geometry.offsets[i], geometry.rest_rotations[i]
        if i == 0 and base != "base":
            rotation = np.asarray(chain.base_rotation, float)
            place, turn = chain.base_position_m + rotation @ place, rotation @ turn
        add_origin(joint, place, turn)
        ElementTree.SubElement(joint, "axis", xyz=text(geometry.basis[:, 0]))
        if geometry.kind == "prismatic":
            # Wider than any chain, so that the limit never acts.
            ElementTree.SubElement(joint, "limit", lower="-1e3", upper="1e3", effort="1e9", velocity="1e9")
    add_link(root, f"{prefix}tip", MassProperties(chain.payload_kg, np.zeros(3), np.zeros((3, 3))))
    tip = add_joint(root, f"{prefix}tip", "fixed", f"{prefix}body_{chain.n_joints}", f"{prefix}tip")
    add_origin(tip, chain.tip_offset_m, np.eye(3))


def document(root: ElementTree.Element) -> str:
    """Return the XML tree as indented text, which Bullet's parser needs."""
    # Bullet's parser refuses long lines.
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")


def floored(chain: ChainModel) -> ChainModel:
    """Return the chain with bodies that Bullet can move."""
    return chain.with_(bodies=tuple(moving(body) for body in chain.bodies))


def moving(piece: MassProperties) -> MassProperties:
    """Return a piece with Bullet's floors."""
    return regular(piece, MASS_FLOOR_KG, INERTIA_FLOOR_KG_M2)


def principal(piece: MassProperties) -> tuple[Array, Array]:
    """Return principal moments (3,) and right-handed principal axes (3, 3) as columns; Bullet's link frame."""
    moments, axes = np.linalg.eigh(piece.inertia_kg_m2)
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] *= -1.0
    return moments, axes


def add_link(
    root: ElementTree.Element,
    name: str,
    piece: MassProperties,
    shapes: Iterable[Shape] = (),
    collisions: CollisionWriter | None = None,
) -> ElementTree.Element:
    """Return a link with the piece's inertia on its principal axes, and shapes."""
    link = ElementTree.SubElement(root, "link", name=name)
    inertial = ElementTree.SubElement(link, "inertial")
    moments, axes = principal(piece)
    add_origin(inertial, piece.com_m, axes)
    ElementTree.SubElement(inertial, "mass", value=repr(float(piece.mass_kg)))
    ixx, iyy, izz = (repr(max(float(moment), 0.0)) for moment in moments)
    ElementTree.SubElement(inertial, "inertia", ixx=ixx, iyy=iyy, izz=izz, ixy="0", ixz="0", iyz="0")
    if collisions is not None:
        collisions.add(link, shapes)
    return link


def add_joint(
    root: ElementTree.Element, name: str, kind: str, parent: str, child: str
) -> ElementTree.Element:
    """Return a joint between two links."""
    joint = ElementTree.SubElement(root, "joint", name=name, type=kind)
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=child)
    return joint
