"""Task: the motion or manipulation that is simulated, of a single chain or in a scene with contact."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from pliant.interfaces.base import ComponentConfig, Configured
from pliant.interfaces.effect import Readings
from pliant.interfaces.simulation import SceneSimulation, Simulation
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.rollout import TaskResult
from pliant.records.scene import Scene

SceneEngine = Callable[[Scene], SceneSimulation]


class TaskConfig(ComponentConfig):
    """Base of a task's config: actuation and loads.

    `places_base`: the task itself places the chain's base, so that `chain.base` has no effect.
    """

    places_base: ClassVar[bool] = False
    outside_domain: Literal["report", "error"] = Field(
        default="report",
        description="what a joint outside its law's data means: a line in the result, or an error",
    )

    def tip_load(self, payload_kg: float) -> tuple[float, float]:
        """Return payload (kg) and magnitude of the force (N) at the tip, with `payload_kg` of a chain by default."""
        own, force_n = getattr(self, "payload_kg", None), getattr(self, "tip_force_n", 0.0)
        return float(payload_kg if own is None else own), float(np.linalg.norm(np.asarray(force_n, float)))


class Task(Configured[TaskConfig]):
    """A task of a single chain. The simulate stage calls `prepare`, builds the chain in the engine, calls `run`."""

    @property
    def mounts(self) -> bool:
        """Return whether the task supports a chain on a moving base, an imported arm (`ChainModel.mount`)."""
        return False

    def prepare(self, chain: ChainModel) -> ChainModel:
        """Return the chain with the task's own gravity, payload or base; loads of the task override the chain's."""
        return chain

    def check_reach(self, length_m: float) -> None:
        """Refuse before a search what no chain of this straight length can do; by default nothing is refused.

        A search passes the longest chain that its bounds allow. A simulation does not call it.

        Raises:
            UserError: the task is out of reach, with both lengths.
        """
        return

    def measures(self) -> tuple[str, ...]:
        """Return the names of the numbers that `run` may measure, unit in the name; empty if not known beforehand.

        A search checks the names in its formulas before any simulation.
        """
        return ()

    def against_readings(
        self, chain: ChainModel, result: TaskResult, reported: Callable[[Readings], Readings]
    ) -> Mapping[str, float]:
        """Return further metrics that need the sensor readings over time; none by default.

        Args:
            chain: the simulated chain.
            result: of `run`.
            reported: maps true readings to sensor values, see `Model.reported`.
        """
        return {}

    def residuals(self, chain: ChainModel, result: TaskResult) -> Mapping[str, Array]:
        """Return metric → numbers whose sum of squares is the metric's square; none by default.

        A search whose objective is such a metric is polished as a least-squares problem.

        Args:
            chain: the simulated chain.
            result: of `run`.
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
        """Return whether its scenes have arms that collide with each other (`Scene.arms_touch`)."""
        return False

    @property
    def free_bases(self) -> bool:
        """Return whether its scenes have arms on free objects (`Arm.base_object`)."""
        return False

    @property
    def settles(self) -> bool:
        """Return whether equilibria suffice: its scenes have fixed obstacles and no free objects."""
        return False

    def prepare(self, chain: ChainModel) -> ChainModel:
        """Return the chain with the task's own loads, before effects are applied."""
        return chain

    def check_reach(self, length_m: float) -> None:
        """Refuse what no chain of this straight length (m) can do; see `Task.check_reach`."""
        return

    def measures(self) -> tuple[str, ...]:
        """Return the names of the numbers that `run` may measure; see `Task.measures`."""
        return ()

    @abstractmethod
    def scene(self, chain: ChainModel) -> Scene:
        """Return the nominal scene without noise, for viewers and exports."""

    @abstractmethod
    def run(self, chain: ChainModel, engine: SceneEngine) -> TaskResult:
        """Build scenes with `engine`, drive and measure them. Metrics are SI with the unit in the name."""
