"""Settings of the task `hold_and_turn`."""

from __future__ import annotations

from itertools import pairwise
from typing import Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from pliant.config.chain import Count
from pliant.interfaces.base import FrozenModel
from pliant.interfaces.input_levels import InputLevels
from pliant.interfaces.study_loads import Actuation
from pliant.units import Angle, Length, Ratio, Time
from pliant_plugins.tasks.grasp.config import HandConfig


class KeyframeConfig(FrozenModel):
    """Inputs of the fingers at one time, reached linearly: ``{time: 1 s, inputs: [{pressure_1_pa: 8 kPa}]}``."""

    time_s: Time = Field(gt=0, description="from the start of the cycle")
    inputs: tuple[InputLevels, ...] = Field(
        min_length=1,
        description="one for all fingers, or one for each, repeated in turn; what is not named keeps its value",
    )


class WaveConfig(FrozenModel):
    """A sine of one input: ``{input: pressure_2_pa, mean: 4 kPa, amplitude: 3 kPa}``."""

    input: str = Field(description="name of the input")
    amplitude: Actuation = Field(description="of the sine")
    mean: Actuation | None = Field(
        default=None, description="about which it swings; by default that of the grasp"
    )
    phases_rad: tuple[Angle, ...] = Field(
        default=(0.0,),
        min_length=1,
        description="at the start of a cycle, one for each finger, repeated in turn",
    )


class TurnConfig(FrozenModel):
    """The cycle that turns the object: keyframes, or waves of a period."""

    keyframes: tuple[KeyframeConfig, ...] = Field(
        default=(), description="their times rise; the last one ends the cycle. These or `waves`"
    )
    waves: tuple[WaveConfig, ...] = Field(default=(), description="periodic inputs; others keep their value")
    period_s: Time = Field(default=2.0, gt=0, description="of the waves")
    cycles: Count = Field(default=1, ge=1, le=1000, description="how often the cycle is repeated")

    @model_validator(mode="after")
    def _one_way(self) -> TurnConfig:
        if bool(self.keyframes) == bool(self.waves):
            raise ValueError("give either 'keyframes' or 'waves'")
        if self.keyframes and self.period_s != type(self).model_fields["period_s"].default:
            raise ValueError("'period' is of 'waves'; keyframes end with their last time")
        times = [0.0, *(one.time_s for one in self.keyframes)]
        if any(b <= a for a, b in pairwise(times)):
            raise ValueError("the times of 'keyframes' rise, each above the one before")
        return self


class HoldAndTurnConfig(HandConfig):
    """``task: {kind: hold_and_turn, object: cylinder, inputs: {pressure_1_pa: 8 kPa}, turn: {keyframes: […]}}``.

    The inputs of the task are those of every finger while it takes hold.
    """

    kind: Literal["hold_and_turn"] = "hold_and_turn"
    turn: TurnConfig = Field(description="inputs of the fingers while they turn the object")
    axis: tuple[float, float, float] = Field(
        default=(0.0, 0.0, 1.0), description="about which the turn is measured, world"
    )
    support: Literal["table", "carried"] = Field(
        default="table",
        description="table: the object stands on it; carried: it is lifted before it is turned",
    )
    table_friction: Ratio = Field(
        default=1.0, ge=0, description="coefficient of the table; a pair takes the product of both"
    )
    radius_m: Length | None = Field(
        default=None,
        gt=0,
        description="of capsules about the finger's straight pieces, which then collide in place of its own shapes",
    )
    lower_height_m: Length = Field(default=0.0, ge=0, description="how far the fingers are lowered at first")
    lift_height_m: Length = Field(
        default=0.02, gt=0, description="how far the fingers are lifted if it is carried"
    )

    @field_validator("axis")
    @classmethod
    def _has_a_direction(cls, axis: tuple[float, float, float]) -> tuple[float, float, float]:
        if np.linalg.norm(axis) < 1e-9:
            raise ValueError("'axis' has no length")
        return axis
