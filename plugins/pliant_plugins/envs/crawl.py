"""``gymnasium.make("pliant/Crawl-v0")``"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.physics import SceneBackend
from pliant.pipeline.motion import with_surfaces
from pliant.records.design import Array
from pliant.records.rollout import Inputs
from pliant.records.scene import Scene, SceneFrames
from pliant_plugins.envs.base import OBSERVED, SoftRobotEnv
from pliant_plugins.envs.chain_env import CHANGE_COST, RATE_S, REACHED
from pliant_plugins.tasks.crawl.task import Crawl

PROGRESS = 10.0  # reward for a chain length


class CrawlEnv(SoftRobotEnv):
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
    spread_m: ClassVar[float] = 0.06

    def _build(self) -> None:
        task = self.task
        if not isinstance(task, Crawl):
            raise UserError("pliant/Crawl-v0 needs a study with 'task: {kind: crawl, ...}'.")
        if not isinstance(self.backend, SceneBackend):
            kind = self.backend.config.kind
            raise UserError(f"physics '{kind}' has no motion in contact, which the task needs; use 'mujoco'.")
        task.check_inputs(self.chain)
        self.scene: Scene = task.scene(self.chain)
        self.simulation = self.backend.build_scene(self.scene)
        self._rest = self._state = self.simulation.snapshot()
        self._arms = range(len(self.scene.arms))
        top = [task.config.gait[name].high if name in task.config.gait else 0.0 for name in self.inputs]
        self._tops = np.tile(top, (len(self._arms), 1))
        self._shares = self._previous = np.zeros_like(self._tops)
        self._forward = np.array(task.config.direction) / np.linalg.norm(task.config.direction)
        self._target_m = self._start_m = self._place_m = self._last_m = 0.0
        size = sum(2 * q.size for q in self._rest.coordinates) + 10 + self._tops.size
        self._set_spaces(self._tops.size, size)

    def _begin(self, options: dict[str, Any]) -> None:
        drawn, given = float(self.np_random.uniform(-self.spread_m, self.spread_m)), options.get("target_m")
        if given is not None and not (isinstance(given, int | float) and np.isfinite(given)):
            raise UserError(f"option 'target_m' is {given!r}; it needs a number of metres.")
        self._target_m = drawn if given is None else float(given)
        self._shares = self._previous = np.zeros_like(self._tops)
        self.simulation.restore(self._rest)
        self._command()
        self._see()
        self._start_m, self._last_m, self._place_m = self._place_m, 0.0, 0.0

    def _advance(self, action: Array) -> bool:
        self._previous, self._shares = self._shares, 0.5 * (action.reshape(self._tops.shape) + 1.0)
        self._command()
        try:
            self.simulation.step(self.control_s)
        except UserError:
            return False
        self._last_m = self._place_m
        self._see()
        self._place_m -= self._start_m
        return True

    def _command(self) -> None:
        values = (self._shares * self._tops).tolist()
        self.simulation.apply([Inputs(dict(zip(self.inputs, row, strict=True))) for row in values])

    def _see(self) -> None:
        self._state = self.simulation.snapshot()
        markers = np.concatenate([self.simulation.markers(k) for k in self._arms])
        self._place_m = float(markers.mean(axis=0) @ self._forward)

    def _observed(self) -> OBSERVED:
        length, state = self.chain.length_m, self._state
        return self._clipped(
            *state.coordinates,
            *(RATE_S * rates for rates in state.rates),
            state.rotations[0][:, [0, 2]].T,
            RATE_S * state.velocities[0, :3] / length,
            np.array([(self._target_m - self._place_m) / length]),
            self._shares,
        )

    def _reward(self, action: Array) -> float:
        change = float(np.mean((self._shares - self._previous) ** 2))
        nearer = abs(self._target_m - self._last_m) - abs(self._target_m - self._place_m)
        return PROGRESS * nearer / self.chain.length_m - CHANGE_COST * change

    def _metrics(self) -> dict[str, Any]:
        distance = abs(self._target_m - self._place_m)
        return {
            "time_s": self._taken * self.control_s,
            "position_m": self._place_m,
            "distance_m": distance,
            "target_m": self._target_m,
            "is_success": bool(distance < REACHED * self.chain.length_m),
        }

    def _frame(self) -> SceneFrames:
        return SceneFrames.from_states([self._state])

    def _drawn(self) -> tuple[Scene, SceneFrames]:
        return with_surfaces(self.scene, self._looks()), SceneFrames.from_states([self._rest, self._state])

    def close(self) -> None:
        super().close()
        self.simulation.close()
