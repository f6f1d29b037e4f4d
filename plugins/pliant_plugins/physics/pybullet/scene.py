"""A scene in PyBullet: arms on a carriage, free objects, a floor."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.physics import SceneSimulation
from pliant.mechanics.inertia import longest_explicit_step, mass_matrix
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.design import Array
from pliant.records.rollout import Inputs, OutsideDomain
from pliant.records.scene import Contact, Scene, SceneState
from pliant_plugins.physics.pybullet.config import PybulletConfig
from pliant_plugins.physics.pybullet.contacts import read_contacts
from pliant_plugins.physics.pybullet.scene_efforts import SceneEfforts
from pliant_plugins.physics.pybullet.urdf import floored
from pliant_plugins.physics.pybullet.world import BulletWorld

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
        if len(inputs) != len(self._chains):
            raise UserError(f"the scene has {len(self._chains)} arms and was given inputs of {len(inputs)}")
        for statics, given in zip(self._statics, inputs, strict=True):
            statics.efforts.values(given.actuation)
        self._take([Loads.of(chain, given) for chain, given in zip(self._chains, inputs, strict=True)])

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
        found: list[OutsideDomain] = []
        before = 0
        for arm, statics, loads in zip(self._world.arms, self._statics, self._loads, strict=True):
            entries = statics.efforts.outside_domain(arm.state()[0], loads.actuation, self._time_s)
            found += [replace(entry, module=entry.module + before) for entry in entries]
            before += statics.geometry.n_joints
        return tuple(found)

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
