"""``gymnasium.make("pliant/ReachAround-v0")``"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from pliant.inverse.limits import input_bounds
from pliant.records.design import Array
from pliant_plugins.envs.base import OBSERVED
from pliant_plugins.envs.chain_env import CHANGE_COST, REACHED, points_option
from pliant_plugins.envs.scene_env import SceneEnv
from pliant_plugins.tasks.reach_around.task import ReachAround
from pliant_plugins.tasks.scene_record import pressing_n

PRESS_COST, WEIGHT_N_KG = 0.1, 9.81


class ReachAroundEnv(SceneEnv):
    """Bring the tips of one or several arms to their targets behind obstacles.

    Actions: per arm the share of each input's highest value (−1 for none); the highest is that of the task's bounds.

    Observation: per arm joint coordinates (rad), their changes in 0.1 s, tip and target from the base in arm lengths
    (3 each); force on the obstacles in weights of all arms; shares of the actuation.

    Reward per step: −(largest distance of a tip from its target in arm lengths) − 0.1 · (force on the obstacles in
    weights, 1 at most) − 0.01 · (change of the actuation)².

    Each episode draws how far each target is moved from the task's, within `spread_m` along every axis of the bending
    plane. Option `shift_m`: (3,) instead, for all arms. `info`: `distance_m`, `clearance_m`, `press_n`, `is_success`
    (within 2 % of the length).
    """

    default_study: ClassVar[str] = "reach_around"
    default_episode_s: ClassVar[float] = 4.0
    option_names: ClassVar[tuple[str, ...]] = ("shift_m",)
    task_class: ClassVar[type] = ReachAround
    spread_m: ClassVar[float] = 3e-3

    def _build(self) -> None:
        self._open_scene()
        config = self.task.config
        chains = [arm.chain for arm in self.scene.arms]
        bodies = [body for chain in chains for body in chain.bodies[1:]]
        carried_kg = sum(body.mass_kg for body in bodies) + sum(chain.payload_kg for chain in chains)
        self._weight_n = max(carried_kg, 1e-6) * WEIGHT_N_KG
        self._bases = np.array([chain.base_position_m for chain in chains])
        self._targets = self._stated = np.array([one.tip_m for one in config.arms])
        self._press_n, self._tips = 0.0, self._bases
        self._set_rest(input_bounds(self.chain, config.bounds)[:, 1], further=6 * len(chains) + 1)

    def _begin(self, options: dict[str, Any]) -> None:
        plane = self.chain.base_rotation[:, [0, 2]]
        drawn = plane @ self.np_random.uniform(-self.spread_m, self.spread_m, 2)
        given = points_option(options, "shift_m")
        self._targets = self._stated + (drawn if given is None else given)
        self._restart()
        self._see()

    def _see(self) -> None:
        self._state = self.simulation.snapshot()
        self._press_n = pressing_n(self.simulation.contacts())
        self._markers = [self.simulation.markers(k) for k in range(len(self.scene.arms))]
        self._tips = np.array([markers[-1] for markers in self._markers])

    def _observed(self) -> OBSERVED:
        length = self.chain.length_m
        return self._clipped(
            *self._joints(),
            (self._tips - self._bases) / length,
            (self._targets - self._bases) / length,
            np.array([self._press_n / self._weight_n]),
            self._shares,
        )

    def _distance_m(self) -> float:
        return float(np.linalg.norm(self._tips - self._targets, axis=1).max())

    def _reward(self, action: Array) -> float:
        pressed = min(self._press_n / self._weight_n, 1.0)
        return -self._distance_m() / self.chain.length_m - PRESS_COST * pressed - CHANGE_COST * self._change()

    def _metrics(self) -> dict[str, Any]:
        keeps = [self.task.clearance(arm.chain) for arm in self.scene.arms]
        distance = self._distance_m()
        return {
            "time_s": self._taken * self.control_s,
            "distance_m": distance,
            "clearance_m": min(k.smallest_m(m) for k, m in zip(keeps, self._markers, strict=True)),
            "press_n": self._press_n,
            "target_m": self._targets.copy(),
            "is_success": bool(distance < REACHED * self.chain.length_m),
        }
