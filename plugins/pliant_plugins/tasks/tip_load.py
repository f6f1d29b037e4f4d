"""Tip load: the chain under its actuation with a payload or a dead force at its tip."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pliant.interfaces.physics import Simulation
from pliant.interfaces.task import Task
from pliant.records.chain import ChainModel
from pliant.records.rollout import TaskResult
from pliant.units import Force, Mass
from pliant_plugins.tasks.levels import MEASURED
from pliant_plugins.tasks.ramp import DriveConfig, ramp


class TipLoadConfig(DriveConfig):
    """``task: {kind: tip_load, pressure: 15 kPa, payload: 13 g}``; loads act at every level of the ramp."""

    kind: Literal["tip_load"] = "tip_load"
    payload_kg: Mass | None = Field(
        default=None, ge=0.0, description="point mass at the tip; left out, the chain's own payload stays"
    )
    tip_force_n: tuple[Force, Force, Force] = Field(
        default=(0.0, 0.0, 0.0), description="dead force at the tip, world frame"
    )


class TipLoad(Task):
    """Loads the tip, ramps the actuation from zero and measures the settled chain."""

    config: TipLoadConfig

    def prepare(self, chain: ChainModel) -> ChainModel:
        if self.config.payload_kg is None:
            return chain
        return chain.with_(payload_kg=self.config.payload_kg)

    def measures(self) -> tuple[str, ...]:
        return MEASURED

    def run(self, simulation: Simulation) -> TaskResult:
        return ramp(simulation, self.config, self.config.tip_force_n)
