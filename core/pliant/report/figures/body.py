"""Bodies that pictures show, modules and whole fingers, made from the solved piece of a module.

The solved piece is half a module, x from the module's middle to its end, cut by its mirror planes: y = 0, and z = 0
without bending. Its end section is a plane, turned by θ = u/2 about y around the centre of an arc, or moved along x by
u/2. Mirror images in these planes and in the start section give the module; modules follow each other end to start. A
piece without mirror planes is the whole module.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pliant.mechanics.rotations import exp_map
from pliant.records.design import Array
from pliant.records.fem import IntArray, ModuleShape
from pliant.report.figures.rendering import Surface, face_shapes

STRAIGHT = 1e-7  # rad


@dataclass(frozen=True, eq=False)
class SectionShape:
    """A deformed piece, unrolled: (s, y, z) per point, s the arc length along the line z = 0 of the module frame.

    Attributes:
        section: (n, 3) section coordinates, m.
        length_m: arc length of the line z = 0 between the two end sections.
        faces: (g, 9).
        values: (n,) for its colours, by default the largest stretch of the skin against the rest shape.
        lids: the faces (g,) in the planes where the piece was cut: "start", "end", and the mirror planes
            "y", "z".
        mirrors: the mirror planes that complete the module, by their normals.
    """

    section: Array
    length_m: float
    faces: IntArray
    values: Array
    lids: Mapping[str, NDArray[np.bool_]]
    mirrors: tuple[str, ...] = ("x", "y")

    def bent(self, theta: float, without: Sequence[str]) -> Surface:
        """Return the piece with its end section turned by `theta` (rad) and without some lids; it starts at x = 0."""
        hidden = [self.lids[name] for name in without if name in self.lids]
        faces = self.faces[~np.any(hidden, axis=0)] if hidden else self.faces
        s, y, z = self.section.T
        if abs(theta) < STRAIGHT:
            return Surface(np.stack([s, y, z], axis=1), faces, self.values)
        radius = self.length_m / theta
        angle = s / radius
        points = np.stack([(radius + z) * np.sin(angle), y, (radius + z) * np.cos(angle) - radius], axis=1)
        return Surface(points, faces, self.values)

    def end_pose(self, theta: float) -> tuple[Array, Array]:
        """Return rotation (3, 3) and position (3,) of the end section in the frame of the start section."""
        if abs(theta) < STRAIGHT:
            return np.eye(3), np.array([self.length_m, 0.0, 0.0])
        radius = self.length_m / theta
        return exp_map(np.array([0.0, theta, 0.0])), np.array(
            [radius * np.sin(theta), 0.0, radius * (np.cos(theta) - 1)]
        )


def piece_angle(shape: ModuleShape, slides: bool = False) -> float:
    """Return the angle θ between the piece's end sections; 0 where the joint slides."""
    return 0.0 if slides else shape.angle_rad / (2 if "x" in shape.mirrors else 1)


def unrolled(shapes: Sequence[ModuleShape], slides: bool = False) -> list[SectionShape]:
    """Return the shapes in section coordinates; the first must be the rest shape. `slides`: the joint is prismatic."""
    rest = shapes[0]
    x, y, z = rest.points_m.T
    near = 1e-6 * np.ptp(x)
    planes: dict[str, NDArray[np.bool_]]
    planes = {"start": np.abs(x) < near, "end": np.abs(x - x.max()) < near}
    planes |= {name: np.abs(c) < near for name, c in (("y", y), ("z", z)) if name in rest.mirrors}
    return [_unroll(shape, rest, planes, piece_angle(shape, slides)) for shape in shapes]


def at_actuation(
    shapes: Sequence[ModuleShape], sections: Sequence[SectionShape], value: float
) -> SectionShape:
    """Return the shape at this actuation, interpolated between the solved ones; clipped to their range."""
    order, place = level_position(shapes, value)
    low = sections[order[int(np.floor(place))]]
    high = sections[order[int(np.ceil(place))]]
    part = place - np.floor(place)
    return replace(
        low,
        section=(1 - part) * low.section + part * high.section,
        length_m=(1 - part) * low.length_m + part * high.length_m,
        values=(1 - part) * low.values + part * high.values,
    )


def level_position(shapes: Sequence[ModuleShape], value: float) -> tuple[IntArray, float]:
    """Return the shapes' order by actuation, and the position of this actuation in it; clipped to their range."""
    levels = np.array([shape.actuation for shape in shapes])
    order = np.argsort(levels, kind="stable")
    return order, float(np.interp(value, levels[order], np.arange(len(order))))


def module(piece: SectionShape, theta: float, closed: Sequence[bool] = (True, True)) -> Surface:
    """Return a whole module in the frame of its middle section; `closed`: which of its two ends have lids.

    A piece without the mirror plane x is the module, in the frame of its start section.
    """
    if "x" not in piece.mirrors:
        return _sides(piece.bent(theta, ("y", "z")), piece)
    halves = []
    for mirror, lid in zip((True, False), closed, strict=True):
        without = ("start", "y", "z") if lid else ("start", "y", "z", "end")
        half = _sides(piece.bent(theta, without), piece)
        halves.append(half.mirrored(0) if mirror else half)
    return Surface.joined(halves)


def cut_module(piece: SectionShape, theta: float) -> Surface:
    """Return a module cut open along y = 0, if that is a mirror plane: the half behind the cut, y ≥ 0."""
    halved = "x" in piece.mirrors
    part = _sides(piece.bent(theta, ("start", "z") if halved else ("z",)), piece, "z")
    return Surface.joined([part, part.mirrored(0)]) if halved else part


def _sides(part: Surface, piece: SectionShape, planes: str = "yz") -> Surface:
    """Return the part with its mirror images in some of the piece's planes."""
    for number, name in enumerate("xyz"):
        if name in planes and name in piece.mirrors:
            part = Surface.joined([part, part.mirrored(number)])
    return part


def finger(
    pieces: Sequence[SectionShape], joint_angles: Array, turns: Array, position: Array, rotation: Array
) -> tuple[Surface, Array]:
    """Return modules in a row, and the path (n + 1, 3) of their ends from base to tip.

    Args:
        pieces: the shape of each module.
        joint_angles: (n,) angle u of each module, rad.
        turns: (n,) rotation of each module about the chain axis, rad, relative to the base.
        position, rotation: pose of the base in the world, (3,) and (3, 3).
    """
    middles, centres, path = poses(pieces, joint_angles, turns, position, rotation)
    last = len(pieces) - 1
    parts = [
        module(piece, angle / 2, (number == 0, number == last)).moved(middles[number], centres[number])
        for number, (piece, angle) in enumerate(zip(pieces, joint_angles, strict=True))
    ]
    return Surface.joined(parts), path


def poses(
    pieces: Sequence[SectionShape], joint_angles: Array, turns: Array, position: Array, rotation: Array
) -> tuple[Array, Array, Array]:
    """Return rotations (n, 3, 3) and centres (n, 3) of a finger's middle sections, and the path."""
    middles, centres, path = [], [], [np.asarray(position, float)]
    frame, origin, before = np.asarray(rotation, float), np.asarray(position, float), 0.0
    for piece, angle, turn in zip(pieces, joint_angles, turns, strict=True):
        frame, before = frame @ exp_map(np.array([turn - before, 0.0, 0.0])), float(turn)
        half, reach = piece.end_pose(angle / 2)
        # the start section in the middle's frame is the mirror image of the end section
        middle = frame @ half
        centre = origin - middle @ (reach * np.array([-1.0, 1.0, 1.0]))
        origin, frame = centre + middle @ reach, middle @ half
        middles.append(middle)
        centres.append(centre)
        path.append(origin)
    return np.array(middles), np.array(centres), np.array(path)


def _unroll(
    shape: ModuleShape, rest: ModuleShape, planes: Mapping[str, NDArray[np.bool_]], theta: float
) -> SectionShape:
    """Return a shape in section coordinates; `theta` is the angle between the piece's end sections."""
    lids = {name: np.asarray(nodes[rest.faces].all(axis=1)) for name, nodes in planes.items()}
    end = planes["end"]
    x, y, z = shape.points_m.T
    stretch = _skin_stretch(rest.points_m, shape.points_m, rest.faces, np.any(list(lids.values()), axis=0))
    if abs(theta) < STRAIGHT:
        length_m = float(x[end].mean())
        return SectionShape(shape.points_m, length_m, rest.faces, stretch, lids, rest.mirrors)
    # the end section is a plane through the centre of curvature, at x = 0 and z = −radius
    radius = float(np.mean(x[end] / np.tan(theta) - z[end]))
    side = np.sign(radius)
    angle = np.arctan2(side * x, side * (z + radius))
    section = np.stack([radius * angle, y, side * np.hypot(x, z + radius) - radius], axis=1)
    return SectionShape(section, radius * theta, rest.faces, stretch, lids, rest.mirrors)


def _skin_stretch(rest: Array, deformed: Array, faces: IntArray, lid: NDArray[np.bool_]) -> Array:
    """Return (n,) the largest principal stretch in the skin's plane, averaged over the faces at each point.

    Lids count only at points without real skin: they are sections, not surfaces.
    """
    _, dA, dB, _ = face_shapes((3, 3))

    def metric(points: Array) -> Array:
        tangents = np.stack([dA @ points[faces], dB @ points[faces]], axis=-1)
        return np.asarray(np.swapaxes(tangents, -1, -2) @ tangents)

    before, after = metric(rest), metric(deformed)
    scale = np.trace(before, axis1=-2, axis2=-1)[..., None, None]
    before = before + 1e-9 * scale * np.eye(2)  # edges that vanish at a node
    ratio = np.linalg.solve(before, after)
    half, determinant = np.trace(ratio, axis1=-2, axis2=-1) / 2, np.linalg.det(ratio)
    largest = np.sqrt(half + np.sqrt(np.maximum(half**2 - determinant, 0.0)))
    weight = np.repeat(np.where(lid, 1e-6, 1.0), 9)
    total = np.bincount(faces.ravel(), weight * largest.ravel(), minlength=len(rest))
    count = np.bincount(faces.ravel(), weight, minlength=len(rest))
    return np.asarray(total / np.maximum(count, 1e-9))
