"""From the solved piece of a module to the bodies that pictures show: modules and whole fingers.

The solved piece is half a module cut by its mirror plane (y ≥ 0, x from the module's middle to its end), deformed
about the centre of an arc: its end section is a plane turned by θ = u/2 about y. Mirroring it in y = 0 and in
its start section gives the module; modules follow each other end to start.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array
from pliant.records.fem import IntArray, ModuleShape
from pliant.report.figures.raster import Surface

STRAIGHT = 1e-7  # rad


@dataclass(frozen=True, eq=False)
class SectionShape:
    """A deformed piece, unrolled: (s, y, z) per point, s the arc length along the line z = 0 of the module frame.

    Attributes:
        section: (n, 3) section coordinates, m.
        length_m: arc length of the line z = 0 between the two end sections.
        faces: (g, 9).
        stretch: (n,) largest stretch of the skin against the rest shape.
        lids: the faces (g,) that lie in the planes where the piece was cut: "start", "end", "mirror".
    """

    section: Array
    length_m: float
    faces: IntArray
    stretch: Array
    lids: Mapping[str, NDArray[np.bool_]]

    def bent(self, theta: float, without: Sequence[str]) -> Surface:
        """The piece with its end section turned by `theta` (rad), some lids left out; the start stays at x = 0."""
        faces = self.faces[~np.any([self.lids[name] for name in without], axis=0)]
        s, y, z = self.section.T
        if abs(theta) < STRAIGHT:
            return Surface(np.stack([s, y, z], axis=1), faces, self.stretch)
        radius = self.length_m / theta
        angle = s / radius
        points = np.stack([(radius + z) * np.sin(angle), y, (radius + z) * np.cos(angle) - radius], axis=1)
        return Surface(points, faces, self.stretch)

    def end_pose(self, theta: float) -> tuple[Array, Array]:
        """Rotation (3, 3) and position (3,) of the end section in the frame of the start section."""
        if abs(theta) < STRAIGHT:
            return np.eye(3), np.array([self.length_m, 0.0, 0.0])
        radius = self.length_m / theta
        return _about_y(theta), np.array([radius * np.sin(theta), 0.0, radius * (np.cos(theta) - 1)])


def unrolled(shapes: Sequence[ModuleShape]) -> list[SectionShape]:
    """The shapes in section coordinates; the first one must be the rest shape."""
    rest = shapes[0]
    x, y, _ = rest.points_m.T
    near = 1e-6 * np.ptp(x)
    planes: dict[str, NDArray[np.bool_]]
    planes = {"start": np.abs(x) < near, "end": np.abs(x - x.max()) < near, "mirror": np.abs(y) < near}
    return [_unroll(shape, rest, planes) for shape in shapes]


def at_actuation(
    shapes: Sequence[ModuleShape], sections: Sequence[SectionShape], value: float
) -> SectionShape:
    """The shape at this actuation, interpolated between the solved ones; clipped to their range."""
    levels = np.array([shape.actuation for shape in shapes])
    order = np.argsort(levels, kind="stable")
    place = float(np.interp(value, levels[order], np.arange(len(order))))
    low = sections[order[int(np.floor(place))]]
    high = sections[order[int(np.ceil(place))]]
    part = place - np.floor(place)
    return SectionShape(
        (1 - part) * low.section + part * high.section,
        (1 - part) * low.length_m + part * high.length_m,
        low.faces,
        (1 - part) * low.stretch + part * high.stretch,
        low.lids,
    )


def module(piece: SectionShape, theta: float, closed: Sequence[bool] = (True, True)) -> Surface:
    """A whole module in the frame of its middle section; `closed` tells which of its two ends have lids."""
    halves = []
    for mirror, lid in zip((True, False), closed, strict=True):
        quarter = piece.bent(theta, ("start", "mirror") if lid else ("start", "mirror", "end"))
        half = Surface.joined([quarter, quarter.mirrored(1)])
        halves.append(half.mirrored(0) if mirror else half)
    return Surface.joined(halves)


def cut_module(piece: SectionShape, theta: float) -> Surface:
    """A module cut open along y = 0: the half behind the cut, y ≥ 0."""
    quarter = piece.bent(theta, ("start",))
    return Surface.joined([quarter, quarter.mirrored(0)])


def finger(
    pieces: Sequence[SectionShape], joint_angles: Array, turns: Array, position: Array, rotation: Array
) -> tuple[Surface, Array]:
    """Modules in a row, and the path (n + 1, 3) of their ends from base to tip.

    Args:
        pieces: the shape of each module.
        joint_angles: (n,) angle u of each module, rad.
        turns: (n,) rotation of each module about the chain axis, rad, relative to the base.
        position, rotation: pose of the base in the world, (3,) and (3, 3).
    """
    parts, path = [], [np.asarray(position, float)]
    frame, origin, before = np.asarray(rotation, float), np.asarray(position, float), 0.0
    last = len(pieces) - 1
    for number, (piece, angle, turn) in enumerate(zip(pieces, joint_angles, turns, strict=True)):
        frame, before = frame @ _about_x(turn - before), float(turn)
        half, reach = piece.end_pose(angle / 2)
        # the start section in the middle's frame is the mirror image of the end section
        middle = frame @ half
        centre = origin - middle @ (reach * np.array([-1.0, 1.0, 1.0]))
        closed = (number == 0, number == last)
        parts.append(module(piece, angle / 2, closed).moved(middle, centre))
        origin, frame = centre + middle @ reach, middle @ half
        path.append(origin)
    return Surface.joined(parts), np.array(path)


def _unroll(shape: ModuleShape, rest: ModuleShape, planes: Mapping[str, NDArray[np.bool_]]) -> SectionShape:
    lids = {name: np.asarray(nodes[rest.faces].all(axis=1)) for name, nodes in planes.items()}
    end, theta = planes["end"], shape.angle_rad / 2
    x, y, z = shape.points_m.T
    stretch = _skin_stretch(rest.points_m, shape.points_m, rest.faces, np.any(list(lids.values()), axis=0))
    if abs(theta) < STRAIGHT:
        return SectionShape(shape.points_m, float(x[end].mean()), rest.faces, stretch, lids)
    # the end section is a plane through the centre of curvature, at x = 0 and z = −radius
    radius = float(np.mean(x[end] / np.tan(theta) - z[end]))
    side = np.sign(radius)
    angle = np.arctan2(side * x, side * (z + radius))
    section = np.stack([radius * angle, y, side * np.hypot(x, z + radius) - radius], axis=1)
    return SectionShape(section, radius * theta, rest.faces, stretch, lids)


def _skin_stretch(rest: Array, deformed: Array, faces: IntArray, lid: NDArray[np.bool_]) -> Array:
    """(n,) largest principal stretch in the skin's plane, averaged over the faces at each point.

    Lids count only where no real skin does: what they show is a section, not a surface.
    """
    s = np.array([0.0, 0.5, 1.0])[:, None]
    L, D = np.eye(3), np.hstack([4 * s - 3, 4 - 8 * s, 4 * s - 1])
    dA = np.einsum("qb,pa->qpba", L, D).reshape(9, 9)
    dB = np.einsum("qb,pa->qpba", D, L).reshape(9, 9)

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


def _about_y(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def _about_x(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
