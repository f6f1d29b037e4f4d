"""``gymnasium.make("pliant/HoldAndTurn-v0")``"""

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


class HoldAndTurnEnv(SoftRobotEnv):
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
    turn_scale_rad: ClassVar[float] = 0.3

    def _build(self) -> None:
        task = self.task
        if not isinstance(task, HoldAndTurn):
            raise UserError("pliant/HoldAndTurn-v0 needs a study with 'task: {kind: hold_and_turn, ...}'.")
        if not isinstance(self.backend, SceneBackend):
            kind = self.backend.config.kind
            raise UserError(f"physics '{kind}' has no contacts, which the task needs; use 'mujoco'.")
        self.scene: Scene = task.scene(self.chain)
        self.simulation = self.backend.build_scene(self.scene)
        grip = task.config.actuation(self.chain)
        take_hold(self.simulation, task.config, grip)
        self._rest = self._state = self.simulation.snapshot()
        held = np.array([grip[name] for name in self.inputs]) / self._highest
        self._grip = np.tile(np.clip(held, 0.0, 1.0), (len(self.scene.arms), 1))
        self._shares = self._previous = self._grip
        body = self.scene.objects[0]
        self._weight_n = body.mass.mass_kg * float(np.linalg.norm(self.scene.gravity_m_s2) or 9.81)
        self._turn_rad = self._wanted_rad = 0.0
        self._contacts = self._held = self.simulation.contacts()
        coordinates = sum(q.size for q in self._rest.coordinates)
        self._set_spaces(self._grip.size, 2 * coordinates + 12 + len(self.scene.arms) + self._grip.size)

    def _begin(self, options: dict[str, Any]) -> None:
        drawn = self.turn_scale_rad * float(self.np_random.uniform(-1.0, 1.0))
        given = options.get("turn_rad")
        if given is not None and not (isinstance(given, int | float) and np.isfinite(given)):
            raise UserError(f"option 'turn_rad' is {given!r}; it needs a number of radians.")
        self._wanted_rad = drawn if given is None else float(given)
        self._shares = self._previous = self._grip
        self._turn_rad = 0.0
        self.simulation.restore(self._rest)
        self._command()
        self._state, self._contacts = self._rest, self._held

    def _advance(self, action: Array) -> bool:
        self._previous, self._shares = self._shares, 0.5 * (action.reshape(self._grip.shape) + 1.0)
        self._command()
        try:
            self.simulation.step(self.control_s)
        except UserError:
            return False
        before, self._state = self._state, self.simulation.snapshot()
        rotations = np.array([state.rotations[0] for state in (self._rest, before, self._state)])
        turns = turns_rad(rotations, unit_axis(self.task.config))
        self._turn_rad += float(turns[2] - turns[1])
        self._contacts = self.simulation.contacts()
        return True

    def _command(self) -> None:
        values = (self._shares * self._highest).tolist()
        self.simulation.apply([Inputs(dict(zip(self.inputs, row, strict=True))) for row in values])

    @property
    def _drift(self) -> Array:
        com = np.asarray(self.scene.objects[0].mass.com_m)
        return centre_m(self._state, com) - centre_m(self._rest, com)

    def _observed(self) -> OBSERVED:
        radius, forces = self.task.target.radius_m, fingers_on_object(self._contacts)
        velocity = RATE_S * self._state.velocities[0]
        return self._clipped(
            *self._state.coordinates,
            *(RATE_S * rates for rates in self._state.rates),
            self._drift / radius,
            velocity[:3] / radius,
            velocity[3:],
            np.array([np.sin(self._turn_rad), np.cos(self._turn_rad), self._wanted_rad - self._turn_rad]),
            np.array([forces.get(k, 0.0) for k in range(len(self.scene.arms))]) / self._weight_n,
            self._shares,
        )

    def _reward(self, action: Array) -> float:
        change = float(np.mean((self._shares - self._previous) ** 2))
        away = abs(self._turn_rad - self._wanted_rad) / self.turn_scale_rad
        drift = float(np.linalg.norm(self._drift)) / self.task.target.radius_m
        left = float(self.steps - self._taken) if self._done() else 0.0
        return -away - drift - CHANGE_COST * change - left

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

    def _frame(self) -> SceneFrames:
        return SceneFrames.from_states([self._state])

    def _drawn(self) -> tuple[Scene, SceneFrames]:
        return with_surfaces(self.scene, self._looks()), SceneFrames.from_states([self._rest, self._state])

    def close(self) -> None:
        super().close()
        self.simulation.close()
