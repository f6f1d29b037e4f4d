"""``gymnasium.make("pliant/Grasp-v0")``"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from pliant.errors import UserError
from pliant.pipeline.motion import with_surfaces
from pliant.records.design import Array
from pliant.records.rollout import Inputs
from pliant.records.scene import Scene, SceneFrames
from pliant_plugins.envs.base import OBSERVED
from pliant_plugins.envs.chain_env import CHANGE_COST, RATE_S, points_option
from pliant_plugins.envs.scene_env import SceneEnv
from pliant_plugins.tasks.grasp.metrics import HELD_SHARE, Grip
from pliant_plugins.tasks.grasp.task import Grasp

FASTEST_M_S = 0.06
TOUCH_REWARD, GAP_COST, LIFT_REWARD, SLIP_COST = 0.5, 0.5, 2.0, 0.5
LOST_M = 0.15  # sideways from the start: the object rolled away


class GraspEnv(SceneEnv):
    """Lower the fingers over an object, actuate them, lift it.

    Actions: the share of each input's highest value (−1 for none), the same for all fingers, then the carriage's
    vertical velocity in 60 mm/s. The carriage goes from the lowered place (−`lower_height`) to `lift_height` above
    the start.

    Observation: per finger joint coordinates (rad), then their changes in 0.1 s; height of the carriage over its
    start and rise of the object in lift heights; object from the gripper's middle (3) and its change in 0.1 s (3)
    in finger lengths; sums of normal and friction forces of the fingers in object weights; share of the finger
    bodies that touch; shares of the actuation.

    Reward per step: 0.5 · (touching share) − 0.5 · (height of the carriage over the lowered place, in lower
    heights, until something touches) + 2 · (rise in lift heights, 0 to 1) − 0.5 · slip − 0.01 · (change of the
    actuation)². Slip is the part of the carriage's rise from its lowest place that the object did not follow.

    Each episode draws the object's place and the pressure's error within the task's noise; friction stays.
    Option `placement_m`: (x, y, 0) instead.
    `info`: `rise_m`, `carriage_m`, `normal_n`, `friction_n`, `touching_share`, `slip_ratio`, `is_success` (up by
    half the lift). An object that rolls 150 mm away ends the episode at −0.5 for each remaining step.

    The study has a `grasp` task; by default three bellow fingers with a stated law and an egg.
    """

    default_study: ClassVar[str] = "grasp"
    default_episode_s: ClassVar[float] = 6.0
    option_names: ClassVar[tuple[str, ...]] = ("placement_m",)
    task_class: ClassVar[type] = Grasp

    def _build(self) -> None:
        self._open_scene()
        self.config = self.task.config
        self._rest = self.simulation.snapshot()
        self._length_m = self.chain.length_m
        body = self.task.target.body
        self._weight_n = body.mass.mass_kg * float(np.linalg.norm(self.scene.gravity_m_s2) or 9.81)
        self._offset = 0.0
        coordinates = sum(q.size for q in self._rest.coordinates)
        self._set_spaces(len(self.inputs) + 1, 2 * coordinates + 11 + len(self.inputs))
        self._state, self._grip, self._lowest = self._rest, Grip(0.0, 0.0, 0.0), 0.0

    def _begin(self, options: dict[str, Any]) -> None:
        reach = self.config.noise.placement * self.task.target.radius_m * np.sqrt(self.np_random.uniform())
        angle = self.np_random.uniform(0.0, 2 * np.pi)
        place = reach * np.array([np.cos(angle), np.sin(angle), 0.0])
        self._offset = self.config.noise.pressure_pa * float(self.np_random.uniform(-1.0, 1.0))
        given = points_option(options, "placement_m")
        positions = self._rest.positions_m.copy()
        positions[0, :2] += (place if given is None else given)[:2]
        # The engine's memory belongs to the old position.
        self.simulation.restore(replace(self._rest, positions_m=positions, private={}))
        self.simulation.apply([self._inputs()] * len(self.scene.arms))
        self.simulation.carry(np.zeros(3))
        self._state, self._grip, self._lowest = self.simulation.snapshot(), Grip(0.0, 0.0, 0.0), 0.0

    def _advance(self, action: Array) -> bool:
        self._before, self._share = self._share, 0.5 * (action[:-1] + 1.0)
        height = self._carriage_m
        reach = np.array([-self.config.lower_height_m, self.config.lift_height_m]) - height
        speed = float(np.clip(FASTEST_M_S * action[-1], *(reach / self.control_s)))
        self.simulation.apply([self._inputs()] * len(self.scene.arms))
        self.simulation.carry(np.array([0.0, 0.0, speed]))
        try:
            self.simulation.step(self.control_s)
        except UserError:
            return False
        self._see()
        return True

    def _see(self) -> None:
        self._state = self.simulation.snapshot()
        self._grip = Grip.from_contacts(self.simulation.contacts(), self.scene)
        self._lowest = min(self._lowest, self._carriage_m)

    def _observed(self) -> OBSERVED:
        state, grip, lift = self._state, self._grip, self.config.lift_height_m
        middle = np.mean([arm.chain.base_position_m for arm in self.scene.arms], axis=0) + state.carriage_m
        return self._clipped(
            *self._joints(),
            np.array([self._carriage_m / lift, self._rise_m / lift]),
            (state.positions_m[0] - middle) / self._length_m,
            RATE_S * state.velocities[0, :3] / self._length_m,
            np.array([grip.normal_n, grip.friction_n]) / self._weight_n,
            np.array([grip.touching_share]),
            self._share,
        )

    def _reward(self, action: Array) -> float:
        config, touching = self.config, self._grip.touching_share
        gap = (self._carriage_m + config.lower_height_m) / max(config.lower_height_m, 1e-9)
        change = float(np.mean((self._share - self._before) ** 2))
        return (
            TOUCH_REWARD * touching
            - (0.0 if touching else GAP_COST * gap)
            + LIFT_REWARD * float(np.clip(self._rise_m / config.lift_height_m, 0.0, 1.0))
            - SLIP_COST * self._slip
            - CHANGE_COST * change
            - (GAP_COST * (self.steps - self._taken) if self._done() else 0.0)
        )

    def _done(self) -> bool:
        sideways = (self._state.positions_m[0] - self._rest.positions_m[0])[:2]
        return bool(np.linalg.norm(sideways) > LOST_M)

    def _metrics(self) -> dict[str, Any]:
        return {
            "time_s": self._taken * self.control_s,
            "carriage_m": self._carriage_m,
            "rise_m": self._rise_m,
            "normal_n": float(self._grip.normal_n),
            "friction_n": self._grip.friction_n,
            "touching_share": self._grip.touching_share,
            "slip_ratio": self._slip,
            "is_success": bool(self._rise_m >= HELD_SHARE * self.config.lift_height_m),
            **self._actuation(self._share),
        }

    @property
    def _carriage_m(self) -> float:
        return float(self._state.carriage_m[2])

    @property
    def _rise_m(self) -> float:
        """Rise of the object's centre of mass over its place at rest, m."""
        com = self.scene.objects[0].mass.com_m
        heights = [(s.positions_m[0] + s.rotations[0] @ com)[2] for s in (self._rest, self._state)]
        return float(heights[1] - heights[0])

    @property
    def _slip(self) -> float:
        followed = self._carriage_m - self._lowest - max(self._rise_m, 0.0)
        return float(np.clip(followed / self.config.lift_height_m, 0.0, 1.0))

    def _inputs(self) -> Inputs:
        """Return the actuation with this episode's error of the pressure, if there is a pressure."""
        full = self._actuation(self._share)
        if self.config.pressure_pa is None:
            return Inputs(full)
        return Inputs(
            {name: max(value + self._offset, 0.0) if value else 0.0 for name, value in full.items()}
        )

    def _drawn(self) -> tuple[Scene, SceneFrames]:
        looks = self._looks()
        heights = (0.0, -self.config.lower_height_m, self.config.lift_height_m)
        ends = [replace(self._rest, carriage_m=np.array([0.0, 0.0, height])) for height in heights]
        return with_surfaces(self.scene, looks), SceneFrames.from_states(ends)
