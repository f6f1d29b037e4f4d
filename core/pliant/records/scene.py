"""Scenes for tasks with contact: arms on one carriage, free objects, fixed obstacles, a floor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from pliant.records.chain import GRAVITY_M_S2, ChainModel
from pliant.records.design import Array, MassProperties
from pliant.records.shape import Shape


@dataclass(frozen=True, eq=False)
class Arm:
    """A chain; its `ChainModel.shapes` collide, with this coefficient of friction.

    Attributes:
        chain, friction: see above.
        base_object: number of the free object that carries its base, with which the base piece then is one body, of
            the object's friction; None: the scene's carriage carries it.
    """

    chain: ChainModel
    friction: float = 0.8
    base_object: int | None = None


@dataclass(frozen=True, eq=False)
class FreeBody:
    """An object that moves freely.

    Attributes:
        name: for messages and pictures.
        mass: in the object's own frame; its centre of mass need not be the origin.
        shapes: collision shapes, in the same frame.
        friction: coefficient against the floor, and against arms by the scene's rule.
        position_m, rotation: (3,) and (3, 3), pose at the start.
    """

    name: str
    mass: MassProperties
    shapes: tuple[Shape, ...]
    friction: float
    position_m: Array
    rotation: Array

    @staticmethod
    def seen(name: str, shapes: tuple[Shape, ...]) -> FreeBody:
        """Return a body that is only drawn."""
        return FreeBody(name, MassProperties.none(), shapes, 0.0, np.zeros(3), np.eye(3))


@dataclass(frozen=True, eq=False)
class Obstacle:
    """A fixed body: its convex shapes in the world frame, and its coefficient of friction."""

    name: str
    shapes: tuple[Shape, ...]
    friction: float = 0.0


@dataclass(frozen=True, eq=False)
class Scene:
    """Arms, objects, obstacles and floor, at rest at time 0.

    The coefficient of friction of a pair is the product of both bodies' coefficients, in every engine: an
    object of coefficient 1 has the arms' friction. Arms collide with objects (but for the one that carries them),
    obstacles and floor, and if `arms_touch` also with each other and themselves, with the product of their
    coefficients.

    Attributes:
        arms: chains with their base poses in the world at the start; what carries them moves them from there.
        objects: free bodies; they collide with arms, floor and each other.
        floor_m: height of a horizontal floor, or None.
        floor_friction: its coefficient.
        gravity_m_s2: (3,), for arms and objects; the chains' own gravity is not used.
        arms_touch: whether arms collide with each other, and parts of one arm that are far apart along it.
        carriers: number of leading objects that are bodies of the carrying arm; only drawn.
        obstacles: fixed bodies; they collide with arms and objects.
    """

    arms: tuple[Arm, ...]
    objects: tuple[FreeBody, ...] = ()
    floor_m: float | None = None
    floor_friction: float = 1.0
    gravity_m_s2: Array = field(default_factory=lambda: np.array(GRAVITY_M_S2))
    arms_touch: bool = False
    carriers: int = 0
    obstacles: tuple[Obstacle, ...] = ()

    def base_on_object(self, number: int) -> tuple[Array, Array]:
        """Return position (3,) and rotation (3, 3) of an arm's base in the frame of the object that carries it."""
        arm = self.arms[number]
        assert arm.base_object is not None
        body, chain = self.objects[arm.base_object], arm.chain
        offset = np.asarray(chain.base_position_m, float) - body.position_m
        return body.rotation.T @ offset, body.rotation.T @ np.asarray(chain.base_rotation, float)

    def base_motion(
        self, number: int, carriage_m: Array, positions_m: Array, rotations: Array
    ) -> tuple[Array, Array | None]:
        """Return translation (3,) and rotation (3, 3), or None, that take an arm from the start to the present.

        A point x of its straight pose at the start is at `translation + rotation @ x` now.

        Args:
            number: of the arm.
            carriage_m: (3,) displacement of the carriage.
            positions_m, rotations: (k, 3) and (k, 3, 3) of the objects.
        """
        carrier = self.arms[number].base_object
        if carrier is None:
            return carriage_m, None
        body = self.objects[carrier]
        turn = rotations[carrier] @ body.rotation.T
        return positions_m[carrier] - turn @ body.position_m, turn


class Part(NamedTuple):
    """A body in a scene: arm `number` (from 0) and its body, object or obstacle `number`, or the floor."""

    kind: Literal["arm", "object", "obstacle", "floor"]
    number: int = 0
    body: int = 0


@dataclass(frozen=True, eq=False)
class Contact:
    """A contact point. Forces are those on `second`, in the world.

    Attributes:
        first, second: the bodies; for an arm and an object, the arm comes first.
        position_m: (3,).
        normal: (3,) unit vector from first to second.
        normal_n: pressing force along it, ≥ 0.
        friction_n: (3,) tangential force on second.
        depth_m: penetration of the bodies, ≥ 0, since engines' contacts are springs.
    """

    first: Part
    second: Part
    position_m: Array
    normal: Array
    normal_n: float
    friction_n: Array
    depth_m: float = 0.0


@dataclass(frozen=True, eq=False)
class SceneState:
    """Snapshot of a scene.

    Attributes:
        time_s: since the start.
        carriage_m: (3,) displacement of the carriage.
        coordinates, rates: per arm (n, a) joint coordinates and their rates.
        positions_m, rotations: (k, 3) and (k, 3, 3) of the objects.
        velocities: (k, 6) linear velocity of the frame's origin and angular velocity, world.
        memories: per arm the memory of law terms (n, a, states), or None.
        private: further arrays by name that the engine needs to continue exactly (warm starts, caches).
    """

    time_s: float
    carriage_m: Array
    coordinates: tuple[Array, ...]
    rates: tuple[Array, ...]
    positions_m: Array
    rotations: Array
    velocities: Array
    memories: tuple[Array | None, ...] = ()
    private: dict[str, Array] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class SceneFrames:
    """A scene's motion as recorded: time_s (t,), carriage_m (t, 3), per arm coordinates (t, n, a), and objects.

    positions_m (t, k, 3) and rotations (t, k, 3, 3) are those of the objects. No engine is needed to draw it. If the
    frame that carries the arms rotates too, carriage_turns (t, 3, 3) is its attitude, and carriage_m its origin.
    """

    time_s: Array
    carriage_m: Array
    coordinates: tuple[Array, ...]
    positions_m: Array
    rotations: Array
    carriage_turns: Array | None = None

    @staticmethod
    def from_states(states: Sequence[SceneState]) -> SceneFrames:
        """Return the frames of a series of snapshots."""
        arms = range(len(states[0].coordinates))
        return SceneFrames(
            time_s=np.array([s.time_s for s in states]),
            carriage_m=np.array([s.carriage_m for s in states]),
            coordinates=tuple(np.array([s.coordinates[k] for s in states]) for k in arms),
            positions_m=np.array([s.positions_m for s in states]),
            rotations=np.array([s.rotations for s in states]),
        )


@dataclass(frozen=True, eq=False)
class SceneStill:
    """A scene at one instant, for a picture: every shape in the world frame.

    Attributes:
        label: name of the instant ("lifted").
        time_s: its time.
        arms: all shapes of each arm.
        objects: all shapes of each object, then of each obstacle.
        floor_m: height of the floor, or None.
    """

    label: str
    time_s: float
    arms: tuple[tuple[Shape, ...], ...]
    objects: tuple[tuple[Shape, ...], ...]
    floor_m: float | None = None
