"""A chain that is actuated: what its environments share."""

from __future__ import annotations

from abc import abstractmethod
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from pliant.errors import UserError
from pliant.pipeline.motion import chain_frames, chain_scene, drawn_chain
from pliant.records.design import Array
from pliant.records.rollout import Equilibrium, Inputs
from pliant.records.scene import Scene, SceneFrames
from pliant_plugins.envs.base import OBSERVED, SoftRobotEnv
from pliant_plugins.envs.plant import Plant

CHANGE_COST = 0.01  # of a full swing of every action, per step
RATE_S = 0.1  # rates are seen as the angle of this time
REACHED = 0.02  # of the chain's length


class ChainEnv(SoftRobotEnv):
    """One chain from a study; each action is one input's share of its highest value, −1 for none.

    Observation, in this order: joint coordinates (rad), their change in 0.1 s, the tip from the base in chain
    lengths, the shares of the actuation, then what the subclass adds.

    Args:
        study: path of a study file; by default a chain that ships with the environment.
        actuation_max: highest pressure (Pa) or tendon force (N); the task's by default.
        control_s, episode_s, render_mode, size, camera: see `SoftRobotEnv`.
    """

    default_study: ClassVar[str]
    goal_size: ClassVar[int]

    def __init__(
        self,
        study: str | Path | None = None,
        *,
        actuation_max: float | None = None,
        control_s: float = 0.05,
        episode_s: float = 2.0,
        render_mode: str | None = None,
        size: tuple[int, int] = (480, 360),
        camera: str = "iso",
    ) -> None:
        super().__init__(control_s, episode_s, render_mode, size, camera)
        self.plant = Plant.of(study, self.default_study, actuation_max)
        self.chain = self.plant.chain
        self.simulation = self.plant.backend.build(self.chain)
        self._rest = self.simulation.snapshot()
        # Equilibria, by which goals are drawn: the engines agree, and Newton is the quickest.
        self._statics = self.plant.equilibria.build(self.chain)
        self._straight = self._statics.snapshot()
        self._length_m = self.chain.length_m
        self._share = self._before = np.zeros(len(self.plant.names))
        self._markers = self.simulation.markers()
        size_seen = 2 * self._rest.position.size + 3 + len(self.plant.names) + self.goal_size
        self._set_spaces(len(self.plant.names), size_seen)

    def _begin(self, options: dict[str, Any]) -> None:
        self._share = self._before = np.zeros(len(self.plant.names))
        self._ask(options)
        self.simulation.restore(self._rest)
        self.simulation.apply(self._inputs(self._share))
        self._markers = self.simulation.markers()

    def _advance(self, action: Array) -> bool:
        self._before, self._share = self._share, 0.5 * (action + 1.0)
        self.simulation.apply(self._inputs(self._share))
        self.simulation.step(self.control_s)
        self._markers = self.simulation.markers()
        return bool(np.all(np.isfinite(self._markers)))

    def _observed(self) -> OBSERVED:
        state = self.simulation.snapshot()
        return self._clipped(
            state.position,
            RATE_S * state.velocity,
            self._in_lengths(self._markers[-1]),
            self._share,
            self._goal(),
        )

    def _reward(self, action: Array) -> float:
        change = float(np.mean((self._share - self._before) ** 2))
        return -self._error_m() / self._length_m - CHANGE_COST * change

    def _metrics(self) -> dict[str, Any]:
        error = self._error_m()
        return {
            "time_s": self._taken * self.control_s,
            "tip_m": np.array(self._markers[-1]),
            "error_m": error,
            "is_success": bool(error < REACHED * self._length_m),
            **self.plant.actuation(self._share),
        }

    def _inputs(self, share: Array) -> Inputs:
        """Actuation with this episode's loads."""
        return Inputs(self.plant.actuation(share))

    def _in_lengths(self, points_m: Array) -> Array:
        """World points from the base, in chain lengths."""
        return np.asarray((points_m - self.chain.base_position_m) / self._length_m)

    def _settled(self, share: Array) -> Equilibrium:
        """The equilibrium at this actuation and this episode's loads."""
        self._statics.restore(self._straight)
        self._statics.apply(self._inputs(share))
        return self._statics.settle()

    def _frame(self) -> SceneFrames:
        state = self.simulation.snapshot()
        return chain_frames(np.array([self._taken * self.control_s]), state.position[None])

    def _drawn(self) -> tuple[Scene, SceneFrames]:
        looks = drawn_chain(self.plant.opened.bench, self.plant.drawn())
        chain = self.chain.with_(shapes=looks.shapes)
        levels = [np.full(len(self.plant.names), level) for level in (0.0, 0.5, 1.0)]
        poses = np.array([self._settled(share).joint_angles for share in levels])
        return chain_scene(chain), chain_frames(np.arange(3.0), poses)

    def close(self) -> None:
        super().close()
        self.simulation.close()
        self._statics.close()

    @abstractmethod
    def _ask(self, options: dict[str, Any]) -> None:
        """Draw this episode's loads and goal with `self.np_random`; the chain's state is free to use."""

    @abstractmethod
    def _goal(self) -> Array:
        """(goal_size,) what the observation says of the goal and the loads."""

    @abstractmethod
    def _error_m(self) -> float:
        """How far the chain is from the goal."""


def vector_option(options: dict[str, Any], name: str) -> Array | None:
    """A vector (3,) from the options, or None; raises `UserError` for anything else."""
    if name not in options:
        return None
    try:
        value = np.asarray(options[name], float)
    except (TypeError, ValueError):
        value = np.empty(0)
    if value.shape != (3,) or not np.all(np.isfinite(value)):
        raise UserError(f"option '{name}' is {options[name]!r}; it needs three numbers.")
    return value
