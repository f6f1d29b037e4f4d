"""Effects between the system and its readings: bias, scale, lag, delay, a turned frame."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.effect import EffectConfig, Readings, parameter
from pliant.interfaces.model import SystemEffect, SystemParts, effect_kind
from pliant.mechanics.rotations import exp_map
from pliant.records.design import Array
from pliant.units import Angle, Ratio, Time
from pliant_plugins.effects.lag import lagged
from pliant_systems import notes as known
from pliant_systems.signals import OutputEffect, delayed, faded

COMPONENT = re.compile(r"(.*)_([xyz])_([a-z0-9_]+)")


class SensorBiasConfig(EffectConfig):
    """Bias of a reading."""

    kind: str = effect_kind("sensor_bias")
    share: Ratio = parameter(neutral=0.0, bounds=(-2.0, 2.0), plausible=(-0.1, 0.1), example=0.02)
    """reading − true value, as a share of the largest recorded magnitude"""


class SensorBias(OutputEffect):
    """y' = y + b ŷ, with ŷ the largest recorded magnitude."""

    config: SensorBiasConfig
    notes = known.BIAS
    recommended_experiments = ("vented_zero", "slow_cycles")

    def transform(self, values: Array, time_s: Array, scale: float) -> Array:
        return values + self.config.share * scale


class SensorScaleConfig(EffectConfig):
    """Scale of a reading."""

    kind: str = effect_kind("sensor_scale")
    factor: Ratio = parameter(neutral=1.0, bounds=(-3.0, 5.0), plausible=(0.8, 1.2), example=1.05)
    """reading over the true value"""
    fading: Ratio = parameter(neutral=0.0, bounds=(-0.9, 0.9), plausible=(-0.3, 0.3), role="form")
    """share of the change that is gone at the largest recorded magnitude"""


class SensorScale(OutputEffect):
    """y' = (1 + (g − 1) (1 − f |y| / ŷ)) y."""

    config: SensorScaleConfig
    notes = known.SCALE
    recommended_experiments = ("slow_cycles", "step_response")

    def transform(self, values: Array, time_s: Array, scale: float) -> Array:
        return values * (1.0 + (self.config.factor - 1.0) * faded(self.config.fading, values, scale))


class SensorLagConfig(EffectConfig):
    """Lag of a reading."""

    kind: str = effect_kind("sensor_lag")
    time_s: Time = parameter(neutral=0.0, bounds=(0.0, 20.0), plausible=(0.01, 0.3), example="0.05 s")
    """time constant of the sensor or its filter"""
    second_ratio: Ratio = parameter(neutral=0.0, bounds=(0.0, 1.0), plausible=(0.0, 0.4), role="form")
    """time constant of a second lag behind it, as a share of the first"""


class SensorLag(OutputEffect):
    """T y'˙ + y' = y, from balance, and a second lag behind it."""

    config: SensorLagConfig
    notes = known.SENSOR_LAG
    recommended_experiments = ("step_response", "fast_cycles")

    def transform(self, values: Array, time_s: Array, scale: float) -> Array:
        for constant_s in (self.config.time_s, self.config.second_ratio * self.config.time_s):
            values = lagged(values, time_s, constant_s) if constant_s else values
        return values


class SensorDelayConfig(EffectConfig):
    """Delay of a reading."""

    kind: str = effect_kind("sensor_delay")
    delay_s: Time = parameter(neutral=0.0, bounds=(-1.0, 1.0), plausible=(-0.1, 0.1), example="0.02 s")
    """by which the reading is late; negative where the other clocks are late"""


class SensorDelay(OutputEffect):
    """y'(t) = y(t − d): clocks of two loggers that disagree, a camera's buffer."""

    config: SensorDelayConfig
    notes = known.DELAY
    recommended_experiments = ("fast_cycles", "step_response")

    def transform(self, values: Array, time_s: Array, scale: float) -> Array:
        return delayed(values, time_s, self.config.delay_s) if self.config.delay_s else values


class MisalignedFrameConfig(EffectConfig):
    """Turn of the frame in which vectors are read."""

    kind: str = effect_kind("misaligned_frame")
    about_x_rad: Angle = parameter(
        neutral=0.0, bounds=(-np.pi, np.pi), plausible=(-0.1, 0.1), example="3 deg"
    )
    """turn about the world's x"""
    about_y_rad: Angle = parameter(neutral=0.0, bounds=(-np.pi, np.pi), plausible=(-0.1, 0.1))
    """turn about the world's y"""
    about_z_rad: Angle = parameter(neutral=0.0, bounds=(-np.pi, np.pi), plausible=(-0.1, 0.1))
    """turn about the world's z"""


class MisalignedFrame(SystemEffect):
    """y' = exp(−θ×) y for every vector that is read by its three components ``…_x_…``, ``…_y_…``, ``…_z_…``."""

    place = "output"
    config: MisalignedFrameConfig
    notes = known.FRAME
    recommended_experiments = ("slow_cycles",)

    def act(self, parts: SystemParts) -> SystemParts:
        """Return the parts with one more map of the readings; raise `UserError` without a vector among the outputs."""
        vectors = complete_vectors(self.chosen(parts.names[1]))
        if not vectors:
            raise UserError(f"effect '{self.config.kind}' turns vectors, and no output is one of x, y and z")
        turn = exp_map(np.array([self.config.about_x_rad, self.config.about_y_rad, self.config.about_z_rad]))
        return parts.with_output(partial(_turned, vectors, turn.T))


def complete_vectors(names: tuple[str, ...]) -> tuple[tuple[str, str, str], ...]:
    """Return the names that form vectors, x, y and z of each."""
    found: dict[tuple[str, str], dict[str, str]] = {}
    for name in names:
        if match := COMPONENT.fullmatch(name):
            found.setdefault((match[1], match[3]), {})[match[2]] = name
    return tuple((one["x"], one["y"], one["z"]) for one in found.values() if len(one) == 3)


def _turned(vectors: tuple[tuple[str, str, str], ...], turn: Array, readings: Readings) -> Mapping[str, Any]:
    changed = dict(readings)
    for names in vectors:
        if all(name in readings for name in names):
            seen = np.stack([np.asarray(readings[name], float) for name in names], axis=-1) @ turn.T
            changed |= {name: seen[..., k] for k, name in enumerate(names)}
    return changed
