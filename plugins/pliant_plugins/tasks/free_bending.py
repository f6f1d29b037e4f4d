"""Free bending: the chain under its actuation and its own weight, nothing at the tip."""

from __future__ import annotations

from typing import Literal

from pliant.interfaces.physics import Simulation
from pliant.interfaces.task import Task
from pliant.records.rollout import TaskResult
from pliant_plugins.tasks.levels import MEASURED
from pliant_plugins.tasks.ramp import DriveConfig, ramp


class FreeBendingConfig(DriveConfig):
    """``task: {kind: free_bending, pressure: 15 kPa}``; `tendon_force` instead for tendons; `steps` levels.

    Gravity and payload are the chain's.
    """

    kind: Literal["free_bending"] = "free_bending"


class FreeBending(Task):
    """Ramps the actuation from zero and measures the settled chain."""

    config: FreeBendingConfig

    def measures(self) -> tuple[str, ...]:
        return MEASURED

    def run(self, simulation: Simulation) -> TaskResult:
        return ramp(simulation, self.config)
