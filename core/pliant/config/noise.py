"""The `noise` block: the variation of a task's conditions from trial to trial."""

from __future__ import annotations

import math

from pydantic import Field, model_validator

from pliant.interfaces.base import FrozenModel
from pliant.units import Pressure, Ratio


class NoiseConfig(FrozenModel):
    """Half widths of uniform distributions, drawn again in every trial from the task's seed."""

    friction: Ratio = Field(0.0, ge=0, lt=1, description="of the coefficient of friction, relative")
    pressure_pa: Pressure = Field(0.0, ge=0, description="of the pressure")
    placement: Ratio = Field(
        0.0, ge=0, le=1, description="of the object's place: radius of a disc, per radius of the object"
    )


class UncertaintyConfig(FrozenModel):
    """The task is run again with laws drawn from the error bars; `{}` takes the defaults."""

    samples: int = Field(24, ge=8, le=2000, description="runs with drawn laws")
    level: Ratio = Field(0.9, gt=0, lt=1, description="share of the runs that the stated intervals hold")
    seed: int = Field(0, ge=0, description="of the draws")

    @model_validator(mode="after")
    def _enough(self) -> UncertaintyConfig:
        least = (
            math.ceil(self.level / (1 - self.level) - 1e-9) - 1
        )  # the run with the laws themselves is one more
        if self.samples < least:
            raise ValueError(
                f"a level of {self.level:g} needs at least {least} samples, and there are {self.samples}"
            )
        return self
