"""Task: what the robot is asked to do, alone or in a scene with contact."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from typing import Literal

from pydantic import Field

from pliant.interfaces.base import ComponentConfig, Configured
from pliant.interfaces.effect import Readings
from pliant.interfaces.physics import SceneSimulation, Simulation
from pliant.records.chain import ChainModel
from pliant.records.rollout import TaskResult
from pliant.records.scene import Scene

SceneEngine = Callable[[Scene], SceneSimulation]


class TaskConfig(ComponentConfig):
    """Base of a task's config: actuation and loads."""

    outside_domain: Literal["report", "error"] = Field(
        default="report",
        description="what a joint outside its law's data means: a line in the result, or an error",
    )


class Task(Configured[TaskConfig]):
    """The simulate stage calls `prepare`, has the engine build what it returns, then calls `run`."""

    @property
    def mounts(self) -> bool:
        """Whether it also makes sense for a chain whose base moves, on somebody else's arm (`ChainModel.mount`)."""
        return False

    def prepare(self, chain: ChainModel) -> ChainModel:
        """The chain with the task's own gravity, payload or base; loads of the task win over the chain's."""
        return chain

    def check_reach(self, length_m: float) -> None:
        """Refuse, before a search begins, what no chain of this straight length can do; nothing by default.

        A search gives the longest chain that its bounds allow. A simulation does not ask.

        Raises:
            UserError: the task is out of reach, with both lengths.
        """
        return

    def measures(self) -> tuple[str, ...]:
        """Names of the numbers that `run` may measure, unit in the name; empty where they are not known before.

        A search looks up what its formulas name before anything is simulated.
        """
        return ()

    def against_readings(
        self, chain: ChainModel, result: TaskResult, reported: Callable[[Readings], Readings]
    ) -> Mapping[str, float]:
        """Further metrics, that need what the sensors say over time; none by default.

        Args:
            chain: the chain that ran.
            result: what `run` left.
            reported: what the sensors make of true readings, see `Model.reported`.
        """
        return {}

    @abstractmethod
    def run(self, simulation: Simulation) -> TaskResult:
        """Drive the simulation and measure it. Metrics are SI with the unit in the name."""


class SceneTask(Configured[TaskConfig]):
    """A task with contact. It builds scenes of the chain, one per trial, and drives each of them."""

    @property
    def mounts(self) -> bool:
        """See `Task.mounts`."""
        return False

    @property
    def arms_touch(self) -> bool:
        """Whether its scenes have arms that touch each other (`Scene.arms_touch`)."""
        return False

    def prepare(self, chain: ChainModel) -> ChainModel:
        """The chain with the task's own loads, before effects are applied."""
        return chain

    def check_reach(self, length_m: float) -> None:
        """Refuse what no chain of this straight length (m) can do; see `Task.check_reach`."""
        return

    def measures(self) -> tuple[str, ...]:
        """Names of the numbers that `run` may measure; see `Task.measures`."""
        return ()

    @abstractmethod
    def scene(self, chain: ChainModel) -> Scene:
        """The nominal scene, without noise: what viewers draw and exports write."""

    @abstractmethod
    def run(self, chain: ChainModel, engine: SceneEngine) -> TaskResult:
        """Build scenes with `engine`, drive and measure them. Metrics are SI with the unit in the name."""
