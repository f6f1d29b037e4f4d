"""Settings of the task `crawl`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from pliant.config.chain import BaseConfig, Count
from pliant.interfaces.base import FrozenModel
from pliant.interfaces.study_loads import Actuation
from pliant.interfaces.task import TaskConfig
from pliant.records.design import Array
from pliant.units import Length, Mass, Ratio, Time

Waveform = Literal["sine", "trapezoid"]
TRAPEZOID = ("rise", "hold", "fall")


class InputGaitConfig(FrozenModel):
    """One input over a period: from `low` to `high` and back, `phase` periods later than the clock."""

    high: Actuation = Field(description="largest value")
    low: Actuation = Field(default=0.0, description="smallest value")
    phase: Ratio = Field(default=0.0, description="delay as a share of the period; negative: earlier")
    rise: Ratio = Field(
        default=0.25, gt=0, lt=1, description="of a trapezoid: share of the period from low to high"
    )
    hold: Ratio = Field(default=0.25, ge=0, lt=1, description="of a trapezoid: share of the period at `high`")
    fall: Ratio = Field(
        default=0.25, gt=0, lt=1, description="of a trapezoid: share of the period from high to low"
    )

    @model_validator(mode="after")
    def _within_a_period(self) -> InputGaitConfig:
        if self.low > self.high:
            raise ValueError("'low' is above 'high'; a later 'phase' turns an input round")
        if self.rise + self.hold + self.fall > 1.0 + 1e-12:
            raise ValueError("'rise', 'hold' and 'fall' are shares of one period: 1 together at most")
        return self

    def at(self, clock: Array, waveform: Waveform) -> Array:
        """Return the input at times `clock` in periods."""
        share = np.mod(clock - self.phase, 1.0)
        if waveform == "sine":
            level = 0.5 * (1.0 - np.cos(2 * np.pi * share))
        else:
            top = self.rise + self.hold
            level = np.interp(share, [0.0, self.rise, top, top + self.fall], [0.0, 1.0, 1.0, 0.0])
        return np.asarray(self.low + (self.high - self.low) * level)


class CrawlerArmConfig(FrozenModel):
    """One copy of the chain: where it stands on the crawler, and how much later it moves."""

    base: BaseConfig = Field(
        default=BaseConfig(direction=(1.0, 0.0, 0.0), roll_rad=math.pi),
        description="pose of its base in the crawler's frame, whose z is up; by default along x, bending down",
    )
    phase: Ratio = Field(default=0.0, description="delay of all its inputs as a share of the period")

    @model_validator(mode="after")
    def _no_mount(self) -> CrawlerArmConfig:
        if self.base.mount is not None:
            raise ValueError("a crawler's chain stands on the crawler; leave 'mount' out")
        return self


class CrawlerBodyConfig(FrozenModel):
    """A rigid box that carries the bases, its centre at the origin of the crawler's frame."""

    box_m: tuple[Length, Length, Length] = Field(description="its edges")
    mass_kg: Mass = Field(gt=0, description="evenly distributed")

    @model_validator(mode="after")
    def _has_edges(self) -> CrawlerBodyConfig:
        if min(self.box_m) <= 0.0:
            raise ValueError("the edges of a 'box' are above 0")
        return self


class FeetConfig(FrozenModel):
    """Spheres at both sides of a chain's base and of its tip, without mass."""

    radius_m: Length = Field(gt=0, description="of each sphere")
    width_m: Length = Field(gt=0, description="between the centres of a pair, across the plane of bending")
    base: bool = Field(default=True, description="whether there is a pair at the base")


class CrawlConfig(TaskConfig):
    """``task: {kind: crawl, period: 1 s, gait: {pressure_pa: {high: 8 kPa}}}``; the chain lies on a floor."""

    places_base: ClassVar[bool] = True
    kind: Literal["crawl"] = "crawl"
    gait: Mapping[str, InputGaitConfig] = Field(
        min_length=1, description="each input over a period; inputs that are not named stay at 0"
    )
    waveform: Waveform = Field(default="sine", description="of every input")
    period_s: Time = Field(default=1.0, gt=0, description="of the gait")
    periods: Count = Field(default=2, ge=1, le=1000, description="which are measured")
    settling_periods: Count = Field(default=3, ge=0, le=1000, description="before them, not measured")
    commands: Count = Field(
        default=50,
        ge=4,
        le=10_000,
        description="equal steps of a period, in each of which inputs are constant",
    )
    rest_time_s: Time = Field(
        default=0.5, gt=0, description="before the gait: from no actuation to its first values, linear"
    )
    direction: tuple[Ratio, Ratio, Ratio] = Field(
        default=(1.0, 0.0, 0.0), description="horizontal, along which displacement is measured"
    )
    friction: Ratio = Field(default=0.5, ge=0, description="coefficient of Coulomb friction on the floor")
    arms: tuple[CrawlerArmConfig, ...] = Field(
        default=(), max_length=12, description="copies of the chain; left out, one along x that bends down"
    )
    body: CrawlerBodyConfig | None = Field(
        default=None, description="carries the bases; left out, the base pieces alone are one rigid body"
    )
    feet: FeetConfig | None = Field(default=None, description="spheres on which every chain stands")
    radius_m: Length | None = Field(
        default=None,
        gt=0,
        description="of capsules about the chain's pieces, which then collide instead of its own shapes",
    )

    @model_validator(mode="after")
    def _trapezoids(self) -> CrawlConfig:
        plain = [InputGaitConfig.model_fields[name].default for name in TRAPEZOID]
        for name, one in self.gait.items():
            if self.waveform == "sine" and [one.rise, one.hold, one.fall] != plain:
                raise ValueError(
                    f"'rise', 'hold' and 'fall' of {name} are of a trapezoid; leave them out, or add "
                    "'waveform: trapezoid'"
                )
        return self

    @model_validator(mode="after")
    def _horizontal(self) -> CrawlConfig:
        x, y, z = self.direction
        if math.hypot(x, y) < 1e-9 or abs(z) > 1e-9:
            raise ValueError("'direction' is horizontal: x and y, not both 0, and z = 0")
        return self

    @property
    def placed_arms(self) -> tuple[CrawlerArmConfig, ...]:
        """The stated arms, or the one that stands for none."""
        return self.arms or (CrawlerArmConfig(),)

    def inputs_at(self, clock: float, phase: float, names: tuple[str, ...]) -> dict[str, float]:
        """Return every input of a chain at a time in periods, for an arm of this phase."""
        known = {
            name: float(one.at(np.array(clock - phase), self.waveform)) for name, one in self.gait.items()
        }
        return {**dict.fromkeys(names, 0.0), **known}
