"""What the quasi-static tasks share: their drive, the ramp to it, and the metrics of a settled chain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from pydantic import Field, model_validator

from pliant.errors import UserError
from pliant.interfaces.physics import Simulation
from pliant.interfaces.task import TaskConfig
from pliant.mechanics.kinematics import ChainGeometry
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.rollout import Equilibrium, Inputs, OutsideDomain, Rollout, TaskResult
from pliant.units import Force, Pressure


class ActuatedConfig(TaskConfig):
    """Actuation of a task: a pressure or a tendon force."""

    pressure_pa: Pressure | None = Field(default=None, description="full pressure; this or tendon_force")
    tendon_force_n: Force | None = Field(default=None, description="full tendon force; this or pressure")

    @model_validator(mode="after")
    def _one_drive(self) -> ActuatedConfig:
        if (self.pressure_pa is None) == (self.tendon_force_n is None):
            raise ValueError("give exactly one of 'pressure' and 'tendon_force'")
        return self

    def actuation(self, chain: ChainModel) -> dict[str, float]:
        """Full value of every input of the chain.

        The drive goes to the input of its name or, where chambers or tendons are numbered, to the first; the
        others stay at zero.

        Raises:
            UserError: the chain has no such input.
        """
        name, value = ("pressure_pa", self.pressure_pa)
        if value is None:
            name, value = "tendon_force_n", self.tendon_force_n
        inputs = [actuator.input for actuator in chain.actuators]
        stem, unit = name.rsplit("_", 1)
        first = f"{stem}_1_{unit}"
        driven = name if name in inputs else first
        if driven not in inputs:
            raise UserError(f"the task gives {name} but the chain is driven by {', '.join(inputs)}")
        return {**dict.fromkeys(inputs, 0.0), driven: float(value or 0.0)}


class DriveConfig(ActuatedConfig):
    """Actuation of a quasi-static task, reached in equal steps from zero."""

    steps: int = Field(
        default=11,
        ge=1,
        le=100_000,
        description="recorded levels from zero; 1 goes to the full value at once",
    )


def ramp(simulation: Simulation, config: DriveConfig, tip_force_n: Sequence[float] = (0, 0, 0)) -> TaskResult:
    """Settle at each level of the actuation, loads constant; metrics are those of the last level.

    The history's time is the share of the ramp. `iterations` and `wall_s` of the result are those of it;
    its `outside_domain` holds the worst entry of each joint and variable over all levels.
    """
    chain = simulation.chain
    full = config.actuation(chain)
    shares = np.linspace(0.0, 1.0, config.steps) if config.steps > 1 else np.ones(1)
    force = np.array(tip_force_n, float)
    levels: list[Equilibrium] = []
    for share in shares.tolist():
        simulation.apply(Inputs({name: share * value for name, value in full.items()}, force))
        levels.append(simulation.settle())
    final = replace(
        levels[-1],
        iterations=sum(level.iterations for level in levels),
        wall_s=sum(level.wall_s for level in levels),
        outside_domain=_worst_outside(shares, levels),
    )
    rollout = Rollout(
        time_s=shares,
        actuation=shares[:, None] * np.array(list(full.values())),
        joint_angles=np.array([level.joint_angles for level in levels]),
        markers_m=np.array([level.markers_m for level in levels]),
    )
    unsettled = sum(not level.converged for level in levels)
    return TaskResult(final, {**chain_metrics(chain, final), "unsettled_levels": unsettled}, rollout)


def chain_metrics(chain: ChainModel, final: Equilibrium) -> dict[str, Any]:
    """Tip position, its distance from the straight chain's tip, and bending or extension of the joints.

    `bend_angle_rad` is the sum of the joints' main-axis angles, `max_joint_angle_rad` the largest turn of one
    joint; prismatic chains have `extension_m` and `extension_strain` instead.
    """
    geometry = ChainGeometry.of(chain)
    straight: Array = geometry.markers(np.zeros_like(final.joint_angles))[-1]
    tip = final.tip_m
    metrics: dict[str, Any] = {
        "tip_x_m": float(tip[0]),
        "tip_y_m": float(tip[1]),
        "tip_z_m": float(tip[2]),
        "tip_displacement_m": float(np.linalg.norm(tip - straight)),
    }
    if geometry.kind == "prismatic":
        extension = float(final.joint_angles.sum())
        return metrics | {"extension_m": extension, "extension_strain": extension / chain.length_m}
    return metrics | {
        "bend_angle_rad": float(final.joint_angles[:, geometry.main].sum()),
        "max_joint_angle_rad": float(np.linalg.norm(final.joint_angles, axis=1).max()),
    }


def _worst_outside(shares: Array, levels: Sequence[Equilibrium]) -> tuple[OutsideDomain, ...]:
    worst: dict[tuple[int, str], OutsideDomain] = {}
    for share, level in zip(shares.tolist(), levels, strict=True):
        for entry in level.outside_domain:
            key = (entry.module, entry.variable)
            if key not in worst or abs(entry.excess) > abs(worst[key].excess):
                worst[key] = replace(entry, time_s=share)
    return tuple(worst[key] for key in sorted(worst))
