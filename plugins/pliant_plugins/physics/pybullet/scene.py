"""A scene in PyBullet: arms on a carriage, free objects, a floor."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.physics import SceneSimulation
from pliant.mechanics.efforts import JointEfforts
from pliant.mechanics.inertia import longest_explicit_step, mass_matrix
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.rollout import Inputs, OutsideDomain
from pliant.records.scene import Contact, Scene, SceneState
from pliant_plugins.physics.compiled.efforts import efforts
from pliant_plugins.physics.compiled.laws import CompiledLaws
from pliant_plugins.physics.dynamic import arms_outside_domain, loads_of_arms
from pliant_plugins.physics.pybullet.config import PybulletConfig
from pliant_plugins.physics.pybullet.urdf import floored
from pliant_plugins.physics.pybullet.world import BulletWorld, read_contacts

# A joint beyond this has been thrown around, not bent.
UNBOUNDED = 50.0
# The stable step is looked for again after this much motion.
STABLE_FOR_S = 0.05
# Share of 1 / (fastest rate) that a step takes; explicit efforts are stable up to 2, their damping up to 1.
COURANT = 0.8


class BulletScene(SceneSimulation):
    """Explicit torques of the laws at every step; all arms' laws in one call."""

    def __init__(self, scene: Scene, config: PybulletConfig) -> None:
        self.scene = scene
        self._config = config
        chains = [arm.chain.with_(gravity_m_s2=scene.gravity_m_s2) for arm in scene.arms]
        self._chains = [floored(chain) for chain in chains]
        self._statics = [ChainStatics(chain) for chain in self._chains]
        self._efforts = SceneEfforts(self._chains)
        self._world = BulletWorld(scene, config)
        self._time_s, self._carriage = 0.0, np.zeros(3)
        self._velocity = np.zeros(3)
        self._pushes: dict[int, tuple[Array, Array]] = {}
        self._loads: list[Loads] = []
        self._pulled: list[bool] = []
        self._stable_s, self._stable_until = math.inf, -math.inf
        self._take([Loads.unactuated(chain) for chain in self._chains])

    def apply(self, inputs: Sequence[Inputs]) -> None:
        self._take(loads_of_arms(self.scene, self._chains, inputs))

    def carry(self, velocity_m_s: Array) -> None:
        self._velocity = np.array(velocity_m_s, float)

    def push(self, index: int, force_n: Array, moment_n_m: Array | None = None) -> None:
        moment = np.zeros(3) if moment_n_m is None else np.array(moment_n_m, float)
        self._pushes[range(len(self.scene.objects))[index]] = (np.array(force_n, float), moment)

    def step(self, duration_s: float) -> None:
        parts = math.ceil(duration_s / STABLE_FOR_S - 1e-9)
        for _ in range(parts):
            self._go_on(duration_s / parts)

    def snapshot(self) -> SceneState:
        states = [arm.state() for arm in self._world.arms]
        positions, rotations, velocities = self._world.object_states()
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
                "bullet": self._saved(),
                "stable_step": np.array([self._stable_s, self._stable_until]),
            },
        )

    def restore(self, state: SceneState) -> None:
        self._time_s, self._carriage = state.time_s, state.carriage_m.copy()
        if "bullet" in state.private:
            self._load(state.private["bullet"])
            self._stable_s, self._stable_until = state.private["stable_step"].tolist()
            return
        # A state of another engine: Bullet's contact points and their impulses begin anew.
        self._stable_until = -math.inf
        self._world.place_bases(self.scene, self._carriage)
        self._world.move_bases(self._velocity)
        for arm, q, rates in zip(self._world.arms, state.coordinates, state.rates, strict=True):
            arm.place(q, rates)
        objects = zip(state.positions_m, state.rotations, state.velocities, strict=True)
        for k, (position, rotation, velocity) in enumerate(objects):
            self._world.place_object(k, position, rotation, velocity)

    def markers(self, arm: int) -> Array:
        base = self._world.bases_m()[arm]
        return np.concatenate([base[None], self._world.arms[arm].moving_markers()])

    def contacts(self) -> tuple[Contact, ...]:
        world = self._world
        return read_contacts(world.bullet, world.client, world.parts, world.scale)

    def outside_domain(self) -> tuple[OutsideDomain, ...]:
        coordinates = [arm.state()[0] for arm in self._world.arms]
        return arms_outside_domain(self._statics, coordinates, self._loads, self._time_s)

    def close(self) -> None:
        self._world.close()

    def _go_on(self, duration_s: float) -> None:
        """Advance by less than the time for which a stable step is trusted."""
        if self._time_s >= self._stable_until:
            self._stable_s = self._stable_step()
            self._stable_until = self._time_s + STABLE_FOR_S
        n_steps = max(1, math.ceil(duration_s / min(self._config.timestep_s, self._stable_s) - 1e-9))
        self._world.set_timestep(duration_s / n_steps)
        self._world.move_bases(self._velocity)
        for k in range(n_steps):
            self._drive(self._carriage + self._velocity * (duration_s * k / n_steps))
            self._world.advance()
        self._carriage = self._carriage + self._velocity * duration_s
        self._time_s += duration_s
        self._check_bounds()

    def _take(self, loads: list[Loads]) -> None:
        self._loads = loads
        self._pulled = [bool(one.tip_force_n.any() or one.forces or one.cords) for one in loads]
        self._efforts.under(loads)

    def _drive(self, carriage: Array) -> None:
        """Torques and forces of the next step."""
        states = [arm.state() for arm in self._world.arms]
        efforts = self._efforts.evaluate([q for q, _ in states])
        damping = self._config.joint_damping
        for k, (arm, (q, rates), effort) in enumerate(zip(self._world.arms, states, efforts, strict=True)):
            loads = self._loads[k]
            if loads.moment_n_m:
                effort[:, self._statics[k].geometry.main] -= loads.moment_n_m
            arm.drive(effort - damping * rates, q)
            if self._pulled[k]:
                self._pull(k, q, carriage)
        for index, (force, moment) in self._pushes.items():
            self._world.push(index, force, moment)

    def _pull(self, k: int, q: Array, carriage: Array) -> None:
        """Tip force, point forces and cords of an arm."""
        loads, arm = self._loads[k], self._world.arms[k]
        if loads.tip_force_n.any():
            arm.pull(arm.tip, loads.tip_force_n, arm.moving_markers()[-1])
        if loads.forces or loads.cords:
            pose = self._statics[k].geometry.forward(q)
            there = replace(pose, origins=pose.origins + carriage)
            for acting in self._statics[k].acting(there, loads):
                if acting.body:
                    arm.pull(acting.body - 1, acting.force_n, acting.point_m)

    def _stable_step(self) -> float:
        """Longest step at which explicit efforts and damping of every arm are stable from the present state."""
        longest = math.inf
        for chain, arm, statics, loads in zip(
            self._chains, self._world.arms, self._statics, self._loads, strict=True
        ):
            q = arm.state()[0]
            mass = mass_matrix(chain, q)
            stiffness = statics.balance(q, loads).stiffness
            longest = min(
                longest, longest_explicit_step(mass, stiffness, self._config.joint_damping, COURANT)
            )
        return longest

    def _check_bounds(self) -> None:
        for number, arm in enumerate(self._world.arms):
            q = arm.state()[0]
            if not np.isfinite(q).all() or np.abs(q).max() > UNBOUNDED:
                raise UserError(
                    f"arm {number} of the scene moves without bounds at {self._time_s:.3g} s in physics 'pybullet': "
                    "take a smaller 'timestep', more 'joint_damping', or check the law"
                )
        for number, place in enumerate(self._world.object_states()[0]):
            if not np.isfinite(place).all():
                name = self.scene.objects[number].name
                raise UserError(
                    f"object '{name}' moves without bounds at {self._time_s:.3g} s in physics 'pybullet': "
                    "take a smaller 'timestep', or place it without overlap"
                )

    def _saved(self) -> Array:
        """Bullet's whole world, contact points with their impulses among it, as numbers of one byte each."""
        world = self._world
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "world.bullet"
            world.bullet.saveBullet(str(path), physicsClientId=world.client)
            return np.frombuffer(path.read_bytes(), np.uint8)

    def _load(self, saved: Array) -> None:
        world = self._world
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "world.bullet"
            path.write_bytes(np.asarray(saved, np.uint8).tobytes())
            world.bullet.restoreState(fileName=str(path), physicsClientId=world.client)


class SceneEfforts:
    """Evaluates the laws of all arms at once: arms under the same actuation are one list of joints.

    Coordinates of an arm have shape (n, a).
    """

    def __init__(self, chains: Sequence[ChainModel]) -> None:
        self._chains = chains
        self._joined: dict[tuple[int, ...], _Joined] = {}
        self._groups: list[tuple[tuple[int, ...], Loads]] = []

    def under(self, loads: Sequence[Loads]) -> None:
        """Actuation and end moments of every arm from now on."""
        groups: list[tuple[list[int], Loads]] = []
        for number, load in enumerate(loads):
            for members, theirs in groups:
                if self._alike(members[0], number) and theirs.actuation == load.actuation:
                    members.append(number)
                    break
            else:
                groups.append(([number], load))
        self._groups = [(tuple(members), load) for members, load in groups]
        for key, _ in self._groups:
            if key not in self._joined:
                self._joined[key] = _Joined.of([self._chains[k] for k in key])

    def evaluate(self, coordinates: Sequence[Array]) -> list[Array]:
        """(n, a) efforts of the laws of each arm, without end moments."""
        found: list[Array] = [np.empty(0)] * len(coordinates)
        for members, load in self._groups:
            joined = self._joined[members]
            tau = joined.evaluate(np.concatenate([coordinates[k] for k in members]), load)
            for k, joints in zip(members, joined.joints, strict=True):
                found[k] = tau[joints]
        return found

    def _alike(self, one: int, other: int) -> bool:
        a, b = self._chains[one], self._chains[other]
        same_joints = a.laws[0].joint == b.laws[0].joint and a.axes == b.axes
        return same_joints and a.actuators == b.actuators and a.terms == b.terms


@dataclass(frozen=True, eq=False)
class _Joined:
    """Joints of several arms as one list; `joints` are those of each arm in it."""

    laws: CompiledLaws | None
    efforts: JointEfforts
    joints: tuple[slice, ...]

    @staticmethod
    def of(chains: Sequence[ChainModel]) -> _Joined:
        laws = list(dict.fromkeys(law for chain in chains for law in chain.laws))
        joints = tuple(
            replace(joint, law=laws.index(chain.laws[joint.law]))
            for chain in chains
            for joint in chain.joints
        )
        joined = chains[0].with_(joints=joints, laws=tuple(laws))
        compiled = None if joined.terms else CompiledLaws.of(joined)
        ends = np.cumsum([0, *(chain.n_joints for chain in chains)]).tolist()
        spans = tuple(slice(first, last) for first, last in pairwise(ends))
        return _Joined(compiled, JointEfforts(joined), spans)

    def evaluate(self, q: Array, load: Loads) -> Array:
        if self.laws is None:
            return self.efforts.evaluate(q, load.actuation).tau
        n, a = q.shape
        values = self.efforts.values(load.actuation)
        tau = np.empty((n, a))
        efforts(self.laws.arrays, q, values, tau, np.empty((len(values), n, a)), np.empty((n, a, a)))
        return tau
