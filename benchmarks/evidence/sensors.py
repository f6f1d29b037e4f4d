"""What angle sensors of the truth say: play, lag, scale, waves, bias, and where they were put for a run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from benchmarks.evidence.robots import Array

TYPICAL_RAD = 0.4


@dataclass(frozen=True)
class Sensor:
    """Of every angle that is read; the defaults are an ideal sensor.

    Attributes:
        bias_rad, scale: reading − angle at zero, and its slope − 1.
        curvature: by how much the scale grows over `TYPICAL_RAD`, over the scale.
        play_rad, play_knee: lost motion before the sensor, and how far its three parts differ in width.
        late_s, late_second: the first stage's time constant, and the second stage's over it.
        late_falling: the first stage's time constant for falling readings over that for rising ones.
        slip_rad: standard deviation of where it was put, per run.
        wave_rad, wave_period_rad, wave_phase: an eccentric encoder.
    """

    bias_rad: float = 0.0
    scale: float = 0.0
    curvature: float = 0.0
    play_rad: float = 0.0
    play_knee: float = 0.4
    late_s: float = 0.0
    late_second: float = 0.4
    late_falling: float = 1.0
    slip_rad: float = 0.0
    wave_rad: float = 0.0
    wave_period_rad: float = 0.1
    wave_phase: float = 0.0


def sensed(angle: Array, time_s: Array, sensor: Sensor, slip: float) -> Array:
    """(t,) what the sensor says of an angle; `slip` is the run's own, in standard deviations."""
    seen: Array = angle
    if sensor.play_rad:
        widths = sensor.play_rad * (1 + sensor.play_knee * np.array([-1.0, 0.0, 1.0]))
        seen = np.mean([play(angle, width) for width in widths], axis=0)
    if sensor.late_s:
        seen = late(seen, time_s, sensor.late_s, sensor.late_falling)
        seen = late(seen, time_s, sensor.late_second * sensor.late_s, 1.0)
    if sensor.wave_rad:
        seen = seen + sensor.wave_rad * np.sin(2 * np.pi * seen / sensor.wave_period_rad + sensor.wave_phase)
    scaled = seen * (1 + sensor.scale * (1 + sensor.curvature * seen / TYPICAL_RAD))
    return scaled + sensor.bias_rad + sensor.slip_rad * slip


def play(angle: Array, width: float) -> Array:
    """The play operator: the output is dragged by either side of a gap of this width; it starts in the middle."""
    out = angle.copy()
    for i in range(1, len(out)):
        out[i] = min(max(out[i - 1], angle[i] - width / 2), angle[i] + width / 2)
    return out


def late(angle: Array, time_s: Array, constant_s: float, falling: float, parts: int = 8) -> Array:
    """A first-order stage from balance, in `parts` exact steps between samples; slower by `falling` downward."""
    out, state = np.empty(len(angle)), float(angle[0])
    out[0] = state
    for i in range(1, len(angle)):
        dt = (time_s[i] - time_s[i - 1]) / parts
        for k in range(parts):
            start = angle[i - 1] + k / parts * (angle[i] - angle[i - 1])
            rise = (angle[i] - angle[i - 1]) / parts
            time = constant_s * (falling if start + 0.5 * rise < state else 1.0)
            behind = rise * time / dt
            state = start + rise - behind + (state - start + behind) * np.exp(-dt / time)
        out[i] = state
    return out
