"""Effects of inputs and outputs of any system: a map of each chosen channel.

An effect gives `transform(values, time_s, scale)` → (t,) for one channel; `scale` is the channel's largest magnitude in
the measured runs.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from pliant.interfaces.effect import EffectConfig, Readings
from pliant.interfaces.model import SystemEffect, SystemParts
from pliant.records.design import Array
from pliant.records.history import History

# Share of the largest magnitude below which a power of it no longer grows.
LEAST_SHARE = 1e-3
# (values (t,), time_s (t,)) → (t,)
Transform = Callable[[Array, Array], Array]


class SignalEffect(SystemEffect):
    """An effect that maps each chosen channel separately."""

    config: EffectConfig

    @abstractmethod
    def transform(self, values: Array, time_s: Array, scale: float) -> Array:
        """Return (t,) the channel with the effect.

        Args:
            values: (t,) of the channel, SI.
            time_s: (t,) the clock.
            scale: largest magnitude of the channel in the measured runs, SI.
        """

    def _transforms(self, parts: SystemParts, names: tuple[str, ...]) -> dict[str, Transform]:
        return {name: partial(_scaled, self, parts.scales.get(name, 1.0)) for name in self.chosen(names)}


class InputEffect(SignalEffect):
    """An effect between the command and the system."""

    place = "input"

    def act(self, parts: SystemParts) -> SystemParts:
        """Return the parts with one more map of the inputs."""
        return parts.with_input(partial(driven_by, self.transforms(parts)))

    def transforms(self, parts: SystemParts) -> dict[str, Transform]:
        """Return the map of each chosen input."""
        return self._transforms(parts, parts.names[0])


class OutputEffect(SignalEffect):
    """An effect between the system and its reading."""

    place = "output"

    def act(self, parts: SystemParts) -> SystemParts:
        """Return the parts with one more map of the readings."""
        return parts.with_output(partial(_read, self._transforms(parts, parts.names[1])))


def _scaled(effect: SignalEffect, scale: float, values: Array, time_s: Array) -> Array:
    return effect.transform(values, time_s, scale)


def driven_by(transforms: Mapping[str, Transform], history: History) -> History:
    """Return the history with some of its inputs mapped."""
    assert history.time_s is not None
    changed = {
        name: transform(history.actuation[name], history.time_s)
        for name, transform in transforms.items()
        if name in history.actuation
    }
    return history.with_actuation(**changed)


def _read(transforms: Mapping[str, Transform], readings: Readings) -> dict[str, Any]:
    time_s = np.asarray(readings["time_s"], float)
    return {
        **readings,
        **{
            name: transform(np.asarray(readings[name], float), time_s)
            for name, transform in transforms.items()
            if name in readings
        },
    }


def faded(fading: float, values: Array, scale: float) -> Array:
    """Return (t,) the remaining share of a change at each value."""
    return 1.0 - fading * np.abs(values) / scale if fading else np.ones_like(values)


def above(size: Array, threshold: float, width: float) -> Array:
    """Return (t,) how far sizes are above a threshold, with a corner of this width, zero at zero."""
    if width <= 0.0:
        return np.maximum(size - threshold, 0.0)
    beyond = np.logaddexp(0.0, (size - threshold) / width) - np.logaddexp(0.0, -threshold / width)
    return np.asarray(width * beyond)


def faded_changes(values: Array, time_s: Array, rate: float, power: float, scale: float) -> Array:
    """Return (t,) x of x˙ = u˙ − r x (|x| / û)^(n−1), from zero; over a step the factor of x is that at its start."""
    found, x = np.zeros_like(values), 0.0
    steps = zip(np.diff(values).tolist(), np.diff(time_s).tolist(), strict=True)
    for k, (change, step_s) in enumerate(steps, 1):
        x += change
        size = max(abs(x) / scale, LEAST_SHARE)
        x *= float(np.exp(-rate * step_s * size ** (power - 1.0)))
        found[k] = x
    return found


def delayed(values: Array, time_s: Array, delay_s: float) -> Array:
    """Return (t,) the values `delay_s` later; the first value before."""
    return np.asarray(np.interp(time_s - delay_s, time_s, values), float)


def played(values: Array, half_width: float) -> Array:
    """Return (t,) the output of a play of this half-width, which starts in its middle."""
    found = np.empty_like(values)
    state = float(values[0])
    for k, value in enumerate(values.tolist()):
        state = min(max(state, value - half_width), value + half_width)
        found[k] = state
    return found
