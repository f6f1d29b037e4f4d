"""Engine-neutral chain: rigid pieces joined by laws, from which every physics engine builds its model."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array, MassProperties
from pliant.records.law import N_AXES, JointLaw
from pliant.records.mount import Mount
from pliant.records.shape import Shape
from pliant.records.term import LawTerm

GRAVITY_M_S2 = (0.0, 0.0, -9.81)


@dataclass(frozen=True, eq=False)
class Joint:
    """Joint i of a chain.

    Attributes:
        law: index into `ChainModel.laws`.
        offset_m: (3,) the joint's position in its parent body's frame.
        rest_rotation: (3, 3) the joint's rest frame in the parent body's frame (rotation between segments).
        drives: first and last (exclusive) of `ChainModel.actuators` that act on it; None: all of them.
    """

    law: int
    offset_m: Array
    rest_rotation: Array
    drives: tuple[int, int] | None = None


class Ring(NamedTuple):
    """A point of the centre line: `point_m` (3,) in the frame of `body`."""

    body: int
    point_m: Array


@dataclass(frozen=True)
class Actuator:
    """A chamber or tendon that acts on joints: τ += T law(p, Tᵀ u) with T = sign · R_x(rotation).

    `input` names its signal; `rotation_rad` is its position about the chain axis, only on joints with three rotational
    axes. Neither sign nor rotation changes an extension. For a law of m actuations, m consecutive actuators give one
    value each, a; then T is 1, and τ = law(a, u).
    """

    input: str
    sign: float = 1.0
    rotation_rad: float = 0.0

    def turn(self, n_axes: int) -> Array:
        """Return T, (a, a)."""
        turn = self.sign * np.eye(n_axes)
        if self.rotation_rad:
            c, s = np.cos(self.rotation_rad), np.sin(self.rotation_rad)
            turn[1:3, 1:3] = self.sign * np.array([[c, -s], [s, c]])
        if n_axes == N_AXES["extensible"]:
            turn[-1, -1] = 1.0
        return turn


@dataclass(frozen=True, eq=False)
class ChainModel:
    """N joints and N + 1 rigid bodies in series; body 0 is fixed to the base, joint i − 1 carries body i.

    A body's frame has its origin at its own joint (body 0: at the base) and, at rest, the orientation of the
    joint's rest frame; x points toward the tip. World frame: z up. Units are SI.

    Attributes:
        joints, bodies, laws: see above; `bodies` has one more entry than `joints`.
        tip_offset_m: (3,) the tip in the last body's frame.
        base_position_m, base_rotation: pose of body 0 in the world, (3,) and (3, 3).
        gravity_m_s2: (3,).
        payload_kg: point mass at the tip.
        actuators: one entry for a single chamber; two of opposite sign for opposed chambers; those of each segment
            in turn if segments have their own (`Joint.drives`).
        terms: law terms that effects add to every joint.
        shapes: collision shapes per body (n + 1 entries) in the body's frame; empty without collisions.
        rings: base, then the end of each segment, the last being the tip; empty if segments are not known.
        mount: the arm that carries the base, and to which its pose is relative; None: the world.
        centre_line: base, both sides of each joint, tip; empty if it passes through the joints.
    """

    joints: tuple[Joint, ...]
    bodies: tuple[MassProperties, ...]
    laws: tuple[JointLaw, ...]
    tip_offset_m: Array
    base_position_m: Array
    base_rotation: Array
    gravity_m_s2: Array = field(default_factory=lambda: np.array(GRAVITY_M_S2))
    payload_kg: float = 0.0
    actuators: tuple[Actuator, ...] = (Actuator("pressure_pa"),)
    terms: tuple[LawTerm, ...] = ()
    shapes: tuple[tuple[Shape, ...], ...] = ()
    rings: tuple[Ring, ...] = ()
    centre_line: tuple[Ring, ...] = ()
    mount: Mount | None = None

    @property
    def n_joints(self) -> int:
        return len(self.joints)

    def actuator_range(self, joint: Joint) -> tuple[int, int]:
        """Return first and last (exclusive) index of the actuators that act on a joint."""
        return joint.drives or (0, len(self.actuators))

    @property
    def parts(self) -> NDArray[np.int64]:
        """(n,) multiplicity of each joint's law in its effort: once for each actuator, once if it takes several."""
        counts = []
        for joint in self.joints:
            first, last = self.actuator_range(joint)
            counts.append(1 if len(self.laws[joint.law].actuations) > 1 else last - first)
        return np.array(counts, np.int64)

    @property
    def axes(self) -> tuple[str, ...]:
        """Axes of the joint coordinates; all laws of a chain share them."""
        return self.laws[0].axes

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs, each once, in the order of the actuators."""
        return tuple(dict.fromkeys(actuator.input for actuator in self.actuators))

    @property
    def length_m(self) -> float:
        """Length from base to tip at rest."""
        return float(sum(np.linalg.norm(j.offset_m) for j in self.joints) + np.linalg.norm(self.tip_offset_m))

    def with_(self, **changes: object) -> ChainModel:
        """Return a copy with some fields replaced."""
        return replace(self, **changes)  # type: ignore[arg-type]


def default_base_rotation() -> Array:
    """Return chain x along world −z, y along −y, z along −x (docs/conventions.md): columns are the axes."""
    return np.array([[0.0, 0.0, -1.0], [0.0, -1.0, 0.0], [-1.0, 0.0, 0.0]])
