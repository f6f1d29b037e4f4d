"""``gymnasium.make("pliant/Push-v0")``"""

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
from pliant_plugins.envs.chain_env import CHANGE_COST, RATE_S
from pliant_plugins.tasks.push.task import Push
from pliant_plugins.tasks.scene_record import pressing_n

WITHIN = 0.05  # of the largest wanted force: success


class PushEnv(SoftRobotEnv):
    """Press on a wall with a wanted force.

    Actions: the share of each input's highest value, −1 for none.

    Observation: joint coordinates (rad), their changes in 0.1 s, force and wanted force over `force_scale_n`, shares
    of the actuation.

    Reward per step: −|force − wanted force| / `force_scale_n` − 0.01 · (change of the actuation)².

    Each episode draws the wanted force, 10 to 90 % of `force_scale_n`; option `force_n` instead. `info`: `press_n`,
    `wanted_n`, `is_success` (within 5 % of `force_scale_n`).
    """

    default_study: ClassVar[str] = "push"
    default_episode_s: ClassVar[float] = 3.0
    option_names: ClassVar[tuple[str, ...]] = ("force_n",)
    force_scale_n: ClassVar[float] = 0.4

    def _build(self) -> None:
        task = self.task
        if not isinstance(task, Push):
            raise UserError("pliant/Push-v0 needs a study with 'task: {kind: push, ...}'.")
        if not isinstance(self.backend, SceneBackend):
            kind = self.backend.config.kind
            raise UserError(f"physics '{kind}' has no motion in contact, which the task needs; use 'mujoco'.")
        self.scene: Scene = task.scene(self.chain)
        self.simulation = self.backend.build_scene(self.scene)
        self._rest = self._state = self.simulation.snapshot()
        self._press_n = self._wanted_n = 0.0
        coordinates = sum(q.size for q in self._rest.coordinates)
        self._set_spaces(len(self.inputs), 2 * coordinates + 2 + len(self.inputs))

    def _begin(self, options: dict[str, Any]) -> None:
        drawn = self.force_scale_n * float(self.np_random.uniform(0.1, 0.9))
        given = options.get("force_n")
        if given is not None and not (isinstance(given, int | float) and np.isfinite(given) and given >= 0):
            raise UserError(f"option 'force_n' is {given!r}; it needs a number of newtons, 0 or more.")
        self._wanted_n = drawn if given is None else float(given)
        self.simulation.restore(self._rest)
        self.simulation.apply([Inputs(self._actuation(self._share))])
        self._see()

    def _advance(self, action: Array) -> bool:
        self._before, self._share = self._share, 0.5 * (action + 1.0)
        self.simulation.apply([Inputs(self._actuation(self._share))])
        try:
            self.simulation.step(self.control_s)
        except UserError:
            return False
        self._see()
        return True

    def _see(self) -> None:
        self._state = self.simulation.snapshot()
        self._press_n = pressing_n(self.simulation.contacts())

    def _observed(self) -> OBSERVED:
        forces = np.array([self._press_n, self._wanted_n]) / self.force_scale_n
        rates = (RATE_S * rates for rates in self._state.rates)
        return self._clipped(*self._state.coordinates, *rates, forces, self._share)

    def _reward(self, action: Array) -> float:
        change = float(np.mean((self._share - self._before) ** 2))
        return -abs(self._press_n - self._wanted_n) / self.force_scale_n - CHANGE_COST * change

    def _metrics(self) -> dict[str, Any]:
        return {
            "time_s": self._taken * self.control_s,
            "press_n": float(self._press_n),
            "wanted_n": self._wanted_n,
            "is_success": bool(abs(self._press_n - self._wanted_n) < WITHIN * self.force_scale_n),
            **self._actuation(self._share),
        }

    def _frame(self) -> SceneFrames:
        return SceneFrames.from_states([self._state])

    def _drawn(self) -> tuple[Scene, SceneFrames]:
        return with_surfaces(self.scene, self._looks()), SceneFrames.from_states([self._rest, self._state])

    def close(self) -> None:
        super().close()
        self.simulation.close()
