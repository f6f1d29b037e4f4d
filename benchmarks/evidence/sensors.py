"""Readings of the truth's angle sensors: play, lag, scale, waves, bias, and mounting position per run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from benchmarks.evidence.forms import along
from benchmarks.evidence.robots import Array

TWICE_TYPICAL_RAD = 0.8


@dataclass(frozen=True)
class Sensor:
    """Sensor parameters of every angle that is read; the defaults are an ideal sensor.

    Attributes:
        bias_rad, scale: reading − angle at zero, and its slope − 1.
        curvature, curvature_shape: relative growth of the scale over `curvature_over_rad`, and its shape.
        bias_warming, bias_warming_s: share of the bias that develops within a run, and its time constant.
        bias_wave, bias_period_rad: share of the bias that is periodic in the angle.
        play_rad, play_knee: lost motion before the sensor, and the difference in width of its three parts.
        play_cushion: share of the angle that is transmitted within the play.
        late_average: the reading is the mean over twice `late_s` instead of two stages.
        late_s, late_second: the first stage's time constant, and the second stage's over it.
        late_falling: the first stage's time constant for falling readings over that for rising ones.
        slip_rad, slip_sides: standard deviation of the mounting angle per run; if slip_sides, always this angle to
            either side.
        wave_rad, wave_period_rad, wave_phase, wave_triangle: an eccentric encoder.
        tilted_rad, tilted_turns, tilted_phase: error that depends on the sensor's orientation in space, `tilted_turns`
            periods per turn.
        warm_rad, warm_s: error due to temperature, per 30 °C, and its time constant.
    """

    bias_rad: float = 0.0
    scale: float = 0.0
    curvature: float = 0.0
    curvature_shape: float = 0.0
    curvature_over_rad: float = TWICE_TYPICAL_RAD
    bias_warming: float = 0.0
    bias_warming_s: float = 20.0
    bias_wave: float = 0.0
    bias_period_rad: float = 1.0
    play_rad: float = 0.0
    play_knee: float = 0.4
    play_cushion: float = 0.0
    late_s: float = 0.0
    late_second: float = 0.4
    late_falling: float = 1.0
    late_average: float = 0.0
    slip_rad: float = 0.0
    slip_sides: float = 0.0
    wave_rad: float = 0.0
    wave_period_rad: float = 0.1
    wave_phase: float = 0.0
    wave_triangle: float = 0.0
    tilted_rad: float = 0.0
    tilted_turns: float = 2.0
    tilted_phase: float = 0.0
    warm_rad: float = 0.0
    warm_s: float = 0.0


def sensed(
    angle: Array, time_s: Array, sensor: Sensor, slip: float, warm_c: float = 0.0, pitch_rad: float = 0.0
) -> Array:
    """Return the (t,) reading of an angle.

    `slip` is the run's own, in standard deviations, `warm_c` above the room's temperature, `pitch_rad` of the base.
    """
    s, seen = sensor, angle
    if s.play_rad:
        widths = s.play_rad * (1 + s.play_knee * np.array([-1.0, 0.0, 1.0]))
        dragged = np.mean([play(angle, width) for width in widths], axis=0)
        seen = dragged + s.play_cushion * (angle - dragged)
    if s.late_s and s.late_average:
        seen = averaged(seen, time_s, 2.0 * s.late_s)
    elif s.late_s:
        seen = late(seen, time_s, s.late_s, s.late_falling)
        seen = late(seen, time_s, s.late_second * s.late_s, 1.0)
    if s.wave_rad:
        turns = 2 * np.pi * seen / s.wave_period_rad + s.wave_phase
        seen = seen + s.wave_rad * (
            2 / np.pi * np.arcsin(np.sin(turns)) if s.wave_triangle else np.sin(turns)
        )
    scaled = seen * (1 + s.scale * (1 + s.curvature * _along(s.curvature_shape, seen / s.curvature_over_rad)))
    bias = s.bias_rad * (1 - s.bias_warming * np.exp(-time_s / s.bias_warming_s))
    bias = bias * (1 + s.bias_wave * np.sin(2 * np.pi * seen / s.bias_period_rad))
    bias = bias + s.tilted_rad * np.sin(s.tilted_turns * (seen - pitch_rad) + s.tilted_phase)
    if s.warm_rad:
        come = 1.0 - np.exp(-time_s / s.warm_s) if s.warm_s else 1.0
        bias = bias + s.warm_rad * warm_c / 30.0 * come
    return scaled + bias + s.slip_rad * (np.sign(slip) if s.slip_sides else slip)


def _along(shape: float, x: Array) -> Array:
    """Return the progress of a change, as `forms.along`; odd."""
    return np.sign(x) * np.array([along(shape, abs(value)) for value in x.tolist()])


def averaged(angle: Array, time_s: Array, window_s: float) -> Array:
    """Return the (t,) mean over the window before each sample; a run begins in balance."""
    clock = time_s - time_s[0]
    fine = np.linspace(0.0, clock[-1], 20 * len(clock))
    turned = np.interp(fine, clock, angle)  # straight between samples: its integral in fine parts
    area = np.concatenate([[0.0], np.cumsum(np.diff(fine) * (turned[1:] + turned[:-1]) / 2)])
    start = clock - window_s
    before = np.where(start < 0, start * angle[0], np.interp(start, fine, area))
    return (np.interp(clock, fine, area) - before) / window_s


def play(angle: Array, width: float) -> Array:
    """Apply the play operator: the output is dragged by either side of a gap of this width, from its middle."""
    out = angle.copy()
    for i in range(1, len(out)):
        out[i] = min(max(out[i - 1], angle[i] - width / 2), angle[i] + width / 2)
    return out


def late(angle: Array, time_s: Array, constant_s: float, falling: float, parts: int = 8) -> Array:
    """Apply a first-order stage from balance, in `parts` exact steps per sample; slower by `falling` downward."""
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
