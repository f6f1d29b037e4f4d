"""Chains in equilibrium among fixed obstacles: one chain, for inverse statics, and scenes without free objects.

Contact is without friction, whose equilibria would depend on the path.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.simulation import SceneSimulation
from pliant.mechanics.contact_statics import ContactStatics
from pliant.mechanics.signed_distance import Box, Solid, solid_from_shape
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.rollout import Equilibrium, Inputs, OutsideDomain
from pliant.records.scene import Contact, Part, Scene, SceneState
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig
from pliant_plugins.physics.quasistatic.simulation import QuasistaticSimulation

# Of one axis point (`contact_statics.POINTS` per capsule): 0.1 N presses a single point 5 µm deep.
CONTACT_N_M = 2e4
# The floor is a box of these half edges.
FLOOR_HALF_M = np.array([100.0, 100.0, 10.0])


class ChainAmongObstacles(QuasistaticSimulation):
    """A chain that is always in equilibrium with its loads and with the obstacles that it presses on."""

    def __init__(self, chain: ChainModel, solids: Sequence[Solid], config: QuasistaticConfig) -> None:
        super().__init__(chain, config)
        self._solids = tuple(solids)

    @cached_property
    def _statics(self) -> ContactStatics:
        return ContactStatics(self.chain, self._solids, CONTACT_N_M)

    def reach(self, duration_s: float) -> Equilibrium:
        """Advance by a step and return the equilibrium at its end."""
        self._time_s += duration_s
        return self._reach(duration_s)

    def contacts(self, arm: int, bodies: Sequence[Part]) -> tuple[Contact, ...]:
        """Return the present contacts as those of arm number `arm` with these bodies, one for each solid."""
        statics, found = self._statics, []
        for press in statics.presses(statics.geometry.forward(self._q)):
            radius = float(statics.points.radius_m[press.point])
            place = press.position_m - (radius - 0.5 * press.depth_m) * press.normal
            first = Part("arm", arm, int(statics.points.body[press.point]))
            found.append(
                Contact(
                    first,
                    bodies[press.obstacle],
                    place,
                    -press.normal,
                    press.force_n,
                    np.zeros(3),
                    press.depth_m,
                )
            )
        return tuple(found)


class StaticScene(SceneSimulation):
    """Arms that are in equilibrium after every step, on a moving carriage, among obstacles and over a floor."""

    def __init__(self, scene: Scene, config: QuasistaticConfig) -> None:
        """Build the arms.

        Raises:
            UserError: free objects, arms that touch each other, or friction.
        """
        self.scene = scene
        if scene.objects or scene.arms_touch:
            raise UserError(
                "physics 'quasistatic' has contact with fixed obstacles only, and this scene has free objects or arms "
                "that touch each other; use 'mujoco'."
            )
        fixed = [one.friction for one in scene.obstacles]
        fixed += [] if scene.floor_m is None else [scene.floor_friction]
        if any(arm.friction * friction for arm in scene.arms for friction in fixed):
            raise UserError(
                "physics 'quasistatic' has no friction, and the task has a coefficient above 0; set the task's "
                "friction to 0, or use 'mujoco' or 'pybullet'."
            )
        self._parts = [Part("obstacle", k) for k, one in enumerate(scene.obstacles) for _ in one.shapes]
        solids: list[Solid] = [solid_from_shape(s) for one in scene.obstacles for s in one.shapes]
        if scene.floor_m is not None:
            centre = np.array([0.0, 0.0, scene.floor_m - FLOOR_HALF_M[2]])
            solids.append(Box(centre, np.eye(3), FLOOR_HALF_M))
            self._parts.append(Part("floor"))
        gravity = np.asarray(scene.gravity_m_s2, float)
        chains = [arm.chain.with_(gravity_m_s2=gravity) for arm in scene.arms]
        self._arms = [ChainAmongObstacles(chain, solids, config) for chain in chains]
        self._settled: list[Equilibrium | None] = [None] * len(chains)
        self._time_s = 0.0

    def apply(self, inputs: Sequence[Inputs]) -> None:
        for arm, given in zip(self._arms, inputs, strict=True):
            arm.apply(given)

    def carry(self, velocity_m_s: Array) -> None:
        if np.any(velocity_m_s):
            raise UserError("physics 'quasistatic' has no moving carriage; use 'mujoco' or 'pybullet'.")

    def push(self, index: int, force_n: Array, moment_n_m: Array | None = None) -> None:
        raise UserError("physics 'quasistatic' has no free objects to push; use 'mujoco' or 'pybullet'.")

    def step(self, duration_s: float) -> None:
        self._time_s += duration_s
        self._settled = [arm.reach(duration_s) for arm in self._arms]

    def snapshot(self) -> SceneState:
        coordinates = tuple(arm.snapshot().position for arm in self._arms)
        none = np.zeros((0, 3))
        return SceneState(
            time_s=self._time_s,
            carriage_m=np.zeros(3),
            coordinates=coordinates,
            rates=tuple(np.zeros_like(q) for q in coordinates),
            positions_m=none,
            rotations=np.zeros((0, 3, 3)),
            velocities=np.zeros((0, 6)),
            memories=tuple(arm.snapshot().memory for arm in self._arms),
        )

    def restore(self, state: SceneState) -> None:
        self._time_s = state.time_s
        memories = state.memories or (None,) * len(self._arms)
        for arm, q, memory in zip(self._arms, state.coordinates, memories, strict=True):
            arm.restore(replace(arm.snapshot(), time_s=state.time_s, position=q, memory=memory))

    def markers(self, arm: int) -> Array:
        return self._arms[arm].markers()

    def contacts(self) -> tuple[Contact, ...]:
        every = (arm.contacts(k, self._parts) for k, arm in enumerate(self._arms))
        return tuple(contact for contacts in every for contact in contacts)

    def outside_domain(self) -> tuple[OutsideDomain, ...]:
        entries, before = list[OutsideDomain](), 0
        for arm, settled in zip(self._arms, self._settled, strict=True):
            outside = settled.outside_domain if settled is not None else ()
            entries += [replace(entry, module=entry.module + before) for entry in outside]
            before += arm.chain.n_joints
        return tuple(entries)

    def pose(self, arm: int) -> Equilibrium:
        """Return the equilibrium of an arm, with its residual, contact forces included."""
        settled = self._settled[arm]
        return super().pose(arm) if settled is None else settled
