"""The block `experiment`: limits of the bench, what a person can set, budget, and safety."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from pliant.interfaces.base import FrozenModel
from pliant.units import Ratio, Time, parse_quantity, si_unit
from pliant_bench.bench import ChannelLimits


class InputLimitsConfig(FrozenModel):
    """Limits of an input: ``{low: 0 kPa, high: 15 kPa, rate: 5 kPa/s}``; a text has its unit, a number is SI."""

    low: float | str = Field(0.0, description="lowest value")
    high: float | str = Field(description="highest value")
    rate: float | str | None = Field(None, description="largest change per second")
    acceleration: float | str | None = Field(None, description="largest change of the rate per second")
    dwell_s: Time = Field(0.0, ge=0, description="least time at rest between two changes")

    def limits(self, name: str) -> ChannelLimits:
        """Return the limits in SI, in the unit of the input's name; raise `UnitError` for another unit."""
        unit = si_unit(name) or "dimensionless"

        def si(value: float | str | None, per: str = "") -> float:
            if value is None:
                return np.inf
            return parse_quantity(value, unit + per) if isinstance(value, str) else float(value)

        return ChannelLimits(
            si(self.low), si(self.high), si(self.rate, "/s"), si(self.acceleration, "/s^2"), self.dwell_s
        )


class EnvelopeConfig(FrozenModel):
    """Range that the readings of an output must not leave; a run that leaves it is stopped and vented."""

    low: float | str | None = Field(None, description="lowest reading")
    high: float | str | None = Field(None, description="highest reading")

    def limits(self, name: str) -> ChannelLimits:
        """Return the range in SI, in the unit of the output's name."""
        unit = si_unit(name) or "dimensionless"

        def si(value: float | str | None, otherwise: float) -> float:
            if value is None:
                return otherwise
            return parse_quantity(value, unit) if isinstance(value, str) else float(value)

        return ChannelLimits(si(self.low, -np.inf), si(self.high, np.inf))


def _as_levels(value: Any) -> Any:
    return tuple(value) if isinstance(value, list | tuple) else (value,)


Levels = Annotated[tuple[float | str, ...], BeforeValidator(_as_levels)]


class ExperimentConfig(FrozenModel):
    """What `pliant experiment` may do.

    Attributes:
        manual: conditions that a person can set, each with its levels; the first is the present one.
    """

    inputs: dict[str, InputLimitsConfig] = Field(description="every input of the bench with its limits")
    outputs: dict[str, EnvelopeConfig] = Field(
        default_factory=dict, description="ranges that readings must not leave"
    )
    manual: dict[str, Levels] = Field(
        default_factory=dict,
        description="what a person can set between runs: {payload_kg: [0, 50 g]}, the first as it is now",
    )
    period_s: Time = Field(0.05, gt=0, description="sampling period")
    minutes: float = Field(60.0, gt=0, description="bench time at most, with setting up")
    runs: int = Field(12, ge=2, description="runs at most")
    longest_run_s: Time = Field(300.0, gt=0, description="duration of a run at most")
    set_up_minutes: float = Field(0.2, ge=0, description="between two runs, without a person")
    manual_minutes: float = Field(2.0, ge=0, description="for a person to set one condition")
    first_repeats: int = Field(3, ge=2, description="repeats of the first condition, to learn the noise")
    rounds: int = Field(2, ge=1, description="rounds for which a verdict has to hold")
    silence_s: Time = Field(0.5, gt=0, description="without a reading for this long the bench is vented")
    missed_prediction: Ratio | None = Field(
        None, gt=1, description="a run is stopped at this many times the expected error of its prediction"
    )
    unattended: bool = Field(False, description="--yes is allowed for runs on hardware")

    def levels(self, name: str) -> tuple[float, ...]:
        """Return the levels of a condition that a person can set, SI; the first is the present one."""
        unit = si_unit(name) or "dimensionless"
        return tuple(
            parse_quantity(level, unit) if isinstance(level, str) else float(level)
            for level in self.manual[name]
        )

    @property
    def input_limits(self) -> dict[str, ChannelLimits]:
        """Return the limits of every input, SI."""
        return {name: limits.limits(name) for name, limits in self.inputs.items()}

    @property
    def standing(self) -> dict[str, float]:
        """Return the conditions as they are before the first run, SI."""
        return {name: self.levels(name)[0] for name in self.manual}

    @model_validator(mode="after")
    def _check_ranges(self) -> ExperimentConfig:
        if not self.inputs:
            raise ValueError("'inputs' needs the limits of every input of the bench")
        return self
