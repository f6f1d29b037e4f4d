"""``gymnasium.make("pliant/Crawl-v0")``"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from pliant.records.design import Array
from pliant_plugins.envs.base import OBSERVED
from pliant_plugins.envs.chain_env import CHANGE_COST, RATE_S, REACHED
from pliant_plugins.envs.scene_env import SceneEnv
from pliant_plugins.tasks.crawl.task import Crawl

PROGRESS = 10.0  # reward for a chain length


class CrawlEnv(SceneEnv):
    """Crawl over the floor to a place before or behind the robot.

    Actions: per arm the share of each input's highest value, −1 for none; the highest is that of the task's gait.

    Observation: per arm joint coordinates (rad), their changes in 0.1 s; the body's x and z axes in the world (6), its
    motion in 0.1 s in chain lengths (3); the way to the target along the task's `direction` in chain lengths; shares of
    the actuation.

    Reward per step: 10 · (decrease of the distance from the target in chain lengths) − 0.01 · (change of the
    actuation)². The place of a robot is the mean of its markers.

    Each episode draws the target within `spread_m` before and behind; option `target_m` instead, a number. `info`:
    `position_m` along the direction, `distance_m`, `target_m`, `is_success` (within 2 % of the chain's length).
    """

    default_study: ClassVar[str] = "crawl"
    default_episode_s: ClassVar[float] = 8.0
    option_names: ClassVar[tuple[str, ...]] = ("target_m",)
    task_class: ClassVar[type] = Crawl
    spread_m: ClassVar[float] = 0.06

    def _build(self) -> None:
        self._open_scene()
        config = self.task.config
        self.task.check_inputs(self.chain)
        tops = [config.gait[name].high if name in config.gait else 0.0 for name in self.inputs]
        self._forward = np.array(config.direction) / np.linalg.norm(config.direction)
        self._target_m = self._start_m = self._place_m = self._last_m = 0.0
        self._set_rest(np.array(tops), further=10)

    def _begin(self, options: dict[str, Any]) -> None:
        drawn = float(self.np_random.uniform(-self.spread_m, self.spread_m))
        self._target_m = self._number_option(options, "target_m", drawn, "a number of metres")
        self._restart()
        self._start_m = 0.0
        self._see()
        self._start_m, self._last_m, self._place_m = self._place_m, 0.0, 0.0

    def _see(self) -> None:
        self._state = self.simulation.snapshot()
        markers = np.concatenate([self.simulation.markers(k) for k in range(len(self.scene.arms))])
        self._last_m = self._place_m
        self._place_m = float(markers.mean(axis=0) @ self._forward) - self._start_m

    def _observed(self) -> OBSERVED:
        length, state = self.chain.length_m, self._state
        return self._clipped(
            *self._joints(),
            state.rotations[0][:, [0, 2]].T,
            RATE_S * state.velocities[0, :3] / length,
            np.array([(self._target_m - self._place_m) / length]),
            self._shares,
        )

    def _reward(self, action: Array) -> float:
        nearer = abs(self._target_m - self._last_m) - abs(self._target_m - self._place_m)
        return PROGRESS * nearer / self.chain.length_m - CHANGE_COST * self._change()

    def _metrics(self) -> dict[str, Any]:
        distance = abs(self._target_m - self._place_m)
        return {
            "time_s": self._taken * self.control_s,
            "position_m": self._place_m,
            "distance_m": distance,
            "target_m": self._target_m,
            "is_success": bool(distance < REACHED * self.chain.length_m),
        }
