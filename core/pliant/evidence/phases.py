"""What the actuation is doing at each sample: rising, falling or holding, how fast, for how long."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.records.design import Array

STILL = 0.05  # of the run's range per duration: slower changes are a hold
NOISE_WIDTHS = 4.5  # slopes below so many standard deviations of the reading's noise are a hold
LONGEST_WINDOW = 32  # samples over which a noisy reading is differenced


@dataclass(frozen=True, eq=False)
class Phases:
    """(t,) each: `direction` −1, 0, 1; `rate` per second, NaN in holds; `hold_s` since the change, NaN in motion."""

    direction: Array
    rate: Array
    hold_s: Array


def phases(level: Array, time_s: Array | None) -> Phases:
    """Phases of one run from its actuation, which may be a noisy reading.

    Slopes are backward differences, so that a step belongs to the sample that it leads to. The window grows
    until a typical slope stands clear of the reading's noise, which second differences tell (Var = 6 σ²).
    Without time, samples count as seconds.
    """
    n = len(level)
    clock = np.arange(n, dtype=float) if time_s is None else np.asarray(time_s, float)
    if n < 2 or np.ptp(level) == 0:
        return Phases(np.zeros(n), np.full(n, np.nan), clock - clock[:1])
    sigma = _reading_noise(level)
    window = 1
    while True:
        slope, span = _backward_slope(level, clock, window)
        noise = NOISE_WIDTHS * np.sqrt(2) * sigma / span
        moving = np.abs(slope) > np.maximum(noise, STILL * np.ptp(level) / max(np.ptp(clock), 1e-12))
        clear = not sigma or np.percentile(np.abs(slope), 90) > 3 * np.median(noise)
        if clear or 2 * window > min(LONGEST_WINDOW, n // 4):
            break
        window *= 2
    direction = np.where(moving, np.sign(slope), 0.0)
    last_motion = np.maximum.accumulate(np.where(moving, np.arange(n), -1))
    since = clock - clock[np.maximum(last_motion, 0)]
    return Phases(
        direction, np.where(moving, np.abs(slope), np.nan), np.where(moving, np.nan, np.maximum(since, 0.0))
    )


def _backward_slope(level: Array, clock: Array, window: int) -> tuple[Array, Array]:
    now = np.arange(len(level))
    before = np.maximum(now - window, 0)
    now = np.maximum(now, min(window, len(level) - 1))  # the first samples look ahead
    span = np.maximum(clock[now] - clock[before], 1e-12)
    return (level[now] - level[before]) / span, span


def _reading_noise(level: Array) -> float:
    """Standard deviation of a reading's white noise, untouched by ramps, corners and holds."""
    if len(level) < 8:
        return 0.0
    return float(1.4826 * np.median(np.abs(np.diff(level, 2))) / np.sqrt(6))
