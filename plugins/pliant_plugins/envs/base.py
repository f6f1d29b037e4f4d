"""What all environments share: time, seeds, spaces, pictures. A subclass says what is seen and what is wanted."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, ClassVar, get_args

import gymnasium
import numpy as np
from numpy.typing import NDArray

from pliant.errors import UserError
from pliant.interfaces.viewer import Picture, View
from pliant.records.design import Array
from pliant.records.scene import Scene, SceneFrames

OBSERVED = NDArray[np.float32]
LIMIT = 10.0  # observations are of order one and clipped here


class SoftRobotEnv(gymnasium.Env[OBSERVED, NDArray[np.float32]]):
    """One episode: `steps` control steps of `control_s`, in each of which the action holds.

    Args:
        control_s: length of a control step.
        episode_s: after this time the episode is truncated.
        render_mode: "rgb_array" or None.
        size: (width, height) of pictures.
        camera: "iso", "front", "side" or "top".
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 20}  # noqa: RUF012 - gymnasium's

    def __init__(
        self,
        control_s: float,
        episode_s: float,
        render_mode: str | None,
        size: tuple[int, int],
        camera: str,
    ) -> None:
        if not (control_s > 0 and episode_s >= control_s):
            raise UserError(f"control_s is {control_s} and episode_s {episode_s}: 0 < control_s ≤ episode_s.")
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise UserError(f"render_mode is '{render_mode}'; this environment has 'rgb_array' only.")
        if camera not in get_args(View):
            raise UserError(f"unknown camera '{camera}'; cameras: {', '.join(get_args(View))}.")
        if len(size) != 2 or min(size) < 1:
            raise UserError(f"size is {tuple(size)}; it needs a width and a height in pixels.")
        self.control_s, self.steps = control_s, round(episode_s / control_s)
        self.render_mode, self._size, self._camera = render_mode, size, camera
        self.metadata = {**self.metadata, "render_fps": round(1 / control_s)}
        self._painter: Any = None
        self._taken = 0

    def _set_spaces(self, actions: int, observations: int) -> None:
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (actions,), np.float32)
        self.observation_space = gymnasium.spaces.Box(-LIMIT, LIMIT, (observations,), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[OBSERVED, dict[str, Any]]:
        """A new episode from the resting robot; `options` fixes what is drawn at random otherwise."""
        super().reset(seed=seed)
        options = options or {}
        unknown = sorted(set(options) - set(self.option_names))
        if unknown:
            raise UserError(
                f"unknown option '{unknown[0]}'; this environment takes {', '.join(self.option_names)}."
            )
        self._taken = 0
        self._begin(options)
        return self._observed(), self._metrics()

    def step(self, action: NDArray[np.float32]) -> tuple[OBSERVED, float, bool, bool, dict[str, Any]]:
        """One control step. A motion that becomes unbounded ends the episode at the price of all steps left."""
        wanted = np.clip(np.asarray(action, float).ravel(), -1.0, 1.0)
        self._taken += 1
        bounded = self._advance(wanted)
        truncated = self._taken >= self.steps
        if not bounded:
            left = float(1 + self.steps - self._taken)
            return self._nothing(), -left, True, False, {"unbounded": True}
        reward = self._reward(wanted)
        return self._observed(), reward, self._done(), truncated, self._metrics()

    def render(self) -> Picture | None:
        """(height, width, 3) uint8, or None without a render mode."""
        if self.render_mode is None:
            return None
        frame = self._frame()
        if self._painter is None:
            from pliant_plugins.viewing.drawing import Drawing
            from pliant_plugins.viewing.painter import Painter

            scene, fitted = self._drawn()
            self._painter = Painter(Drawing(scene, fitted, self._size), self._size, self._camera)
        picture: Picture = self._painter.picture(frame, 0)
        return picture

    def close(self) -> None:
        """Free the renderer and the engine."""
        if self._painter is not None:
            self._painter.close()
            self._painter = None

    def _nothing(self) -> OBSERVED:
        shape = self.observation_space.shape
        return np.zeros(shape or (), np.float32)

    @staticmethod
    def _clipped(*parts: Array) -> OBSERVED:
        flat = np.concatenate([np.ravel(part) for part in parts])
        return np.clip(flat, -LIMIT, LIMIT).astype(np.float32)

    option_names: ClassVar[tuple[str, ...]] = ()

    @abstractmethod
    def _begin(self, options: dict[str, Any]) -> None:
        """Rest the robot and draw what this episode asks."""

    @abstractmethod
    def _advance(self, action: Array) -> bool:
        """One control step; False where the motion has become unbounded."""

    @abstractmethod
    def _observed(self) -> OBSERVED:
        """What the agent sees."""

    @abstractmethod
    def _reward(self, action: Array) -> float:
        """Reward of the step just done."""

    @abstractmethod
    def _metrics(self) -> dict[str, Any]:
        """The `info` of the step just done: metrics by name."""

    def _done(self) -> bool:
        """Whether the task is over before its time."""
        return False

    @abstractmethod
    def _frame(self) -> SceneFrames:
        """The present pose as one frame."""

    @abstractmethod
    def _drawn(self) -> tuple[Scene, SceneFrames]:
        """The scene as it looks, and poses that the picture must hold."""
