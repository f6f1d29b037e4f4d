"""A scene in PyBullet: arms on a carriage, free objects and floor as multibodies of a scaled world.

The carriage is the free base of every arm, so heavy that nothing on the arm moves it: contacts feel its
velocity, which they do not on a fixed base that is moved by hand. Its own weight is held at every step.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pliant.errors import UserError
from pliant.mechanics.inertia import longest_explicit_step, mass_matrix
from pliant.mechanics.kinematics import ChainGeometry
from pliant.mechanics.rotations import matrix_from_quaternion
from pliant.records.design import Array, MassProperties
from pliant.records.rollout import Inputs
from pliant.records.scene import Arm, Contact, FreeBody, Obstacle, Part, Scene, SceneState
from pliant_plugins.physics.compiled.efforts import efforts
from pliant_plugins.physics.compiled.laws import CompiledLaws
from pliant_plugins.physics.dynamic import ArmsScene, ordered_contact
from pliant_plugins.physics.pybullet.arm import UNLIMITED_VELOCITY, BulletArm, WorldScale, check_size
from pliant_plugins.physics.pybullet.client import Client, quaternion
from pliant_plugins.physics.pybullet.config import PybulletConfig
from pliant_plugins.physics.pybullet.urdf import (
    CollisionWriter,
    chain_tree,
    document,
    floored,
    moving,
    object_tree,
    principal,
)

# A joint beyond this has been thrown around, not bent.
UNBOUNDED = 50.0
# The stable step is looked for again after this much motion.
STABLE_FOR_S = 0.05
# Share of 1 / (fastest rate) that a step takes; explicit efforts are stable up to 2, their damping up to 1.
COURANT = 0.8
# How many times heavier than everything in the scene the carriage is.
CARRIAGE_SHARE = 1e9
ARMS, OBJECTS, FIXED = 2, 4, 8


class BulletObject(NamedTuple):
    """A free body, with base pieces of arms; Bullet's frame is its principal frame at the centre of mass."""

    body: int
    mass: MassProperties
    axes: Array


class BulletScene(ArmsScene):
    """One client in DIRECT mode, explicit torques of the laws at every step."""

    def __init__(self, scene: Scene, config: PybulletConfig) -> None:
        if scene.arms_touch:
            raise UserError(
                "fingers that touch each other need physics 'mujoco'; take it, or leave 'finger_contact' out."
            )
        for number in range(len(scene.objects)):
            check_size(*(ChainGeometry.from_chain(a.chain) for a in scene.arms if a.base_object == number))
        for arm in scene.arms:
            check_size(ChainGeometry.from_chain(arm.chain))
        super().__init__(
            scene, [floored(arm.chain.with_(gravity_m_s2=scene.gravity_m_s2)) for arm in scene.arms]
        )
        self._config = config
        self._laws = [None if chain.terms else CompiledLaws.from_chain(chain) for chain in self._chains]
        self._take()
        self._carriage = np.zeros(3)
        self._pushes: dict[int, tuple[list[float], list[float]]] = {}
        self._stable_s, self._stable_until = math.inf, -math.inf
        self.scale = WorldScale(config.world_scale)
        self._parts: dict[int, Part] = {}
        # By body and link, of arms on objects.
        self._carried: dict[tuple[int, int], Part] = {}
        self.client = Client()
        try:
            self._fill()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        self.client.close()

    @property
    def joints(self) -> Sequence[BulletArm]:
        return self.arms

    def apply(self, inputs: Sequence[Inputs]) -> None:
        super().apply(inputs)
        self._take()

    def _take(self) -> None:
        """Store the loads for the steps: values of the actuators, and whether any external force acts on an arm."""
        pairs = zip(self._statics, self._loads, strict=True)
        self._values = [statics.efforts.values(loads.actuation) for statics, loads in pairs]
        self._pulled = [bool(x.tip_force_n.any() or x.forces or x.cords) for x in self._loads]

    def push(self, index: int, force_n: Array, moment_n_m: Array | None = None) -> None:
        force = self.scale.force * np.array(force_n, float)
        moment = self.scale.torque * (np.zeros(3) if moment_n_m is None else np.array(moment_n_m, float))
        self._pushes[range(len(self.scene.objects))[index]] = (force.tolist(), moment.tolist())

    def step(self, duration_s: float) -> None:
        parts = math.ceil(duration_s / STABLE_FOR_S - 1e-9)
        for _ in range(parts):
            self._go_on(duration_s / parts)

    def snapshot(self) -> SceneState:
        states = [arm.state() for arm in self.arms]
        positions, rotations, velocities = self._object_states()
        return SceneState(
            time_s=self._time_s,
            carriage_m=self._carriage.copy(),
            coordinates=tuple(q for q, _ in states),
            rates=tuple(rates for _, rates in states),
            positions_m=positions,
            rotations=rotations,
            velocities=velocities,
            memories=(None,) * len(states),
            private={
                "bullet": self._world(),
                "stable_step": np.array([self._stable_s, self._stable_until]),
            },
        )

    def restore(self, state: SceneState) -> None:
        self._time_s, self._carriage = state.time_s, state.carriage_m.copy()
        if "bullet" in state.private:
            self._world(state.private["bullet"])
            self._stable_s, self._stable_until = state.private["stable_step"].tolist()
            return
        # A state of another engine: Bullet's contact points and their impulses start from zero.
        self._stable_until = -math.inf
        for arm, chain, given in zip(self.arms, self._chains, self.scene.arms, strict=True):
            if given.base_object is not None:
                continue
            place = self.scale.length * (np.asarray(chain.base_position_m, float) + self._carriage)
            turned = quaternion(chain.base_rotation)
            self.client.resetBasePositionAndOrientation(arm.body, place.tolist(), turned)
        self._move_bases()
        objects = zip(self.objects, state.positions_m, state.rotations, state.velocities, strict=True)
        for one, position, rotation, velocity in objects:
            offset = rotation @ one.mass.com_m
            centre = self.scale.length * (position + offset)
            linear = self.scale.length * (velocity[:3] + np.cross(velocity[3:], offset))
            turned = quaternion(rotation @ one.axes)
            self.client.resetBasePositionAndOrientation(one.body, centre.tolist(), turned)
            self.client.resetBaseVelocity(one.body, linear.tolist(), velocity[3:].tolist())
        for arm, q, rates in zip(self.arms, state.coordinates, state.rates, strict=True):
            arm.place(q, rates)

    def markers(self, arm: int) -> Array:
        moved, turn = self._base_motion(arm)
        if turn is None:
            place = np.asarray(self.client.getBasePositionAndOrientation(self.arms[arm].body)[0])
            place = place / self.scale.length
        else:
            place = moved + turn @ np.asarray(self.scene.arms[arm].chain.base_position_m, float)
        return np.concatenate([place[None], self.arms[arm].moving_markers()])

    def _base_motion(self, arm: int, carriage: Array | None = None) -> tuple[Array, Array | None]:
        """Return how an arm has moved, see `Scene.base_motion`; at this displacement of the carriage, if given."""
        positions, rotations, _ = self._object_states() if self.objects else (np.zeros((0, 3)),) * 3
        return self.scene.base_motion(
            arm, self._carriage if carriage is None else carriage, positions, rotations
        )

    def contacts(self) -> tuple[Contact, ...]:
        contacts = []
        for point in self.client.getContactPoints():
            _, a, b, link_a, link_b, on_a, on_b, normal_on_b, distance, press, *friction = point
            if press <= 0.0 and distance > 0.0:
                continue
            one, other = (self._part(body, link) for body, link in ((a, link_a), (b, link_b)))
            # Bullet's normal points from b to a, and its forces are those on a.
            along1, dir1, along2, dir2 = friction
            on_one = along1 * np.asarray(dir1, float) + along2 * np.asarray(dir2, float)
            middle = 0.5 * (np.asarray(on_a, float) + np.asarray(on_b, float)) / self.scale.length
            normal, force = -1.0 * np.asarray(normal_on_b, float), -1.0 * on_one / self.scale.force
            press_n, order = press / self.scale.force, "arm object obstacle floor"
            apart = distance / self.scale.length
            contacts.append(ordered_contact(one, other, middle, normal, press_n, force, order, apart))
        return tuple(contacts)

    def _part(self, body: int, link: int) -> Part:
        """Link −1 is body 0, or an object with the base pieces of its arms; the tip link has no shapes."""
        part = self._carried.get((body, link), self._parts[body])
        return part._replace(body=link + 1) if part.kind == "arm" and part.body == 0 else part

    def _go_on(self, duration_s: float) -> None:
        """Advance by less than the time for which a stable step is trusted."""
        if self._time_s >= self._stable_until:
            self._stable_s = self._stable_step()
            self._stable_until = self._time_s + STABLE_FOR_S
        n_steps = max(1, math.ceil(duration_s / min(self._config.timestep_s, self._stable_s) - 1e-9))
        self.client.setTimeStep(duration_s / n_steps)
        # One number for all clients of the process.
        self.client.setPhysicsEngineParameter(contactBreakingThreshold=self._config.contact_memory)
        self._move_bases()
        client, origin = self.client, [0.0, 0.0, 0.0]
        for k in range(n_steps):
            self._drive(self._carriage + self._velocity * (duration_s * k / n_steps))
            for body, hold in self._holds:
                client.applyExternalForce(body, -1, hold, origin, client.LINK_FRAME)
            client.stepSimulation()
        self._carriage = self._carriage + self._velocity * duration_s
        self._time_s += duration_s
        self._check_bounds()

    def _move_bases(self) -> None:
        velocity = (self.scale.length * self._velocity).tolist()
        for body, _ in self._holds:
            self.client.resetBaseVelocity(body, velocity, [0.0, 0.0, 0.0])

    def _drive(self, carriage: Array) -> None:
        """Apply torques and forces of the next step."""
        states = [arm.state() for arm in self.arms]
        for k, (arm, (q, rates)) in enumerate(zip(self.arms, states, strict=True)):
            loads, effort = self._loads[k], self._effort(k, q)
            if loads.moment_n_m:
                effort[:, self._statics[k].geometry.main] -= loads.moment_n_m
            arm.drive(effort - self._config.joint_damping * rates, q)
            if self._pulled[k]:
                arm.pull_loads(self._statics[k], loads, q, self._base_motion(k, carriage))
        for index, (force, moment) in self._pushes.items():  # at the centre of mass
            body, frame = self.objects[index].body, self.client.WORLD_FRAME
            centre = self.client.getBasePositionAndOrientation(body)[0]
            self.client.applyExternalForce(body, -1, force, centre, frame)
            self.client.applyExternalTorque(body, -1, moment, frame)

    def _effort(self, k: int, q: Array) -> Array:
        """Return (n, a) efforts of an arm's laws, without end moment."""
        laws, values, (n, a) = self._laws[k], self._values[k], q.shape
        if laws is None:
            return self._statics[k].efforts.evaluate(q, self._loads[k].actuation).tau
        tau = np.empty((n, a))
        efforts(laws.arrays, q, values, tau, np.empty((len(values), n, a)), np.empty((n, a, a)))
        return tau

    def _stable_step(self) -> float:
        """Return longest step at which explicit efforts and damping of every arm are stable from the present state."""
        longest = math.inf
        arms = zip(self._chains, self.arms, self._statics, self._loads, strict=True)
        for chain, arm, statics, loads in arms:
            stiffness = statics.balance(arm.q, loads).stiffness
            mass, damping = mass_matrix(chain, arm.q), self._config.joint_damping
            longest = min(longest, longest_explicit_step(mass, stiffness, damping, COURANT))
        return longest

    def _check_bounds(self) -> None:
        def complain(what: str, advice: str) -> None:
            raise UserError(
                f"{what} moves without bounds at {self._time_s:.3g} s in physics 'pybullet': take a smaller "
                f"'timestep', {advice}"
            )

        for number, arm in enumerate(self.arms):
            q = arm.q
            if not np.isfinite(q).all() or np.abs(q).max() > UNBOUNDED:
                complain(f"arm {number} of the scene", "more 'joint_damping', or check the law")
        for one, place in zip(self.scene.objects, self._object_states()[0], strict=True):
            if not np.isfinite(place).all():
                complain(f"object '{one.name}'", "or place it without overlap")

    def _object_states(self) -> tuple[Array, Array, Array]:
        """Return positions_m (k, 3), rotations (k, 3, 3) and velocities (k, 6) of the objects' frames."""
        count = len(self.objects)
        positions, rotations = np.empty((count, 3)), np.empty((count, 3, 3))
        velocities = np.empty((count, 6))
        for k, one in enumerate(self.objects):
            centre, turned = self.client.getBasePositionAndOrientation(one.body)
            linear, angular = self.client.getBaseVelocity(one.body)
            rotations[k] = matrix_from_quaternion(np.roll(turned, 1)) @ one.axes.T
            offset = rotations[k] @ one.mass.com_m
            positions[k] = np.asarray(centre) / self.scale.length - offset
            velocities[k, :3] = np.asarray(linear) / self.scale.length - np.cross(angular, offset)
            velocities[k, 3:] = angular
        return positions, rotations, velocities

    def _world(self, state: Array | None = None) -> Array:
        """Return Bullet's world, with contact points and impulses, as bytes; set it first if given."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "world.bullet"
            if state is not None:
                path.write_bytes(np.asarray(state, np.uint8).tobytes())
                self.client.restoreState(fileName=str(path))
                return state
            self.client.saveBullet(str(path))
            return np.frombuffer(path.read_bytes(), np.uint8)

    # -- the bodies of the world ----------------------------------------------------------------------------

    def _fill(self) -> None:
        """Load arms, objects and floor."""
        scene, client = self.scene, self.client
        # Gravity acts on every body, on the carriage too.
        gravity = self.scale.length * np.asarray(scene.gravity_m_s2, float)
        client.setGravity(*gravity.tolist())
        client.setPhysicsEngineParameter(numSolverIterations=self._config.solver_iterations)
        arms = sum(b.mass_kg for arm in scene.arms for b in arm.chain.bodies)
        payloads = sum(arm.chain.payload_kg for arm in scene.arms)
        total = arms + payloads + sum(one.mass.mass_kg for one in scene.objects) + 1e-3
        carriage_kg = CARRIAGE_SHARE * self.scale.mass * total
        with tempfile.TemporaryDirectory() as folder:
            writer = CollisionWriter(Path(folder))
            loaded: dict[int, BulletArm] = {}
            for k, arm in enumerate(scene.arms):
                if arm.base_object is None:
                    loaded[k] = self._arm(k, arm, carriage_kg, writer)
            self.objects = [self._object(k, one, writer, loaded) for k, one in enumerate(scene.objects)]
            self.arms = [loaded[k] for k in range(len(scene.arms))]
            for k, obstacle in enumerate(scene.obstacles):
                self._obstacle(k, obstacle, writer)
        if scene.floor_m is not None:
            plane = client.createCollisionShape(client.GEOM_PLANE)
            place = [0.0, 0.0, self.scale.length * scene.floor_m]
            body = client.createMultiBody(0.0, plane, basePosition=place)
            self._add(body, Part("floor"), [-1], scene.floor_friction, FIXED, OBJECTS | ARMS)
        # In the frame of each base, which does not turn: held there, no rounding of places enters.
        weight = carriage_kg * gravity
        self._holds = [
            (loaded[k].body, (-arm.chain.base_rotation.T @ weight).tolist())
            for k, arm in enumerate(scene.arms)
            if arm.base_object is None
        ]

    def _arm(self, number: int, arm: Arm, carriage_kg: float, writer: CollisionWriter) -> BulletArm:
        chain = self.scale.chain(floored(arm.chain))
        base = MassProperties(carriage_kg, np.zeros(3), carriage_kg * np.eye(3))
        body = self._load(
            document(chain_tree(chain, base, writer)), chain.base_position_m, chain.base_rotation, writer
        )
        links = range(-1, chain.n_joints + 1)
        self._add(body, Part("arm", number), links, arm.friction, ARMS, OBJECTS | FIXED)
        return BulletArm(self.client, body, chain, self.scale)

    def _object(
        self, number: int, given: FreeBody, writer: CollisionWriter, loaded: dict[int, BulletArm]
    ) -> BulletObject:
        """Load a free body with the arms that it carries, and add these to `loaded`."""
        mass, shapes, chains = given.mass, list(given.shapes), {}
        for k, arm in enumerate(self.scene.arms):
            if arm.base_object == number:
                position, rotation = self.scene.base_on_object(k)
                chain = floored(arm.chain).with_(base_position_m=position, base_rotation=rotation)
                mass = mass.joined(arm.chain.bodies[0].rotated(rotation).shifted(position))
                shapes += [shape.placed(rotation, position) for shape in (chain.shapes or ((),))[0]]
                chains[k] = self.scale.chain(chain)
        piece = self.scale.piece(moving(mass))
        root = object_tree(piece, [self.scale.shape(shape) for shape in shapes], chains, writer)
        place = self.scale.length * np.asarray(given.position_m, float)
        body = self._load(document(root), place, given.rotation, writer)
        self._add(body, Part("object", number), [-1], given.friction, OBJECTS, ARMS | OBJECTS | FIXED)
        self.client.set_dynamics(body, [-1], linearDamping=0.0, angularDamping=0.0)
        self.client.set_dynamics(body, [-1], maxJointVelocity=UNLIMITED_VELOCITY)
        names = [self.client.getJointInfo(body, k)[1].decode() for k in range(self.client.getNumJoints(body))]
        for k, chain in chains.items():
            first, arm = names.index(f"arm_{k}_joint_1"), self.scene.arms[k]
            links = range(first, first + chain.n_joints + 1)
            self._set_contact(body, links, arm.friction, ARMS, OBJECTS | FIXED)
            self._carried |= {(body, link): Part("arm", k, link - first + 1) for link in links}
            loaded[k] = BulletArm(self.client, body, chain, self.scale, first)
        return BulletObject(body, mass, principal(moving(piece))[1])

    def _obstacle(self, number: int, given: Obstacle, writer: CollisionWriter) -> None:
        shapes = [self.scale.shape(shape) for shape in given.shapes]
        unmoved = MassProperties(1.0, np.zeros(3), np.eye(3))
        urdf = document(object_tree(unmoved, shapes, {}, writer))
        body = self._load(urdf, np.zeros(3), np.eye(3), writer, fixed=True)
        self._add(body, Part("obstacle", number), [-1], given.friction, FIXED, ARMS | OBJECTS)

    def _load(
        self, urdf: str, place: Array, rotation: Array, writer: CollisionWriter, fixed: bool = False
    ) -> int:
        path = writer.folder / f"body_{len(self._parts)}.urdf"
        return self.client.load(path, urdf, place, rotation, fixed=fixed)

    def _add(
        self, body: int, part: Part, links: Iterable[int], friction: float, group: int, mask: int
    ) -> None:
        """Record a body, and set friction and collision pairs of its links."""
        self._parts[body] = part
        self._set_contact(body, links, friction, group, mask)

    def _set_contact(self, body: int, links: Iterable[int], friction: float, group: int, mask: int) -> None:
        """Set friction and collision pairs. Bullet multiplies coefficients, as the scene's rule does."""
        none = {"rollingFriction": 0.0, "spinningFriction": 0.0, "restitution": 0.0}
        for link in links:
            # In one call with other settings friction would stay at 0.5.
            self.client.set_dynamics(body, [link], lateralFriction=friction, **none)
            self.client.set_dynamics(body, [link], frictionAnchor=self._config.friction_anchors)
            self.client.setCollisionFilterGroupMask(body, link, group, mask)
            kept = self.client.getDynamicsInfo(body, link)[1]
            assert abs(kept - friction) < 1e-9, f"Bullet kept a friction of {kept} instead of {friction}"
