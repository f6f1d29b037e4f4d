"""Chains that are ramped to their full actuation: the drive that quasi-static tasks share, free bending, tip load."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from pliant.errors import UserError
from pliant.interfaces.input_levels import InputLevels
from pliant.interfaces.simulation import Simulation
from pliant.interfaces.task import Task, TaskConfig
from pliant.records.actuation import actuation_kind
from pliant.records.chain import ChainModel
from pliant.records.rollout import Inputs, TaskResult
from pliant.units import Force, Mass, Pressure
from pliant_plugins.tasks.levels import MEASURED, Level, levels_result, settle_levels


class ActuatedConfig(TaskConfig):
    """Actuation of a task: a pressure, a tendon force, or a value for each of several inputs."""

    pressure_pa: Pressure | None = Field(default=None, description="full pressure; this or tendon_force")
    tendon_force_n: Force | None = Field(default=None, description="full tendon force; this or pressure")
    inputs: InputLevels = Field(
        default_factory=dict,
        description="instead: full value of each input, e.g. {pressure_1_pa: 15 kPa, pressure_2_pa: 5 kPa}; 0 for "
        "those that are not named",
    )

    @model_validator(mode="after")
    def _one_drive(self) -> ActuatedConfig:
        given = (self.pressure_pa is not None, self.tendon_force_n is not None, bool(self.inputs))
        if sum(given) != 1 and not self.is_driven_otherwise():
            raise ValueError("give exactly one of 'pressure' and 'tendon_force', or 'inputs'")
        return self

    def canonical(self) -> dict[str, Any]:
        """Return the canonical form, without `inputs` if none are given, as in keys of earlier results."""
        return {name: value for name, value in super().canonical().items() if name != "inputs" or value}

    def is_driven_otherwise(self) -> bool:
        """Return whether another key defines the actuation, so that these may be omitted."""
        return False

    def actuation(self, chain: ChainModel) -> dict[str, float]:
        """Return full value of every input of the chain; see `driven`.

        Raises:
            UserError: the chain has no such input.
        """
        if self.inputs:
            known = dict.fromkeys((actuator.input for actuator in chain.actuators), 0.0)
            unknown = [name for name in self.inputs if name not in known]
            if unknown:
                raise UserError(
                    f"the task drives {', '.join(unknown)}, and the chain's inputs are {', '.join(known)}: name these."
                )
            return {**known, **self.inputs}
        if self.pressure_pa is not None:
            return driven(chain, "pressure_pa", self.pressure_pa)
        return driven(chain, "tendon_force_n", self.tendon_force_n or 0.0)


class DriveConfig(ActuatedConfig):
    """Actuation of a quasi-static task, reached in equal steps from zero."""

    steps: int = Field(
        default=11,
        ge=1,
        le=100_000,
        description="recorded levels from zero; 1 goes to the full value at once",
    )


def driven(chain: ChainModel, name: str, value: float) -> dict[str, float]:
    """Return a value for every input of the chain.

    The drive goes to the input of its name or, where chambers or tendons are numbered, to the first; the others
    stay at zero.

    Raises:
        UserError: the chain has no such input.
    """
    inputs = [actuator.input for actuator in chain.actuators]
    stem, unit = name.rsplit("_", 1)
    first = name if name in inputs else f"{stem}_1_{unit}"
    if first not in inputs:
        raise UserError(
            f"the task gives '{stem}', but the laws of the chain are driven by {', '.join(inputs)}: give the task "
            "that input, or state the law's own in 'actuation_name'."
        )
    return {**dict.fromkeys(inputs, 0.0), first: float(value)}


def ramp(simulation: Simulation, config: DriveConfig, tip_force_n: Sequence[float] = (0, 0, 0)) -> TaskResult:
    """Settle at each level of the actuation, loads constant; see `levels.result_of`."""
    levels = ramp_levels(simulation.chain, config, tip_force_n)
    return levels_result(simulation.chain, levels, settle_levels(simulation, levels))


def ramp_levels(
    chain: ChainModel, config: DriveConfig, tip_force_n: Sequence[float] = (0, 0, 0)
) -> list[Level]:
    """Return equal steps of the actuation from zero; their time is the share of the ramp, their name e.g. "12 kPa"."""
    full = config.actuation(chain)
    shares = np.linspace(0.0, 1.0, config.steps) if config.steps > 1 else np.ones(1)
    force = np.array(tip_force_n, float)
    name, most = max(full.items(), key=lambda item: abs(item[1]))
    factor, unit = (1e3, "kPa") if name.endswith("_pa") else (1.0, actuation_kind(name).unit)
    return [
        Level(
            share,
            Inputs({name: share * value for name, value in full.items()}, force),
            f"{share * most / factor:g} {unit}",
        )
        for share in shares.tolist()
    ]


class FreeBendingConfig(DriveConfig):
    """``task: {kind: free_bending, pressure: 15 kPa}``; `tendon_force` instead for tendons; `steps` levels.

    Gravity and payload are the chain's.
    """

    kind: Literal["free_bending"] = "free_bending"


class FreeBending(Task):
    """A ramp of the actuation from zero and a measurement of the settled chain."""

    config: FreeBendingConfig

    @property
    def mounts(self) -> bool:
        return True

    def measures(self) -> tuple[str, ...]:
        return MEASURED

    def run(self, simulation: Simulation) -> TaskResult:
        return ramp(simulation, self.config)


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
    """A loaded tip, a ramp of the actuation from zero and a measurement of the settled chain."""

    config: TipLoadConfig

    def prepare(self, chain: ChainModel) -> ChainModel:
        return chain if self.config.payload_kg is None else chain.with_(payload_kg=self.config.payload_kg)

    @property
    def mounts(self) -> bool:
        return True

    def measures(self) -> tuple[str, ...]:
        return MEASURED

    def run(self, simulation: Simulation) -> TaskResult:
        return ramp(simulation, self.config, self.config.tip_force_n)
