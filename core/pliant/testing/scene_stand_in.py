"""A scene without contact, for checks of tasks: arms in equilibrium on a moving carriage, objects where they are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pliant.interfaces.physics import SceneSimulation
from pliant.records.design import Array
from pliant.records.rollout import Inputs, OutsideDomain
from pliant.records.scene import Contact, Scene, SceneState
from pliant.testing.stand_ins import StandIn, StandInConfig, StandInSimulation


class StandInScene(SceneSimulation):
    """Nothing touches: what a task does with a scene can be seen, not what contact does."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        build = StandIn(StandInConfig()).build
        gravity = scene.gravity_m_s2
        self.arms: list[StandInSimulation] = [build(a.chain.with_(gravity_m_s2=gravity)) for a in scene.arms]
        self.time_s = 0.0
        self.carriage_m, self.velocity_m_s = np.zeros(3), np.zeros(3)

    def apply(self, inputs: Sequence[Inputs]) -> None:
        for arm, given in zip(self.arms, inputs, strict=True):
            arm.apply(given)

    def carry(self, velocity_m_s: Array) -> None:
        self.velocity_m_s = np.array(velocity_m_s, float)

    def push(self, index: int, force_n: Array, moment_n_m: Array | None = None) -> None:
        pass

    def step(self, duration_s: float) -> None:
        self.time_s += duration_s
        self.carriage_m = self.carriage_m + duration_s * self.velocity_m_s
        for arm in self.arms:
            arm.step(duration_s)

    def snapshot(self) -> SceneState:
        objects = self.scene.objects
        return SceneState(
            time_s=self.time_s,
            carriage_m=self.carriage_m,
            coordinates=tuple(arm.q.copy() for arm in self.arms),
            rates=tuple(np.zeros_like(arm.q) for arm in self.arms),
            positions_m=np.array([body.position_m for body in objects], float).reshape(-1, 3),
            rotations=np.array([body.rotation for body in objects], float).reshape(-1, 3, 3),
            velocities=np.zeros((len(objects), 6)),
        )

    def restore(self, state: SceneState) -> None:
        self.time_s, self.carriage_m = state.time_s, state.carriage_m
        for arm, q in zip(self.arms, state.coordinates, strict=True):
            arm.q = q.copy()

    def markers(self, arm: int) -> Array:
        return self.arms[arm].markers() + self.carriage_m

    def contacts(self) -> tuple[Contact, ...]:
        return ()

    def outside_domain(self) -> tuple[OutsideDomain, ...]:
        return ()
