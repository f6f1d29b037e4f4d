"""A scene in a Bullet client: arms, objects and floor as multibodies of a scaled world.

The carriage is the free base of every arm, so heavy that nothing on the arm moves it: contacts feel its
velocity, which they do not on a fixed base that is moved by hand. Its own weight is held at every step.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import numpy as np

from pliant.mechanics.kinematics import ChainGeometry
from pliant.mechanics.rotations import matrix_of_quaternion, quaternion_of_matrix
from pliant.records.design import Array, MassProperties
from pliant.records.scene import Arm, Contact, FreeBody, Part, Scene
from pliant_plugins.physics.pybullet.arm import UNLIMITED_VELOCITY, BulletArm, check_size
from pliant_plugins.physics.pybullet.config import PybulletConfig
from pliant_plugins.physics.pybullet.loader import load_pybullet
from pliant_plugins.physics.pybullet.scaling import WorldScale
from pliant_plugins.physics.pybullet.urdf import (
    CollisionWriter,
    body_urdf,
    chain_urdf,
    floored,
    moving,
    principal,
)

# How many times heavier than everything in the scene the carriage is.
CARRIAGE_SHARE = 1e9
ARMS, OBJECTS, FLOOR = 2, 4, 8


@dataclass(frozen=True, eq=False)
class BulletObject:
    """A free body; Bullet's frame is its principal frame at the centre of mass."""

    body: int
    mass: MassProperties
    axes: Array


class BulletWorld:
    """One client in DIRECT mode. Poses and velocities are in SI and in the bodies' own frames outside."""

    def __init__(self, scene: Scene, config: PybulletConfig) -> None:
        for arm in scene.arms:
            check_size(ChainGeometry.of(arm.chain))
        self.scale = WorldScale(config.world_scale)
        self._config = config
        self.bullet = load_pybullet()
        self.client = self.bullet.connect(self.bullet.DIRECT)
        self._here = {"physicsClientId": self.client}
        self.parts: dict[int, Part] = {}
        self._gravity = self.scale.length * np.asarray(scene.gravity_m_s2, float)
        self._carriage_kg = CARRIAGE_SHARE * self.scale.mass * _mass_kg(scene)
        try:
            self._set_engine()
            with tempfile.TemporaryDirectory() as folder:
                collisions = CollisionWriter(Path(folder))
                self.arms = [self._add_arm(k, arm, collisions) for k, arm in enumerate(scene.arms)]
                self.objects = [self._add_object(k, one, collisions) for k, one in enumerate(scene.objects)]
            self._add_floor(scene)
            # In the frame of each base, which does not turn: held there, no rounding of places enters.
            weight = self._carriage_kg * self._gravity
            self._holds = [(-arm.chain.base_rotation.T @ weight).tolist() for arm in scene.arms]
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Disconnect the client; a second call does nothing."""
        if self.client >= 0:
            self.bullet.disconnect(physicsClientId=self.client)
            self.client = -1

    def set_timestep(self, timestep_s: float) -> None:
        """Length of the next steps."""
        self.bullet.setTimeStep(timestep_s, **self._here)

    def move_bases(self, velocity_m_s: Array) -> None:
        """The velocity of every arm's base."""
        velocity = (self.scale.length * velocity_m_s).tolist()
        for arm in self.arms:
            self.bullet.resetBaseVelocity(arm.body, velocity, [0.0, 0.0, 0.0], **self._here)

    def place_bases(self, scene: Scene, carriage_m: Array) -> None:
        """The place of every arm's base."""
        for arm, given in zip(self.arms, scene.arms, strict=True):
            chain = given.chain
            place = self.scale.length * (np.asarray(chain.base_position_m, float) + carriage_m)
            quaternion = np.roll(quaternion_of_matrix(chain.base_rotation), -1)
            self.bullet.resetBasePositionAndOrientation(
                arm.body, place.tolist(), quaternion.tolist(), **self._here
            )

    def bases_m(self) -> Array:
        """(arms, 3) where Bullet has the arms' bases."""
        places = [self.bullet.getBasePositionAndOrientation(a.body, **self._here)[0] for a in self.arms]
        return np.reshape(places, (-1, 3)) / self.scale.length

    def advance(self) -> None:
        """One step, the carriage's weight held."""
        frame = self.bullet.LINK_FRAME
        for arm, hold in zip(self.arms, self._holds, strict=True):
            self.bullet.applyExternalForce(arm.body, -1, hold, [0.0, 0.0, 0.0], frame, **self._here)
        self.bullet.stepSimulation(**self._here)

    def push(self, index: int, force_n: Array, moment_n_m: Array) -> None:
        """A world wrench on an object at its centre of mass during the next step."""
        body, frame = self.objects[index].body, self.bullet.WORLD_FRAME
        centre = self.bullet.getBasePositionAndOrientation(body, **self._here)[0]
        self.bullet.applyExternalForce(
            body, -1, (self.scale.force * force_n).tolist(), centre, frame, **self._here
        )
        self.bullet.applyExternalTorque(
            body, -1, (self.scale.torque * moment_n_m).tolist(), frame, **self._here
        )

    def object_states(self) -> tuple[Array, Array, Array]:
        """positions_m (k, 3), rotations (k, 3, 3) and velocities (k, 6) of the objects' own frames."""
        count = len(self.objects)
        positions, rotations, velocities = (
            np.empty((count, 3)),
            np.empty((count, 3, 3)),
            np.empty((count, 6)),
        )
        for k, one in enumerate(self.objects):
            centre, quaternion = self.bullet.getBasePositionAndOrientation(one.body, **self._here)
            linear, angular = self.bullet.getBaseVelocity(one.body, **self._here)
            rotations[k] = matrix_of_quaternion(np.roll(quaternion, 1)) @ one.axes.T
            arm = rotations[k] @ one.mass.com_m
            positions[k] = np.asarray(centre) / self.scale.length - arm
            velocities[k, :3] = np.asarray(linear) / self.scale.length - np.cross(angular, arm)
            velocities[k, 3:] = angular
        return positions, rotations, velocities

    def place_object(self, index: int, position_m: Array, rotation: Array, velocity: Array) -> None:
        """Put an object somewhere, with a velocity (6,) of its frame's origin."""
        one = self.objects[index]
        arm = rotation @ one.mass.com_m
        quaternion = np.roll(quaternion_of_matrix(rotation @ one.axes), -1)
        centre = self.scale.length * (position_m + arm)
        linear = self.scale.length * (velocity[:3] + np.cross(velocity[3:], arm))
        self.bullet.resetBasePositionAndOrientation(
            one.body, centre.tolist(), quaternion.tolist(), **self._here
        )
        self.bullet.resetBaseVelocity(one.body, linear.tolist(), velocity[3:].tolist(), **self._here)

    def _set_engine(self) -> None:
        # Gravity acts on every body, on the carriage too.
        self.bullet.setGravity(*self._gravity.tolist(), **self._here)
        self.bullet.setPhysicsEngineParameter(
            numSolverIterations=self._config.solver_iterations, **self._here
        )

    def _add_arm(self, number: int, arm: Arm, collisions: CollisionWriter) -> BulletArm:
        chain = self.scale.chain(floored(arm.chain))
        base = MassProperties(self._carriage_kg, np.zeros(3), self._carriage_kg * np.eye(3))
        body = self._load(
            chain_urdf(chain, base, collisions), chain.base_position_m, chain.base_rotation, collisions
        )
        self.parts[body] = Part("arm", number)
        self._touch(body, range(-1, chain.n_joints + 1), arm.friction, ARMS, OBJECTS | FLOOR)
        return BulletArm(self.bullet, self.client, body, chain, self.scale)

    def _add_object(self, number: int, given: FreeBody, collisions: CollisionWriter) -> BulletObject:
        piece = self.scale.piece(moving(given.mass))
        shapes = [self.scale.shape(shape) for shape in given.shapes]
        place = self.scale.length * np.asarray(given.position_m, float)
        body = self._load(body_urdf(piece, shapes, collisions), place, given.rotation, collisions)
        self.parts[body] = Part("object", number)
        self._touch(body, [-1], given.friction, OBJECTS, ARMS | OBJECTS | FLOOR)
        for setting in ("linearDamping", "angularDamping"):
            self.bullet.changeDynamics(body, -1, **{setting: 0.0}, **self._here)
        self.bullet.changeDynamics(body, -1, maxJointVelocity=UNLIMITED_VELOCITY, **self._here)
        return BulletObject(body, given.mass, principal(moving(piece))[1])

    def _add_floor(self, scene: Scene) -> None:
        if scene.floor_m is None:
            return
        plane = self.bullet.createCollisionShape(self.bullet.GEOM_PLANE, **self._here)
        place = [0.0, 0.0, self.scale.length * scene.floor_m]
        body = self.bullet.createMultiBody(0.0, plane, basePosition=place, **self._here)
        self.parts[body] = Part("floor")
        self._touch(body, [-1], scene.floor_friction, FLOOR, OBJECTS | ARMS)

    def _load(self, urdf: str, place: Array, rotation: Array, collisions: CollisionWriter) -> int:
        path = collisions.folder / f"body_{len(self.parts)}.urdf"
        path.write_text(urdf, encoding="utf-8")
        body: int = self.bullet.loadURDF(
            str(path),
            np.asarray(place, float).tolist(),
            np.roll(quaternion_of_matrix(rotation), -1).tolist(),
            useFixedBase=False,
            flags=self.bullet.URDF_USE_INERTIA_FROM_FILE,
            **self._here,
        )
        return body

    def _touch(self, body: int, links: range | list[int], friction: float, group: int, mask: int) -> None:
        """Friction and what collides with what. Bullet multiplies coefficients, as the scene's rule has it."""
        for link in links:
            # In one call with other settings friction would stay at 0.5.
            self.bullet.changeDynamics(body, link, lateralFriction=friction, **self._here)
            for setting in ("rollingFriction", "spinningFriction", "restitution"):
                self.bullet.changeDynamics(body, link, **{setting: 0.0}, **self._here)
            self.bullet.changeDynamics(body, link, frictionAnchor=self._config.friction_anchors, **self._here)
            self.bullet.setCollisionFilterGroupMask(body, link, group, mask, **self._here)
            kept = self.bullet.getDynamicsInfo(body, link, **self._here)[1]
            assert abs(kept - friction) < 1e-9, f"Bullet kept a friction of {kept} instead of {friction}"


def _mass_kg(scene: Scene) -> float:
    arms = sum(b.mass_kg for arm in scene.arms for b in arm.chain.bodies)
    payloads = sum(arm.chain.payload_kg for arm in scene.arms)
    return arms + payloads + sum(one.mass.mass_kg for one in scene.objects) + 1e-3


ORDER = {"arm": 0, "object": 1, "floor": 2}


def read_contacts(
    bullet: ModuleType, client: int, parts: Mapping[int, Part], scale: WorldScale
) -> tuple[Contact, ...]:
    """Contacts with the forces of the last step; of two bodies, arms come first, then objects by number."""
    found = []
    for point in bullet.getContactPoints(physicsClientId=client):
        _, a, b, link_a, link_b, on_a, on_b, normal_on_b, distance, press, along1, dir1, along2, dir2 = point
        if press <= 0.0 and distance > 0.0:
            continue
        first, second = _part(parts[a], link_a), _part(parts[b], link_b)
        # Bullet's normal points from b to a, and its forces are those on a.
        to_a = np.asarray(normal_on_b, float)
        on_first = along1 * np.asarray(dir1, float) + along2 * np.asarray(dir2, float)
        sign = -1.0
        if (ORDER[first.kind], first.number) > (ORDER[second.kind], second.number):
            first, second, sign = second, first, 1.0
        middle = 0.5 * (np.asarray(on_a, float) + np.asarray(on_b, float)) / scale.length
        found.append(
            Contact(first, second, middle, sign * to_a, press / scale.force, sign * on_first / scale.force)
        )
    return tuple(found)


def _part(part: Part, link: int) -> Part:
    """Link −1 is body 0; the tip link has no shapes."""
    return part._replace(body=link + 1) if part.kind == "arm" else part
