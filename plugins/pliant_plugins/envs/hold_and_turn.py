"""``gymnasium.make("pliant/HoldAndTurn-v0")``"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from pliant.records.design import Array
from pliant_plugins.envs.base import OBSERVED
from pliant_plugins.envs.chain_env import CHANGE_COST, RATE_S
from pliant_plugins.envs.scene_env import SceneEnv
from pliant_plugins.tasks.hold_and_turn.episode import take_hold
from pliant_plugins.tasks.hold_and_turn.metrics import (
    centre_m,
    fingers_on_object,
    is_held,
    turns_rad,
    unit_axis,
)
from pliant_plugins.tasks.hold_and_turn.task import HoldAndTurn

WITHIN_RAD = 0.05  # of the wanted turn: success
LOST_RADII = 2.0  # of drift: the object has left the hand


class HoldAndTurnEnv(SceneEnv):
    """Turn an object that the fingers hold by a wanted angle.

    Actions: per finger the share of each input's highest value, −1 for none.

    Observation: per finger joint coordinates (rad), their changes in 0.1 s; the object's centre from where it was taken
    hold of in its radii (3), its velocity (3) and angular velocity (3) in 0.1 s; sine and cosine of its turn; the turn
    that is left (rad); force of each finger on it in its weight; shares of the actuation.

    Reward per step: −|turn − wanted turn| / `turn_scale_rad` − (drift in radii) − 0.01 · (change of the actuation)².

    Episodes begin when the object is held as the task states it. Each draws the wanted turn, up to `turn_scale_rad` to
    either side; option `turn_rad` instead. `info`: `turn_rad`, `wanted_rad`, `drift_m`, `held`, `is_success` (within
    0.05 rad and held). An object that drifts by two radii ends the episode at −1 for each remaining step.
    """

    default_study: ClassVar[str] = "hold_and_turn"
    default_episode_s: ClassVar[float] = 3.0
    option_names: ClassVar[tuple[str, ...]] = ("turn_rad",)
    task_class: ClassVar[type] = HoldAndTurn
    turn_scale_rad: ClassVar[float] = 0.3

    def _build(self) -> None:
        self._open_scene()
        grip, fingers = self.task.config.actuation(self.chain), len(self.scene.arms)
        take_hold(self.simulation, self.task.config, grip)
        held = np.array([grip[name] for name in self.inputs]) / self._highest
        body = self.scene.objects[0]
        self._weight_n = body.mass.mass_kg * float(np.linalg.norm(self.scene.gravity_m_s2) or 9.81)
        self._turn_rad = self._wanted_rad = 0.0
        self._contacts = self._held = self.simulation.contacts()
        shares = np.tile(np.clip(held, 0.0, 1.0), (fingers, 1))
        self._set_rest(self._highest, further=12 + fingers, shares=shares)

    def _begin(self, options: dict[str, Any]) -> None:
        drawn = self.turn_scale_rad * float(self.np_random.uniform(-1.0, 1.0))
        self._wanted_rad = self._number_option(options, "turn_rad", drawn, "a number of radians")
        self._turn_rad = 0.0
        self._restart()
        self._state, self._contacts = self._rest, self._held

    def _see(self) -> None:
        before, self._state = self._state, self.simulation.snapshot()
        rotations = np.array([state.rotations[0] for state in (self._rest, before, self._state)])
        turns = turns_rad(rotations, unit_axis(self.task.config))
        self._turn_rad += float(turns[2] - turns[1])
        self._contacts = self.simulation.contacts()

    @property
    def _drift(self) -> Array:
        com = np.asarray(self.scene.objects[0].mass.com_m)
        return centre_m(self._state, com) - centre_m(self._rest, com)

    def _observed(self) -> OBSERVED:
        radius, forces = self.task.target.radius_m, fingers_on_object(self._contacts)
        velocity = RATE_S * self._state.velocities[0]
        return self._clipped(
            *self._joints(),
            self._drift / radius,
            velocity[:3] / radius,
            velocity[3:],
            np.array([np.sin(self._turn_rad), np.cos(self._turn_rad), self._wanted_rad - self._turn_rad]),
            np.array([forces.get(k, 0.0) for k in range(len(self.scene.arms))]) / self._weight_n,
            self._shares,
        )

    def _reward(self, action: Array) -> float:
        away = abs(self._turn_rad - self._wanted_rad) / self.turn_scale_rad
        drift = float(np.linalg.norm(self._drift)) / self.task.target.radius_m
        left = float(self.steps - self._taken) if self._done() else 0.0
        return -away - drift - CHANGE_COST * self._change() - left

    def _done(self) -> bool:
        return bool(np.linalg.norm(self._drift) > LOST_RADII * self.task.target.radius_m)

    def _metrics(self) -> dict[str, Any]:
        held = is_held(self._contacts, self.task.config)
        return {
            "time_s": self._taken * self.control_s,
            "turn_rad": self._turn_rad,
            "wanted_rad": self._wanted_rad,
            "drift_m": float(np.linalg.norm(self._drift)),
            "held": held,
            "is_success": bool(held and abs(self._turn_rad - self._wanted_rad) < WITHIN_RAD),
        }
