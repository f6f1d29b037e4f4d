"""Settings of the task `push`."""

from __future__ import annotations

from itertools import pairwise
from typing import Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from pliant.config.chain import Count
from pliant.interfaces.base import FrozenModel
from pliant.units import Length, Ratio, Time
from pliant_plugins.tasks.ramp import ActuatedConfig


class WallConfig(FrozenModel):
    """A flat wall: a point on its surface, and the normal that points to the chain."""

    position_m: tuple[Length, Length, Length] = Field(description="a point on its surface, world")
    normal: tuple[float, float, float] = Field(description="out of the wall, toward the chain, world")

    @model_validator(mode="after")
    def _has_a_direction(self) -> WallConfig:
        if np.linalg.norm(self.normal) < 1e-9:
            raise ValueError("'normal' has no length")
        return self


class PushConfig(ActuatedConfig):
    """``task: {kind: push, pressure: 8 kPa, wall: {position: [30 mm, 0 mm, 0 mm], normal: [-1, 0, 0]}}``."""

    kind: Literal["push"] = "push"
    wall: WallConfig = Field(description="what the chain presses on")
    distances_m: tuple[Length, ...] = Field(
        default=(0.0, 1e-3, 2e-3),
        min_length=1,
        description="how far the wall is moved back along its normal, rising; stiffness needs two",
    )
    levels: Count = Field(
        default=4, ge=1, le=1000, description="equal levels of the actuation, the last is full"
    )
    radius_m: Length | None = Field(
        default=None, gt=0, description="of the capsules that collide; by default the chain's half width"
    )
    ramp_time_s: Time = Field(default=0.5, gt=0, description="from one level to the next, linear")
    hold_time_s: Time = Field(default=1.5, gt=0, description="at each level, before it is measured")
    friction: Ratio = Field(
        default=0.0, ge=0, description="coefficient of chain and wall; engine quasistatic has 0 only"
    )

    @field_validator("distances_m")
    @classmethod
    def _rising(cls, values: tuple[float, ...]) -> tuple[float, ...]:
        if any(b <= a for a, b in pairwise(values)):
            raise ValueError("'distances' rise, each above the one before")
        return values
