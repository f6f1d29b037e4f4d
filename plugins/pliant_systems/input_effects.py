"""Effects between the command and the system: gain, offset, dead zone, lag, dead time, play, saturation, leak."""

from __future__ import annotations

import numpy as np

from pliant.interfaces.effect import EffectConfig, parameter
from pliant.interfaces.model import effect_kind
from pliant.records.design import Array
from pliant.units import Ratio, Time
from pliant_plugins.effects.lag import lagged
from pliant_plugins.effects.supply_lag import through_orifice
from pliant_systems import notes as known
from pliant_systems.signals import InputEffect, above, delayed, faded, faded_changes, played


class ActuationGainConfig(EffectConfig):
    """Gain of an input."""

    kind: str = effect_kind("actuation_gain")
    factor: Ratio = parameter(neutral=1.0, bounds=(-3.0, 5.0), plausible=(0.7, 1.3), example=1.1)
    """acting input over the commanded one"""
    fading: Ratio = parameter(neutral=0.0, bounds=(-0.9, 0.9), plausible=(-0.3, 0.3), role="form")
    """share of the change that is gone at the largest recorded magnitude"""


class InputGain(InputEffect):
    """u' = (1 + (g − 1) (1 − f |u| / û)) u."""

    config: ActuationGainConfig
    notes = known.GAIN
    recommended_experiments = ("slow_cycles", "step_response")

    def transform(self, values: Array, time_s: Array, scale: float) -> Array:
        return values * (1.0 + (self.config.factor - 1.0) * faded(self.config.fading, values, scale))


class InputOffsetConfig(EffectConfig):
    """Offset of an input."""

    kind: str = effect_kind("input_offset")
    share: Ratio = parameter(neutral=0.0, bounds=(-1.0, 1.0), plausible=(-0.1, 0.1), example=0.02)
    """acting − commanded input, as a share of the largest recorded magnitude"""
    fading: Ratio = parameter(neutral=0.0, bounds=(-0.9, 0.9), plausible=(-0.3, 0.3), role="form")
    """share of the offset that is gone at the largest recorded magnitude"""


class InputOffset(InputEffect):
    """u' = u + b û (1 − f |u| / û), with û the largest recorded magnitude."""

    config: InputOffsetConfig
    notes = known.OFFSET
    recommended_experiments = ("vented_zero", "slow_cycles")

    def transform(self, values: Array, time_s: Array, scale: float) -> Array:
        return values + self.config.share * scale * faded(self.config.fading, values, scale)


class DeadZoneConfig(EffectConfig):
    """Dead zone of an input about zero."""

    kind: str = effect_kind("dead_zone")
    share: Ratio = parameter(neutral=0.0, bounds=(0.0, 0.9), plausible=(0.0, 0.2), example=0.05)
    """half-width, as a share of the largest recorded magnitude"""
    rounding: Ratio = parameter(neutral=0.0, bounds=(0.0, 1.0), plausible=(0.0, 0.4), role="form")
    """width of the corner at its end, as a share of it"""


class InputDeadZone(InputEffect):
    """u' = sign(u) max(|u| − d û, 0), with a corner that may be round."""

    config: DeadZoneConfig
    notes = known.DEAD_ZONE
    recommended_experiments = ("small_loops", "slow_cycles")

    def transform(self, values: Array, time_s: Array, scale: float) -> Array:
        half = self.config.share * scale
        return np.asarray(np.sign(values) * above(np.abs(values), half, self.config.rounding * half))


class SupplyLagConfig(EffectConfig):
    """Lag of an input."""

    kind: str = effect_kind("supply_lag")
    time_s: Time = parameter(neutral=0.0, bounds=(0.0, 20.0), plausible=(0.01, 0.5), example="0.1 s")
    """time constant"""
    release_ratio: float = parameter(
        unit="1", neutral=1.0, bounds=(0.2, 5.0), plausible=(0.6, 1.7), role="form"
    )
    """time constant of falling over that of rising"""
    second_ratio: Ratio = parameter(neutral=0.0, bounds=(0.0, 1.0), plausible=(0.0, 0.4), role="form")
    """time constant of a second lag behind it, as a share of the first"""
    power: float = parameter(unit="1", neutral=1.0, bounds=(0.4, 1.5), plausible=(0.5, 1.2), role="form")
    """power of the difference with which the input follows: 1/2 through an orifice"""


class InputLag(InputEffect):
    """T u'˙ = sign(d) û (|d| / û)^n with d = u − u', from balance, and a second lag behind it."""

    config: SupplyLagConfig
    notes = known.LAG
    recommended_experiments = ("step_response", "fast_cycles")

    def transform(self, values: Array, time_s: Array, scale: float) -> Array:
        rising = self.config.time_s
        if rising == 0.0:
            return values
        falling, power = self.config.release_ratio * rising, self.config.power
        if power == 1.0:
            late = lagged(values, time_s, rising, falling_s=falling)
        else:
            late = scale * through_orifice(values / scale, time_s, (rising, falling), power)
        second = self.config.second_ratio * rising
        return lagged(late, time_s, second) if second else late


class DeadTimeConfig(EffectConfig):
    """Dead time of an input."""

    kind: str = effect_kind("dead_time")
    delay_s: Time = parameter(neutral=0.0, bounds=(0.0, 2.0), plausible=(0.005, 0.2), example="0.05 s")
    """by which the input acts late"""


class DeadTime(InputEffect):
    """u'(t) = u(t − d)."""

    config: DeadTimeConfig
    notes = known.DEAD_TIME
    recommended_experiments = ("step_response", "fast_cycles")

    def transform(self, values: Array, time_s: Array, scale: float) -> Array:
        return delayed(values, time_s, self.config.delay_s)


class InputPlayConfig(EffectConfig):
    """Play between command and system."""

    kind: str = effect_kind("backlash")
    share: Ratio = parameter(neutral=0.0, bounds=(0.0, 0.9), plausible=(0.0, 0.15), example=0.03)
    """half-width of the play, as a share of the largest recorded magnitude"""
    spread: Ratio = parameter(neutral=0.0, bounds=(0.0, 1.0), plausible=(0.0, 0.6), role="form")
    """of parts in a row with plays of their own: how far three of them are from their mean"""


class InputPlay(InputEffect):
    """u' = mean of plays of half-widths about w û, which start in their middle."""

    config: InputPlayConfig
    notes = known.PLAY
    recommended_experiments = ("small_loops", "slow_cycles")

    def transform(self, values: Array, time_s: Array, scale: float) -> Array:
        half, spread = self.config.share * scale, self.config.spread
        widths = [half * (1.0 + k * spread) for k in (-1, 0, 1)] if spread else [half]
        return np.asarray(np.mean([played(values, width) for width in widths], axis=0))


class SaturationConfig(EffectConfig):
    """Saturation of an input."""

    kind: str = effect_kind("saturation")
    loss: Ratio = parameter(neutral=0.0, bounds=(0.0, 0.95), plausible=(0.0, 0.4), example=0.1)
    """share of the largest recorded magnitude that is cut off"""
    rounding: Ratio = parameter(neutral=0.0, bounds=(0.0, 1.0), plausible=(0.0, 0.2), role="form")
    """width of the corner, as a share of what is left"""


class Saturation(InputEffect):
    """u' = min(|u|, (1 − s) û) sign(u), with a corner that may be round."""

    config: SaturationConfig
    notes = known.SATURATION
    recommended_experiments = ("step_response", "small_loops")

    def transform(self, values: Array, time_s: Array, scale: float) -> Array:
        most = (1.0 - self.config.loss) * scale
        size = np.abs(values)
        return np.asarray(np.sign(values) * (size - above(size, most, self.config.rounding * most)))


class InputLeakConfig(EffectConfig):
    """Loss of a held input."""

    kind: str = effect_kind("leak")
    rate_per_s: float = parameter(
        unit="s^-1", neutral=0.0, bounds=(0.0, 5.0), plausible=(0.0, 0.2), example=0.05
    )
    """rate at which a constant input fades"""
    power: float = parameter(unit="1", neutral=1.0, bounds=(0.3, 2.0), plausible=(0.5, 1.5), role="form")
    """power of the size with which it fades"""


class InputLeak(InputEffect):
    """u' = x with x˙ = u˙ − r x (|x| / û)^(n−1): a change acts at once and fades."""

    config: InputLeakConfig
    notes = known.LEAK
    recommended_experiments = ("holds", "slow_cycles")

    def transform(self, values: Array, time_s: Array, scale: float) -> Array:
        rate = self.config.rate_per_s
        if rate == 0.0:
            return values
        if self.config.power != 1.0:
            return values[0] + faded_changes(values, time_s, rate, self.config.power, scale)
        # x = u − r z with the lag z˙ = u − r z, from rest at the first value
        return values[0] + (values - values[0]) - lagged(values - values[0], time_s, 1.0 / rate)
