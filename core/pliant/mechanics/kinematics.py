"""Forward kinematics of a chain in joint coordinates q (n, a).

Joint i carries body i + 1: its origin is P = p + R (offset) of its parent and its orientation
R_parent · rest · exp(B q), where the columns of B (3, a) are the joint's axes. A prismatic joint moves the
child by q along its axis instead. An extensible one, q = (φ, e), rotates by φ and then moves the child by e along the
child's x: the joint stays at the middle of the resting module, and the module's extension is distal to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pliant.errors import ContractError
from pliant.mechanics.rotations import exp_map, left_jacobian, skew
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.law import EXTENSIBLE_AXES, EXTENSION, N_AXES, JointKind, travels

AXES = {"x": 0, "y": 1, "z": 2}
MAIN_AXIS = "y"


@dataclass(frozen=True, eq=False)
class Pose:
    """A chain in space, world frame.

    Attributes:
        origins: (n + 1, 3) body origins; that of body i + 1 is at joint i.
        rotations: (n + 1, 3, 3) body orientations.
        rest_frames: (n, 3, 3) rest frames of the joints: parent's orientation times rest rotation.
        directions: (n, 3, a) angular velocity of the child per rate of each coordinate (its velocity for a
            translation: see `ChainGeometry.turns` and `slide`).
        pivots: (n, 3) the points about which the joints rotate; a body's origin is offset from it by the extension.
    """

    origins: Array
    rotations: Array
    rest_frames: Array
    directions: Array
    pivots: Array

    def moved(self, place_m: Array, turn: Array | None = None) -> Pose:
        """Return the pose after rotating the frame of the chain by (3, 3), then moving it by (3,)."""
        if turn is None:
            return replace(self, origins=self.origins + place_m, pivots=self.pivots + place_m)
        return Pose(
            self.origins @ turn.T + place_m,
            turn @ self.rotations,
            turn @ self.rest_frames,
            turn @ self.directions,
            self.pivots @ turn.T + place_m,
        )


@dataclass(frozen=True, eq=False)
class ChainGeometry:
    """Constant geometry of a chain: joint type, axes and offsets, as arrays.

    `basis` (3, a) has the axes of rotations, or of a prismatic joint, as columns; that of an extension is zero.
    `reach` (a,) is the change of each coordinate that is equivalent to 1 rad: for translations a module's length.
    """

    kind: JointKind
    axes: tuple[str, ...]
    basis: Array
    offsets: Array
    rest_rotations: Array
    tip_offset: Array
    base_position: Array
    base_rotation: Array
    reach: Array

    @staticmethod
    def from_chain(chain: ChainModel) -> ChainGeometry:
        """Return the geometry of a chain.

        Raises:
            ContractError: the chain's lists are inconsistent, or its laws differ in joint type or axes.
        """
        _check(chain)
        law = chain.laws[0]
        return ChainGeometry(
            kind=law.joint,
            axes=law.axes,
            basis=np.stack([np.eye(3)[AXES[a]] if a in AXES else np.zeros(3) for a in law.axes], axis=1),
            offsets=np.array([joint.offset_m for joint in chain.joints], float),
            rest_rotations=np.array([joint.rest_rotation for joint in chain.joints], float),
            tip_offset=np.asarray(chain.tip_offset_m, float),
            base_position=np.asarray(chain.base_position_m, float),
            base_rotation=np.asarray(chain.base_rotation, float),
            reach=_reach(chain),
        )

    @property
    def n_joints(self) -> int:
        return len(self.offsets)

    @property
    def main(self) -> int:
        """Column of the main bending axis, or of the only axis."""
        return main_axis(self.axes)

    @property
    def slide(self) -> int | None:
        """Column of a translational coordinate of a rotational joint; None without one."""
        return self.axes.index(EXTENSION) if EXTENSION in self.axes else None

    @property
    def turns(self) -> bool:
        """Return whether the joints rotate all distal bodies about their pivots."""
        return self.kind != "prismatic"

    @property
    def relative_reach(self) -> Array:
        """(a,) `reach` as a share of the first coordinate's."""
        return np.asarray(self.reach / self.reach[0])

    def rotation_vectors(self, q: Array) -> Array:
        """Return (n, 3) rotation vectors of the joints."""
        return np.asarray(q @ self.basis.T)

    def forward(self, q: Array) -> Pose:
        """Return the pose at joint coordinates q (n, a)."""
        n = self.n_joints
        origins, rotations = np.empty((n + 1, 3)), np.empty((n + 1, 3, 3))
        origins[0], rotations[0] = self.base_position, self.base_rotation
        phi = self.rotation_vectors(q)
        turns = self.rest_rotations @ self._turns(q, phi)
        for i in range(n):
            rotations[i + 1] = rotations[i] @ turns[i]
        rest_frames = rotations[:-1] @ self.rest_rotations
        links = np.einsum("nij,nj->ni", rotations[:-1], self.offsets)
        ball = self.kind in ("spherical", "extensible")
        directions = rest_frames @ (left_jacobian(phi) @ self.basis if ball else self.basis)
        if self.kind == "prismatic":
            links += np.einsum("nij,nj->ni", rest_frames, phi)
        elif self.slide is not None:
            along = directions[:, :, self.slide] = rotations[1:, :, 0]
            links += q[:, self.slide, None] * along
        origins[1:] = self.base_position + np.cumsum(links, axis=0)
        pivots = origins[1:]
        if self.slide is not None:
            pivots = pivots - q[:, self.slide, None] * rotations[1:, :, 0]
        return Pose(origins, rotations, rest_frames, directions, pivots)

    def _turns(self, q: Array, phi: Array) -> Array:
        """Return (n, 3, 3) or (1, 3, 3) rotations of the joints."""
        if self.kind == "prismatic":
            return np.eye(3)[None]
        if self.kind != "revolute":
            return exp_map(phi)
        hinge = skew(self.basis[:, 0])
        angle = q[:, :, None]
        return np.asarray(np.eye(3) + np.sin(angle) * hinge + 2 * np.sin(0.5 * angle) ** 2 * (hinge @ hinge))

    def markers(self, q: Array) -> Array:
        """Return (n + 2, 3) base, joints 1…n and tip; a joint's marker is the origin of its child body."""
        pose = self.forward(q)
        tip = pose.origins[-1] + pose.rotations[-1] @ self.tip_offset
        return np.concatenate([pose.origins, tip[None]])


def _reach(chain: ChainModel) -> Array:
    slides = travels(chain.laws[0].joint, chain.axes)
    return np.where(slides, chain.length_m / chain.n_joints, 1.0) if any(slides) else np.ones(len(slides))


def main_axis(axes: Sequence[str]) -> int:
    """Return the column of the main bending axis among a joint's axes, or of the only one."""
    return axes.index(MAIN_AXIS) if MAIN_AXIS in axes else 0


def _check(chain: ChainModel) -> None:
    if not chain.joints or not chain.laws:
        raise ContractError("a chain needs at least one joint and one law")
    if len(chain.bodies) != chain.n_joints + 1:
        raise ContractError(
            f"a chain of {chain.n_joints} joints has {chain.n_joints + 1} bodies, not {len(chain.bodies)}"
        )
    first = chain.laws[0]
    if any(law.joint != first.joint or law.axes != first.axes for law in chain.laws):
        raise ContractError("all laws of a chain must share the joint kind and the axes")
    n_axes = N_AXES[first.joint]
    if first.joint == "extensible" and first.axes != EXTENSIBLE_AXES:
        raise ContractError(
            f"an extensible law has all of the axes x, y, z, e in this order, not {first.axes}"
        )
    if first.joint != "extensible" and (len(set(first.axes)) != n_axes or not set(first.axes) <= set(AXES)):
        raise ContractError(f"a {first.joint} law has {n_axes} of the axes x, y, z, not {first.axes}")
    if any(not 0 <= joint.law < len(chain.laws) for joint in chain.joints):
        raise ContractError("a joint names a law that the chain does not have")


def trajectory(geometry: ChainGeometry, q: Array, base_rotations: Array) -> Array:
    """Return (t, n + 2, 3) markers over a history: coordinates q (t, n, a), base orientations (t, 3, 3)."""
    if base_rotations.strides[0] == 0:  # the base does not turn
        base_rotations = base_rotations[:1]
    if geometry.kind == "revolute":
        return _hinges(geometry, q[:, :, 0], base_rotations)
    steps, n = q.shape[:2]
    markers = np.empty((steps, n + 2, 3))
    position, rotation = geometry.base_position, base_rotations
    markers[:, 0] = position
    vectors = q @ geometry.basis.T
    for i in range(n):
        position = position + rotation @ geometry.offsets[i]
        rotation = rotation @ geometry.rest_rotations[i]
        if geometry.kind == "prismatic":
            position = position + np.einsum("tij,tj->ti", rotation, vectors[:, i])
        else:
            rotation = rotation @ _turned(vectors[:, i])
        if geometry.slide is not None:
            position = position + q[:, i, geometry.slide, None] * rotation[:, :, 0]
        markers[:, i + 1] = position
    markers[:, n + 1] = position + rotation @ geometry.tip_offset
    return markers


def orientations(geometry: ChainGeometry, q: Array, base_rotations: Array) -> Array:
    """Return (t, n + 1, 3, 3) orientations of the bodies over a history, as `trajectory`."""
    rotations = np.empty((len(q), geometry.n_joints + 1, 3, 3))
    rotations[:, 0] = base_rotations
    vectors = q @ geometry.basis.T
    for i in range(geometry.n_joints):
        rotations[:, i + 1] = rotations[:, i] @ geometry.rest_rotations[i]
        if geometry.kind != "prismatic":
            rotations[:, i + 1] = rotations[:, i + 1] @ _turned(vectors[:, i])
    return rotations


def _turned(vectors: Array) -> Array:
    """Return (t, 3, 3) rotations; NaN for states that were not reached or overflow."""
    with np.errstate(invalid="ignore", over="ignore"):
        return exp_map(vectors)


def _hinges(geometry: ChainGeometry, q: Array, base_rotations: Array) -> Array:
    """Return markers of hinges at angles q (t, n) by rotating two columns; time is the last axis in memory."""
    steps, n = q.shape
    axis = int(np.argmax(geometry.basis[:, 0]))
    first, second = (axis + 1) % 3, (axis + 2) % 3
    columns: list[Array] = list(np.ascontiguousarray(base_rotations.transpose(2, 1, 0)))  # (3, t), or (3, 1)
    markers = np.empty((n + 2, 3, steps))
    markers[0] = geometry.base_position[:, None]
    with np.errstate(invalid="ignore"):  # NaN for states that were not reached
        cosines, sines = np.cos(q.T), np.sin(q.T)
    for i, (cosine, sine) in enumerate(zip(cosines, sines, strict=True)):
        markers[i + 1] = markers[i]
        _add(columns, geometry.offsets[i], markers[i + 1])
        rest = geometry.rest_rotations[i]
        if not np.array_equal(rest, np.eye(3)):
            columns = [_add(columns, rest[:, k], np.zeros((3, steps))) for k in range(3)]
        a, b = columns[first], columns[second]
        columns[first], columns[second] = cosine * a + sine * b, cosine * b - sine * a
    markers[n + 1] = markers[n]
    _add(columns, geometry.tip_offset, markers[n + 1])
    return markers.transpose(2, 0, 1)


def _add(columns: Sequence[Array], factors: Array, total: Array) -> Array:
    """Add the columns (3, t) times their factors to the total (3, t), in place; return the total."""
    for column, factor in zip(columns, factors, strict=True):
        if factor != 0.0:
            total += factor * column
    return total


def base_rotations(rotation: Array, angles: Array) -> Array:
    """Return (t, 3, 3) base orientations: `rotation`, then turns about world x, y, z by the rows of `angles`.

    Without any turn it is a view of one rotation, to be read only.
    """
    if not angles.any():
        return np.broadcast_to(rotation, (len(angles), 3, 3))
    (cx, cy, cz), (sx, sy, sz) = np.cos(angles.T), np.sin(angles.T)
    turns = np.empty((len(angles), 3, 3))
    turns[:, 0, 0], turns[:, 0, 1], turns[:, 0, 2] = cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx
    turns[:, 1, 0], turns[:, 1, 1], turns[:, 1, 2] = sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx
    turns[:, 2, 0], turns[:, 2, 1], turns[:, 2, 2] = -sy, cy * sx, cy * cx
    return np.asarray((turns.reshape(-1, 3) @ rotation).reshape(-1, 3, 3))
