"""What all environments share: time, seeds, spaces, pictures, and the chain of a study in its engine."""

from __future__ import annotations

import os
from abc import abstractmethod
from pathlib import Path
from typing import Any, ClassVar, get_args

import gymnasium
import numpy as np
from numpy.typing import NDArray

from pliant.api import DEFAULT_STORE, open_study
from pliant.errors import UserError
from pliant.interfaces.physics import PhysicsBackend
from pliant.interfaces.viewer import Picture, View
from pliant.pipeline.motion import drawn_chain, highest_actuation, prepared_chain
from pliant.pipeline.study import StudyRun, build_study_laws
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.scene import Scene, SceneFrames

OBSERVED = NDArray[np.float32]
LIMIT = 10.0  # observations are of order one and clipped here
STUDIES = Path(__file__).parent / "studies"


def stored() -> Path:
    """Return the artifact store of environments: `PLIANT_STORE`, else the usual one."""
    return Path(os.environ.get("PLIANT_STORE") or DEFAULT_STORE)


class SoftRobotEnv(gymnasium.Env[OBSERVED, NDArray[np.float32]]):
    """An environment whose episode has `steps` control steps of `control_s`, with a constant action in each.

    Args:
        study: path of a study file; by default one that ships with the environment.
        actuation_max: highest pressure (Pa) or tendon force (N); the task's by default.
        control_s: length of a control step.
        episode_s: after this time the episode is truncated; 2 s by default, of a grasp 6 s.
        render_mode: "rgb_array" or None.
        size: (width, height) of pictures.
        camera: "iso", "front", "side" or "top".

    Attributes:
        opened: the study; its `chain` has the task's own loads and the effects applied, in the engine `backend`.
        task: the built task, or None.
        inputs: of the chain; action +1 means the highest value of each, −1 is 0.

    Raises:
        UserError: an argument or the study is wrong, or the range of the actuation is not defined.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 20}  # noqa: RUF012 - gymnasium's

    default_study: ClassVar[str]
    default_episode_s: ClassVar[float] = 2.0
    option_names: ClassVar[tuple[str, ...]] = ()

    def __init__(
        self,
        study: str | Path | None = None,
        *,
        actuation_max: float | None = None,
        control_s: float = 0.05,
        episode_s: float | None = None,
        render_mode: str | None = None,
        size: tuple[int, int] = (480, 360),
        camera: str = "iso",
    ) -> None:
        episode_s = self.default_episode_s if episode_s is None else episode_s
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
        self.opened = open_study(study or STUDIES / f"{self.default_study}.yaml", store=stored())
        loaded = self.opened.study
        self.task: Any  # a subclass may need another type
        self.chain, self.backend, self.task = self._prepared()
        if not self.backend.capabilities.dynamic:
            raise UserError(
                f"an environment steps through time and physics '{self.backend.config.kind}' has equilibria only; "
                "use 'mujoco' or 'pybullet' in the study."
            )
        self.inputs = tuple(dict.fromkeys(actuator.input for actuator in self.chain.actuators))
        top = highest_actuation(loaded, self.chain) if actuation_max is None else actuation_max
        if not (np.isfinite(top) and top > 0):
            raise UserError(f"actuation_max is {top}; it needs a positive number of Pa or N.")
        self._highest = np.full(len(self.inputs), float(top))
        self._share = self._before = np.zeros(len(self.inputs))
        self._build()

    def _prepared(self) -> tuple[ChainModel, PhysicsBackend, Any]:
        """Prepare the chain with loads and effects, the engine and the task."""
        return prepared_chain(self.opened.context, self.opened.study)

    def _actuation(self, share: Array) -> dict[str, float]:
        """Return inputs at shares (k,) of their highest values."""
        return dict(zip(self.inputs, (share * self._highest).tolist(), strict=True))

    def _looks(self) -> ChainModel:
        """Return the chain with the surfaces for pictures."""
        context, study = self.opened.context, self.opened.study
        return drawn_chain(context, StudyRun(study, build_study_laws(context, study)))

    def _set_spaces(self, actions: int, observations: int) -> None:
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (actions,), np.float32)
        self.observation_space = gymnasium.spaces.Box(-LIMIT, LIMIT, (observations,), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[OBSERVED, dict[str, Any]]:
        """Start a new episode from the resting robot; `options` fixes what is drawn at random otherwise."""
        super().reset(seed=seed)
        options = options or {}
        unknown = sorted(set(options) - set(self.option_names))
        if unknown:
            raise UserError(
                f"unknown option '{unknown[0]}'; this environment takes {', '.join(self.option_names)}."
            )
        self._taken = 0
        self._share = self._before = np.zeros(len(self.inputs))
        self._begin(options)
        return self._observed(), self._metrics()

    def step(self, action: NDArray[np.float32]) -> tuple[OBSERVED, float, bool, bool, dict[str, Any]]:
        """Make one control step. Unbounded motion ends the episode at the cost of all remaining steps."""
        wanted = np.clip(np.asarray(action, float).ravel(), -1.0, 1.0)
        self._taken += 1
        bounded = self._advance(wanted)
        truncated = self._taken >= self.steps
        if not bounded:
            left = float(1 + self.steps - self._taken)
            nothing = np.zeros(self.observation_space.shape or (), np.float32)
            return nothing, -left, True, False, {"unbounded": True}
        reward = self._reward(wanted)
        return self._observed(), reward, self._done(), truncated, self._metrics()

    def render(self) -> Picture | None:
        """Return a picture (height, width, 3) of uint8, or None without a render mode."""
        if self.render_mode is None:
            return None
        frame = self._frame()
        if self._painter is None:
            from pliant_view.mujoco.drawing import SceneDrawing
            from pliant_view.mujoco.painter import Painter

            scene, fitted = self._drawn()
            self._painter = Painter(SceneDrawing(scene, fitted, self._size), self._size, self._camera)
        picture: Picture = self._painter.picture(frame, 0)
        return picture

    def close(self) -> None:
        """Free the renderer and the engine."""
        if self._painter is not None:
            self._painter.close()
            self._painter = None

    @staticmethod
    def _clipped(*parts: Array) -> OBSERVED:
        flat = np.concatenate([np.ravel(part) for part in parts])
        return np.clip(flat, -LIMIT, LIMIT).astype(np.float32)

    @abstractmethod
    def _build(self) -> None:
        """Build the simulation and set the spaces."""

    @abstractmethod
    def _begin(self, options: dict[str, Any]) -> None:
        """Rest the robot and draw the episode's random values."""

    @abstractmethod
    def _advance(self, action: Array) -> bool:
        """Advance one control step; return False if the motion has become unbounded."""

    @abstractmethod
    def _observed(self) -> OBSERVED:
        """Return the observation."""

    @abstractmethod
    def _reward(self, action: Array) -> float:
        """Return the reward of the last step."""

    @abstractmethod
    def _metrics(self) -> dict[str, Any]:
        """Return the `info` of the last step: metrics by name."""

    def _done(self) -> bool:
        """Return whether the task has ended before its time limit."""
        return False

    @abstractmethod
    def _frame(self) -> SceneFrames:
        """Return the present pose as one frame."""

    @abstractmethod
    def _drawn(self) -> tuple[Scene, SceneFrames]:
        """Return the scene to draw and poses that the picture must include."""
