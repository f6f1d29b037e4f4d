"""Settings of the task `reach_around`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from pydantic import Field, model_validator

from pliant.config.chain import BaseConfig, Count
from pliant.interfaces.base import FrozenModel
from pliant.interfaces.input_levels import InputLevels
from pliant.interfaces.study_loads import Actuation
from pliant.interfaces.task import TaskConfig
from pliant.units import Length, Ratio, Time
from pliant_plugins.tasks.obstacles import ObstacleConfig


class ReachingArmConfig(FrozenModel):
    """One copy of the chain: where its tip shall be, where it stands, how it is actuated."""

    tip_m: tuple[Length, Length, Length] = Field(description="where the tip shall be, world")
    direction: tuple[float, float, float] | None = Field(
        default=None, description="where the tip's axis shall point, world"
    )
    base: BaseConfig | None = Field(default=None, description="pose of its base; the chain's by default")
    inputs: InputLevels = Field(
        default_factory=dict,
        description="full value of each input; left out, inverse statics among the obstacles finds them",
    )

    @model_validator(mode="after")
    def _no_mount(self) -> ReachingArmConfig:
        if self.base is not None and self.base.mount is not None:
            raise ValueError("an arm's base stands in the world here; leave 'mount' out")
        if self.direction is not None and not any(self.direction):
            raise ValueError("'direction' has no length")
        return self


class ReachAroundConfig(TaskConfig):
    """``task: {kind: reach_around, arms: [{tip: [40 mm, 0 mm, -60 mm]}], obstacles: [{sphere: 9 mm, …}]}``."""

    kind: Literal["reach_around"] = "reach_around"
    arms: tuple[ReachingArmConfig, ...] = Field(
        min_length=1, description="copies of the chain, one for each tip"
    )
    obstacles: tuple[ObstacleConfig, ...] = Field(min_length=1, description="fixed bodies")
    contact: Literal["avoid", "allow"] = Field(
        default="avoid",
        description="avoid: inverse statics keeps `clearance` from obstacles; allow: it may press on them",
    )
    clearance_m: Length = Field(
        default=1e-3, ge=0.0, description="distance between chain and obstacles that counts as clear"
    )
    radius_m: Length | None = Field(
        default=None,
        gt=0,
        description="of the capsules about the chain's pieces, which collide; by default the chain's half width",
    )
    bounds: Mapping[str, tuple[Actuation, Actuation]] = Field(
        default_factory=dict,
        description="low and high of inputs to be found; left out, the domain of the law",
    )
    samples: Count = Field(
        default=128, ge=2, le=100_000, description="equilibria from which inverse statics starts"
    )
    ramp_time_s: Time = Field(default=2.0, gt=0, description="from no actuation to full, linear")
    hold_time_s: Time = Field(default=2.0, gt=0, description="at full actuation, before it is measured")
    frames: Count = Field(default=25, ge=1, le=10_000, description="recorded levels of the ramp")
    friction: Ratio = Field(
        default=0.0, ge=0, description="coefficient of chain and obstacles; engine quasistatic has 0 only"
    )
