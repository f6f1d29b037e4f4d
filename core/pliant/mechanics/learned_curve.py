"""Smooth curve or surface over one or two covariates of a joint, given by values at equidistant knots, 0 outside.

    f(x) = w(x) Σ_k v_k φ_k(x)

v_k are values at equidistant knots from `low` to `high`, φ_k the cubic convolution of Keys (IEEE Trans. Acoust. 29,
1981: it interpolates the knots with continuous slopes), for two covariates its product. w is 1 inside and falls to 0
within `MARGIN` of the range beyond either end (smoothstep), so that the curve vanishes outside its data. Cubic
convolution overshoots its knots by at most a quarter, so that f is bounded by the data.

A covariate is a function of the present and past of a joint or its input. `learned_value` is a function of `LawTerm`;
`series` returns the same covariates over the samples of a run.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from pliant.records.design import Array

CovariateName = Literal[
    "angle",
    "rate",
    "actuation",
    "temperature",
    "time",
    "travel",
    "actuation_rate",
    "actuation_direction",
    "angle_direction",
    "actuation_change",
    "angle_change",
    "largest_angle",
]
NAMES: tuple[str, ...] = get_args(CovariateName)
# Covariates from `time` on have a state along the run; these two continue from run to run of one specimen.
KEPT = ("travel", "largest_angle")
MARGIN = 0.1
# Lower bound of a factor on a part of the law.
LEAST_FACTOR = 0.05
ANGLE, RATE, ACTUATION, TEMPERATURE, TIME, TRAVEL = range(6)
ACTUATION_RATE, ACTUATION_DIRECTION, ANGLE_DIRECTION, ACTUATION_CHANGE, ANGLE_CHANGE, LARGEST = range(6, 12)
N_STATES = 2
# Numbers of a covariate among the parameters of a term: code, scale, low, high, knots.
HEAD = 5


@dataclass(frozen=True)
class CurveAxis:
    """One covariate of a curve.

    Attributes:
        name: of the covariate.
        low, high: the range of the curve's data, in the covariate's SI unit.
        knots: number of values over the range, 2 or more.
        scale: time constant of a change, s; width of a direction, Pa, N or rad; rate at half weight, per second;
            largest actuation, up to which and back is one cycle of travel. 1 for the others.
    """

    name: str
    low: float
    high: float
    knots: int
    scale: float = 1.0

    @property
    def code(self) -> int:
        """Its number in compiled code."""
        return NAMES.index(self.name)

    @property
    def has_memory(self) -> bool:
        """Return whether the covariate has a state along the run."""
        return self.code >= TIME

    @property
    def at(self) -> Array:
        """(knots,) places of the values."""
        return np.linspace(self.low, self.high, self.knots)


def numbers(axes: Sequence[CurveAxis], values: Array, is_factor: bool) -> tuple[float, ...]:
    """Return the parameters of `learned_value`; `values` (knots,) or (knots, knots)."""
    heads = [number for a in axes for number in (float(a.code), a.scale, a.low, a.high, float(a.knots))]
    return (float(is_factor), float(len(axes)), *heads, *np.ravel(values).tolist())


def learned_value(
    angle: float, rate: float, dt_s: float, actuation: float, temp_c: float, old: Array, new: Array, c: Array
) -> float:
    """Return f, or 1 + f for a factor: a function of `LawTerm` with parameters by `numbers`."""
    code = int(c[2])
    x = covariate(code, c[3], angle, rate, dt_s, actuation, temp_c, old, new, 0)
    weight = window(x, c[4], c[5])
    t = knot_place(x, c[4], c[5], c[6])
    if int(c[1]) == 1:
        value = weight * along(c, 2 + HEAD, int(c[6]), t)
    else:
        at = N_STATES if code >= TIME else 0
        y = covariate(int(c[7]), c[8], angle, rate, dt_s, actuation, temp_c, old, new, at)
        weight *= window(y, c[9], c[10])
        value = weight * across(c, 2 + 2 * HEAD, int(c[6]), int(c[11]), t, knot_place(y, c[9], c[10], c[11]))
    return max(1.0 + value, LEAST_FACTOR) if c[0] > 0.5 else value


def covariate(
    code: int,
    scale: float,
    angle: float,
    rate: float,
    dt_s: float,
    actuation: float,
    temp_c: float,
    old: Array,
    new: Array,
    at: int,
) -> float:
    """Return one covariate at the end of a step; its memory, two numbers from `at` on, is the state and the last x."""
    if code == ANGLE:
        return angle
    if code == RATE:
        return rate / (abs(rate) + scale)
    if code == ACTUATION:
        return actuation
    if code == TEMPERATURE:
        return temp_c
    x = actuation if code in (TRAVEL, ACTUATION_RATE, ACTUATION_DIRECTION, ACTUATION_CHANGE) else angle
    moved = x - old[at + 1]
    new[at], new[at + 1] = old[at], x
    if code == TIME:
        new[at] = 0.0 if math.isinf(dt_s) else old[at] + dt_s
        return new[at]
    if code == TRAVEL:
        new[at] = old[at] + abs(moved)
        return new[at] / (2.0 * scale)
    if code == LARGEST:
        new[at] = max(old[at], abs(angle))
        return new[at]
    if code == ACTUATION_RATE:
        speed = moved / dt_s if 0.0 < dt_s < math.inf else 0.0
        return speed / (abs(speed) + scale)
    if code in (ACTUATION_DIRECTION, ANGLE_DIRECTION):
        new[at] = max(-1.0, min(1.0, old[at] + moved / scale))
        return new[at]
    if math.isinf(dt_s):  # time-dependent covariates have relaxed
        new[at] = 0.0
        return 0.0
    steps = dt_s / scale
    mean_decay = -math.expm1(-steps) / steps if steps > 1e-12 else 1.0
    new[at] = math.exp(-steps) * old[at] + mean_decay * moved
    return new[at]


def window(x: float, low: float, high: float) -> float:
    """Return 1 from low to high, 0 from `MARGIN` of the range beyond them, smooth between."""
    out = max(low - x, x - high) / (MARGIN * (high - low))
    if out <= 0.0:
        return 1.0
    return 0.0 if out >= 1.0 else 1.0 - out * out * (3.0 - 2.0 * out)


def knot_place(x: float, low: float, high: float, knots: float) -> float:
    """Return the position of x among the knots, from 0 to knots − 1, clipped at the ends."""
    return (knots - 1.0) * max(0.0, min(1.0, (x - low) / (high - low)))


def along(c: Array, start: int, knots: int, t: float) -> float:
    """Interpolate the values from `start` on at the position t by cubic convolution."""
    i = min(int(t), knots - 2)
    s = t - i
    first = c[start + i - 1] if i > 0 else 2.0 * c[start] - c[start + 1]
    last = c[start + i + 2] if i + 2 < knots else 2.0 * c[start + i + 1] - c[start + i]
    return keys(first, c[start + i], c[start + i + 1], last, s)


def across(c: Array, start: int, knots: int, width: int, t: float, r: float) -> float:
    """Interpolate as `along` over rows of `width` values."""
    i = min(int(t), knots - 2)
    s = t - i
    here = along(c, start + i * width, width, r)
    there = along(c, start + (i + 1) * width, width, r)
    first = along(c, start + (i - 1) * width, width, r) if i > 0 else 2.0 * here - there
    last = along(c, start + (i + 2) * width, width, r) if i + 2 < knots else 2.0 * there - here
    return keys(first, here, there, last, s)


def keys(a: float, b: float, c: float, d: float, s: float) -> float:
    """Return Keys' cubic through b at s = 0 and c at s = 1, with slopes from their neighbours."""
    return b + 0.5 * s * (c - a + s * (2.0 * a - 5.0 * b + 4.0 * c - d + s * (3.0 * (b - c) + d - a)))


@dataclass(frozen=True, eq=False)
class Signals:
    """Signals of one joint in one run, (t,) each; `time_s` None if every sample was reached slowly."""

    angle: Array
    actuation: Array
    temperature: Array
    time_s: Array | None


def series(axis: CurveAxis, run: Signals, memory: Array | None = None) -> Array:
    """Return (t,) the covariate at every sample of a run from rest; `memory` (2,) is its start, and is advanced."""
    direct = {"angle": run.angle, "actuation": run.actuation, "temperature": run.temperature}
    if axis.name in direct:
        return direct[axis.name]
    n = len(run.angle)
    steps = np.full(n, math.inf)
    if run.time_s is not None:
        steps[1:] = np.diff(run.time_s)
    rates = np.zeros(n)
    timed = np.isfinite(steps) & (steps > 0.0)
    rates[timed] = np.diff(run.angle, prepend=0.0)[timed] / steps[timed]
    if axis.name == "rate":
        return np.asarray(rates / (np.abs(rates) + axis.scale))
    state = np.zeros(N_STATES) if memory is None else memory
    old, new, found = state.tolist(), [0.0, 0.0], []
    code, scale = axis.code, axis.scale
    columns = (v.tolist() for v in (run.angle, rates, steps, run.actuation))
    for angle, rate, dt_s, actuation in zip(*columns, strict=True):
        found.append(covariate(code, scale, angle, rate, dt_s, actuation, 0.0, old, new, 0))  # type: ignore[arg-type]
        old, new = new, old
    state[:] = old
    return np.array(found)


def basis(axes: Sequence[CurveAxis], values: Sequence[Array]) -> Array:
    """Return (t, K) w φ_k at covariates (t,) each: f = basis @ v."""
    parts = [_weights(axis, x) for axis, x in zip(axes, values, strict=True)]
    if len(parts) == 1:
        return parts[0]
    return np.einsum("ti,tj->tij", *parts).reshape(len(parts[0]), -1)


def _weights(axis: CurveAxis, x: Array) -> Array:
    """Return (t, knots) weights of one covariate."""
    low, high, knots = axis.low, axis.high, axis.knots
    t = (knots - 1.0) * np.clip((x - low) / (high - low), 0.0, 1.0)
    i = np.minimum(t.astype(int), knots - 2)
    s = t - i
    near = np.stack(
        [
            0.5 * s * (-1.0 + s * (2.0 - s)),
            1.0 + 0.5 * s * s * (-5.0 + 3.0 * s),
            0.5 * s * (1.0 + s * (4.0 - 3.0 * s)),
            0.5 * s * s * (s - 1.0),
        ]
    )
    wide = np.zeros((len(x), knots + 2))  # with an additional value at either end, extrapolated linearly
    rows = np.arange(len(x))
    for k in range(4):
        wide[rows, i + k] += near[k]
    found = wide[:, 1:-1].copy()
    for ghost, end, inner in ((wide[:, 0], 0, 1), (wide[:, -1], -1, -2)):
        found[:, end] += 2.0 * ghost
        found[:, inner] -= ghost
    out = np.clip(np.maximum(low - x, x - high) / (MARGIN * (high - low)), 0.0, 1.0)
    return np.asarray((1.0 - out * out * (3.0 - 2.0 * out))[:, None] * found)
