"""The `noise` block: how far a task's conditions vary from trial to trial."""

from __future__ import annotations

from pydantic import Field

from pliant.interfaces.base import FrozenModel
from pliant.units import Pressure, Ratio


class NoiseConfig(FrozenModel):
    """Half widths of uniform distributions, drawn anew in every trial from the task's seed."""

    friction: Ratio = Field(default=0.0, ge=0, lt=1, description="of the coefficient of friction, relative")
    pressure_pa: Pressure = Field(default=0.0, ge=0, description="of the pressure")
    placement: Ratio = Field(
        default=0.0,
        ge=0,
        le=1,
        description="of the object's place: radius of a disc, per radius of the object",
    )
