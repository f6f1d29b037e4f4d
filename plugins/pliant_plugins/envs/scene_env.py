"""What environments of tasks in contact share: the scene, actions by arm, and pictures."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, ClassVar

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.physics import SceneBackend
from pliant.interfaces.task import SceneTask
from pliant.pipeline.motion import with_surfaces
from pliant.records.design import Array
from pliant.records.rollout import Inputs
from pliant.records.scene import Scene, SceneFrames
from pliant_plugins.envs.base import SoftRobotEnv
from pliant_plugins.envs.chain_env import RATE_S


class SceneEnv(SoftRobotEnv):
    """An environment of a task in contact; an action has a share of each input's highest value for each arm.

    Attributes:
        task_class: of the study's task, whose kind has the name of `default_study`.
        scene: arms, objects, obstacles and floor.
    """

    task_class: ClassVar[type[SceneTask]]

    def _open_scene(self) -> None:
        """Build the task's scene in the engine.

        Raises:
            UserError: the study has another task, or the engine has no contacts.
        """
        if not isinstance(self.task, self.task_class):
            name, kind = type(self).__name__.removesuffix("Env"), self.default_study
            raise UserError(f"pliant/{name}-v0 needs a study with 'task: {{kind: {kind}, ...}}'.")
        if not isinstance(self.backend, SceneBackend):
            kind = self.backend.config.kind
            raise UserError(f"physics '{kind}' has no motion in contact, which the task needs; use 'mujoco'.")
        self.scene: Scene = self.task.scene(self.chain)
        self.simulation = self.backend.build_scene(self.scene)

    def _set_rest(self, tops: Array, further: int, shares: Array | None = None) -> None:
        """Take the present state as that in which episodes begin, and set the spaces.

        Args:
            tops: (inputs,) or (arms, inputs) highest values.
            further: number of observations besides joints, their changes and the shares.
            shares: (arms, inputs) at the beginning; none by default.
        """
        self._rest = self._state = self.simulation.snapshot()
        self._tops = np.broadcast_to(tops, (len(self.scene.arms), len(self.inputs)))
        self._first_shares = np.zeros(self._tops.shape) if shares is None else shares
        self._shares = self._previous = self._first_shares
        joints = sum(2 * q.size for q in self._rest.coordinates)
        self._set_spaces(self._tops.size, joints + further + self._tops.size)

    def _restart(self) -> None:
        """Return to the state and the inputs of the beginning."""
        self._shares = self._previous = self._first_shares
        self.simulation.restore(self._rest)
        self._command()

    def _number_option(self, options: dict[str, Any], name: str, drawn: float, need: str) -> float:
        """Return a number from the options, or the one that was drawn if it is absent.

        Raises:
            UserError: the option is no finite number; `need` says what it has to be.
        """
        given = options.get(name)
        if given is not None and not (isinstance(given, int | float) and np.isfinite(given)):
            raise UserError(f"option '{name}' is {given!r}; it needs {need}.")
        return drawn if given is None else float(given)

    def _advance(self, action: Array) -> bool:
        self._previous, self._shares = self._shares, 0.5 * (action.reshape(self._tops.shape) + 1.0)
        self._command()
        try:
            self.simulation.step(self.control_s)
        except UserError:
            return False
        self._see()
        return True

    def _command(self) -> None:
        values = (self._shares * self._tops).tolist()
        self.simulation.apply([Inputs(dict(zip(self.inputs, row, strict=True))) for row in values])

    @abstractmethod
    def _see(self) -> None:
        """Take the present state, and measure it."""

    def _joints(self) -> tuple[Array, ...]:
        """Return coordinates of all arms, and their changes in 0.1 s."""
        return (*self._state.coordinates, *(RATE_S * rates for rates in self._state.rates))

    def _change(self) -> float:
        """Return the mean square of the last change of the shares."""
        return float(np.mean((self._shares - self._previous) ** 2))

    def _frame(self) -> SceneFrames:
        return SceneFrames.from_states([self._state])

    def _drawn(self) -> tuple[Scene, SceneFrames]:
        return with_surfaces(self.scene, self._looks()), SceneFrames.from_states([self._rest, self._state])

    def close(self) -> None:
        super().close()
        self.simulation.close()
