"""What effects change of a MuJoCo model: its numbers, its specification, or forces with memory at each step."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

from pliant.records.design import Array


class ModelChange(ABC):
    """A change of numbers of the compiled model: damping, masses, gravity; the usual and the fast way."""

    @abstractmethod
    def change(self, model: Any) -> None:
        """Change a copy of the compiled `mujoco.MjModel` in place; `mj_setConst` is called afterwards."""

    def edit(self, spec: Any) -> None:
        """Make the same change in an `mujoco.MjSpec`, for the improved model as a file.

        Raises:
            NotImplementedError: MJCF cannot say it.
        """
        raise NotImplementedError


class SpecChange(ABC):
    """A change of the model's elements, after which it is compiled again."""

    @abstractmethod
    def edit(self, spec: Any) -> None:
        """Change an `mujoco.MjSpec` in place."""


class StateForce(ABC):
    """A generalised force that MuJoCo's models lack, computed before every step for all runs at once.

    It is stateless: `start` returns it, and `advance` returns the next one.
    """

    @abstractmethod
    def start(self, model: Any, q: Array, v: Array) -> Any:
        """Return the state at the beginning of the runs.

        Args:
            model: the compiled `mujoco.MjModel`.
            q, v: (r, nq) and (r, nv) positions and velocities of each run.
        """

    @abstractmethod
    def advance(self, model: Any, state: Any, q: Array, v: Array, step_s: float) -> tuple[Array, Any]:
        """Return (r, nv) the force during the next step, and the state after it."""


class DriveChange(ABC):
    """A change of the actuators' controls that depends on where they stand, computed before every step for all runs.

    It is stateless: `start` returns it, and `advance` returns the next one.
    """

    @abstractmethod
    def start(self, model: Any) -> Any:
        """Return the state at the beginning of the runs, such as memory to work in."""

    @abstractmethod
    def advance(
        self, model: Any, state: Any, q: Array, v: Array, controls: Array, step_s: float
    ) -> tuple[Array, Any]:
        """Return (r, nu) the controls during the next step, and the state after it.

        Args:
            model: the compiled `mujoco.MjModel`.
            state: of `start` or the step before.
            q, v: (r, nq) and (r, nv) positions and velocities of each run.
            controls: (r, nu) of each run, before the change.
            step_s: length of the step.
        """
