"""Effects between the command and the system: gain, offset, dead zone, lag, dead time, play, saturation, leak."""

from __future__ import annotations

import numpy as np

from pliant.interfaces.effect import EffectConfig, parameter
from pliant.interfaces.model import effect_kind
from pliant.records.design import Array
from pliant.units import Ratio, Time
from pliant_plugins.effects.lag import lagged
from pliant_systems import notes as known
from pliant_systems.signals import InputEffect, delayed, played


class ActuationGainConfig(EffectConfig):
    """Gain of an input."""

    kind: str = effect_kind("actuation_gain")
    factor: Ratio = parameter(neutral=1.0, bounds=(-3.0, 5.0), plausible=(0.7, 1.3), example=1.1)
    """acting input over the commanded one"""


class InputGain(InputEffect):
    """u' = g u."""

    config: ActuationGainConfig
    notes = known.GAIN
    recommended_experiments = ("slow_cycles", "step_response")

    def transform(self, values: Array, time_s: Array, scale: float) -> Array:
        return self.config.factor * values


class InputOffsetConfig(EffectConfig):
    """Offset of an input."""

    kind: str = effect_kind("input_offset")
    share: Ratio = parameter(neutral=0.0, bounds=(-1.0, 1.0), plausible=(-0.1, 0.1), example=0.02)
    """acting − commanded input, as a share of the largest recorded magnitude"""


class InputOffset(InputEffect):
    """u' = u + b û, with û the largest recorded magnitude."""

    config: InputOffsetConfig
    notes = known.OFFSET
    recommended_experiments = ("vented_zero", "slow_cycles")

    def transform(self, values: Array, time_s: Array, scale: float) -> Array:
        return values + self.config.share * scale


class DeadZoneConfig(EffectConfig):
    """Dead zone of an input about zero."""

    kind: str = effect_kind("dead_zone")
    share: Ratio = parameter(neutral=0.0, bounds=(0.0, 0.9), plausible=(0.0, 0.2), example=0.05)
    """half-width, as a share of the largest recorded magnitude"""


class InputDeadZone(InputEffect):
    """u' = sign(u) max(|u| − d û, 0)."""

    config: DeadZoneConfig
    notes = known.DEAD_ZONE
    recommended_experiments = ("small_loops", "slow_cycles")

    def transform(self, values: Array, time_s: Array, scale: float) -> Array:
        size = np.maximum(np.abs(values) - self.config.share * scale, 0.0)
        return np.asarray(np.sign(values) * size)


class SupplyLagConfig(EffectConfig):
    """Lag of an input."""

    kind: str = effect_kind("supply_lag")
    time_s: Time = parameter(neutral=0.0, bounds=(0.0, 20.0), plausible=(0.01, 0.5), example="0.1 s")
    """time constant"""
    release_ratio: float = parameter(
        unit="1", neutral=1.0, bounds=(0.2, 5.0), plausible=(0.6, 1.7), role="form"
    )
    """time constant of falling over that of rising"""


class InputLag(InputEffect):
    """T u'˙ + u' = u, from balance."""

    config: SupplyLagConfig
    notes = known.LAG
    recommended_experiments = ("step_response", "fast_cycles")

    def transform(self, values: Array, time_s: Array, scale: float) -> Array:
        rising = self.config.time_s
        if rising == 0.0:
            return values
        return lagged(values, time_s, rising, falling_s=self.config.release_ratio * rising)


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


class InputPlay(InputEffect):
    """u' = play of half-width w û, which starts in its middle."""

    config: InputPlayConfig
    notes = known.PLAY
    recommended_experiments = ("small_loops", "slow_cycles")

    def transform(self, values: Array, time_s: Array, scale: float) -> Array:
        return played(values, self.config.share * scale)


class SaturationConfig(EffectConfig):
    """Saturation of an input."""

    kind: str = effect_kind("saturation")
    loss: Ratio = parameter(neutral=0.0, bounds=(0.0, 0.95), plausible=(0.0, 0.4), example=0.1)
    """share of the largest recorded magnitude that is cut off"""


class Saturation(InputEffect):
    """u' = min(|u|, (1 − s) û) sign(u)."""

    config: SaturationConfig
    notes = known.SATURATION
    recommended_experiments = ("step_response", "small_loops")

    def transform(self, values: Array, time_s: Array, scale: float) -> Array:
        most = (1.0 - self.config.loss) * scale
        return np.clip(values, -most, most)


class InputLeakConfig(EffectConfig):
    """Loss of a held input."""

    kind: str = effect_kind("leak")
    rate_per_s: float = parameter(
        unit="s^-1", neutral=0.0, bounds=(0.0, 5.0), plausible=(0.0, 0.2), example=0.05
    )
    """rate at which a constant input fades"""


class InputLeak(InputEffect):
    """u' = x with x˙ = u˙ − r x: a change acts at once and fades."""

    config: InputLeakConfig
    notes = known.LEAK
    recommended_experiments = ("holds", "slow_cycles")

    def transform(self, values: Array, time_s: Array, scale: float) -> Array:
        rate = self.config.rate_per_s
        if rate == 0.0:
            return values
        # x = u − r z with the lag z˙ = u − r z, from rest at the first value
        return values[0] + (values - values[0]) - lagged(values - values[0], time_s, 1.0 / rate)
