"""``gymnasium.make("pliant/Push-v0")``"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from pliant.errors import UserError
from pliant.records.design import Array
from pliant_plugins.envs.base import OBSERVED
from pliant_plugins.envs.chain_env import CHANGE_COST
from pliant_plugins.envs.scene_env import SceneEnv
from pliant_plugins.tasks.push.task import Push
from pliant_plugins.tasks.scene_record import pressing_n

WITHIN = 0.05  # of the largest wanted force: success


class PushEnv(SceneEnv):
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
    task_class: ClassVar[type] = Push
    force_scale_n: ClassVar[float] = 0.4

    def _build(self) -> None:
        self._open_scene()
        self._press_n = self._wanted_n = 0.0
        self._set_rest(self._highest, further=2)

    def _begin(self, options: dict[str, Any]) -> None:
        drawn = self.force_scale_n * float(self.np_random.uniform(0.1, 0.9))
        need = "a number of newtons, 0 or more"
        self._wanted_n = self._number_option(options, "force_n", drawn, need)
        if self._wanted_n < 0:
            raise UserError(f"option 'force_n' is {self._wanted_n!r}; it needs {need}.")
        self._restart()
        self._see()

    def _see(self) -> None:
        self._state = self.simulation.snapshot()
        self._press_n = pressing_n(self.simulation.contacts())

    def _observed(self) -> OBSERVED:
        forces = np.array([self._press_n, self._wanted_n]) / self.force_scale_n
        return self._clipped(*self._joints(), forces, self._shares)

    def _reward(self, action: Array) -> float:
        return -abs(self._press_n - self._wanted_n) / self.force_scale_n - CHANGE_COST * self._change()

    def _metrics(self) -> dict[str, Any]:
        return {
            "time_s": self._taken * self.control_s,
            "press_n": float(self._press_n),
            "wanted_n": self._wanted_n,
            "is_success": bool(abs(self._press_n - self._wanted_n) < WITHIN * self.force_scale_n),
            **self._actuation(self._shares[0]),
        }
