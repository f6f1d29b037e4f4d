"""Helical hang: the pressurised chain with one weight after the other at its tip."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from pliant.interfaces.simulation import Simulation
from pliant.interfaces.task import Task
from pliant.records.chain import GRAVITY_M_S2
from pliant.records.rollout import Inputs, TaskResult
from pliant.units import Mass
from pliant_plugins.tasks.curves import DRAWN, resampled
from pliant_plugins.tasks.levels import (
    MEASURED,
    Level,
    as_list,
    backbone,
    levels_result,
    ring_positions,
    settle_levels,
    why_not_held,
)
from pliant_plugins.tasks.ramp import DriveConfig, ramp_levels


class HelicalHangConfig(DriveConfig):
    """``task: {kind: helical_hang, pressure: 15 kPa, loads: [0 g, 10 g, 20 g, 50 g]}``."""

    kind: Literal["helical_hang"] = "helical_hang"
    loads_kg: tuple[Annotated[Mass, Field(ge=0)], ...] = Field(
        default=(0.0, 0.01, 0.02, 0.05),
        min_length=1,
        description="weights at the tip, one after the other, as dead forces along gravity",
    )


class HelicalHang(Task):
    """A ramp of the actuation without a load, then equilibria under each load from the one before.

    A load is a force load · g at the tip, not a mass: the chain's gravity, or the standard one where it has none.
    """

    config: HelicalHangConfig

    def measures(self) -> tuple[str, ...]:
        return (*MEASURED, "held_kg")

    def run(self, simulation: Simulation) -> TaskResult:
        chain, config = simulation.chain, self.config
        gravity = np.asarray(chain.gravity_m_s2, float)
        down = gravity if gravity.any() else np.array(GRAVITY_M_S2)
        levels = ramp_levels(chain, config)
        full, first = levels[-1], len(levels)
        for number, load in enumerate(config.loads_kg, start=1):
            inputs = Inputs(full.inputs.actuation, load * down)
            levels.append(Level(full.time_s + number, inputs, f"{1e3 * load:g} g"))
        found = settle_levels(simulation, levels)
        result = levels_result(chain, levels, found, asked=range(first, len(levels)))
        hung = found[first:]
        rings = np.array([ring_positions(chain, one.joint_angles) for one in hung])
        lines = np.array([resampled(backbone(chain, one.joint_angles), DRAWN) for one in hung])
        held = [load for load, one in zip(config.loads_kg, hung, strict=True) if not why_not_held(chain, one)]
        metrics = {
            **result.metrics,
            "loads_kg": list(config.loads_kg),
            "tips_m": as_list(np.array([one.tip_m for one in hung])),
            "rings_m": as_list(rings),
            "backbone_points_m": as_list(lines),
            "converged": [one.converged for one in hung],
            "held_kg": max(held, default=None),
        }
        return replace(result, metrics=metrics)
