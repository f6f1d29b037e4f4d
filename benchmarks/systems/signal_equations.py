"""Hidden effects of inputs and outputs, by other equations than the plugins'.

An equation maps (k, m) values of channels at the times t of the truth's fine steps, from the largest magnitude `top` of
each channel, its strength s, its numbers x and its shape.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from benchmarks.systems.shapes import TINY, Array, Numbers, Shape


def gain(u: Array, t: Array, top: Array, s: float, x: Numbers, shape: Shape) -> Array:
    """Return a factor that depends on the level or on time."""
    return u * (1.0 + s * shape(np.abs(u) / top, t[:, None], x))


def offset(u: Array, t: Array, top: Array, s: float, x: Numbers, shape: Shape) -> Array:
    """Return an offset that depends on the level or on time."""
    return u + s * top * shape(np.abs(u) / top, t[:, None], x)


def eccentric(u: Array, t: Array, top: Array, s: float, x: Numbers, shape: Shape) -> Array:
    """Return an offset that is larger at some levels: a disc beside its axis."""
    return u + s * top * (1.0 + x["a"] * np.sin(np.pi * u / top + x["phase"]))


def dead(u: Array, t: Array, top: Array, s: float, x: Numbers, shape: Callable[..., Array]) -> Array:
    """Return a dead zone with rounded ends."""
    width = x["a"] * s * top + TINY
    return np.asarray(np.sign(u) * (shape(np.abs(u) - s * top, width) - shape(-s * top, width)))


def steps(t: Array) -> Iterator[tuple[int, float]]:
    return ((k, float(b - a)) for k, (a, b) in enumerate(pairwise(t), 1))


def stages(u: Array, t: Array, top: Array, s: float, x: Numbers, shape: Any) -> Array:
    """Return two lags in series."""
    return _lag(_lag(u, t, x["a"] * s), t, (1.0 - x["a"]) * s)


def _lag(u: Array, t: Array, time_s: float) -> Array:
    y = u.copy()
    for k, h in steps(t):
        y[k] = y[k - 1] + -np.expm1(-h / max(time_s, TINY)) * (u[k] - y[k - 1])
    return y


def orifice(u: Array, t: Array, top: Array, s: float, x: Numbers, shape: Any) -> Array:
    """Return a flow that falls with the root of the difference, laminar near balance."""
    y = u.copy()
    for k, h in steps(t):
        gap = (u[k] - y[k - 1]) / top
        y[k] = y[k - 1] + top * gap * -np.expm1(-h / max(s, TINY) / np.sqrt(np.abs(gap) + x["a"]))
    return y


def oscillating(u: Array, t: Array, top: Array, s: float, x: Numbers, shape: Any) -> Array:
    """Return a lag of second order with the damping ratio z; its time constant at low frequencies is s."""
    y, rate = u.copy(), np.zeros_like(u[0])
    w = 2.0 * x["z"] / max(s, 1e-4)
    for k, h in steps(t):
        rate = (rate + h * w * w * (u[k] - y[k - 1])) / (1.0 + 2.0 * x["z"] * w * h + w * w * h * h)
        y[k] = y[k - 1] + h * rate
    return y


def average(u: Array, t: Array, top: Array, s: float, x: Numbers, shape: Any) -> Array:
    """Return a lag and a moving average behind it."""
    lagged = _lag(u, t, (1.0 - x["a"]) * s)
    total = np.concatenate([np.zeros((1, u.shape[1])), np.cumsum(lagged, axis=0)]) * float(t[1] - t[0])
    n = 2.0 * x["a"] * s / float(t[1] - t[0])
    ends = np.arange(1, len(t) + 1, dtype=float)
    now, then = (_at(total, e) for e in (ends, ends - max(n, 1.0)))
    early = np.maximum(max(n, 1.0) - ends, 0.0)[:, None] * lagged[0] * float(t[1] - t[0])
    return np.asarray((now - then + early) / (max(n, 1.0) * float(t[1] - t[0])))


def _at(table: Array, place: Array) -> Array:
    place = np.clip(place, 0.0, len(table) - 1.0)
    low = np.minimum(place.astype(int), len(table) - 2)
    part = (place - low)[:, None]
    return np.asarray(table[low] * (1.0 - part) + table[low + 1] * part)


def late_by_level(u: Array, t: Array, top: Array, s: float, x: Numbers, shape: Any) -> Array:
    """Return the signal late, the more at larger levels."""
    h = float(t[1] - t[0])
    columns = [
        np.interp(t - s * (1.0 + x["a"] * (np.abs(c) / m - 0.5)), t, c) for c, m in zip(u.T, top, strict=True)
    ]
    return np.stack(columns, axis=1) if h else u


def held(u: Array, t: Array, top: Array, s: float, x: Numbers, shape: Any) -> Array:
    """Return the signal late by a part of the time, and held for samples whose mean age is the rest."""
    period = max(2.0 * x["a"] * s, 1e-6)
    then = np.floor((t - t[0]) / period) * period + t[0] - (1.0 - x["a"]) * s
    return np.stack([np.interp(then, t, column) for column in u.T], axis=1)


def plays(u: Array, t: Array, top: Array, s: float, x: Numbers, shape: Sequence[float]) -> Array:
    """Return the mean of plays of several widths."""
    widths = [s * top * (1.0 + x["a"] * one) for one in shape]
    found = np.zeros_like(u)
    for width in widths:
        y = u[0].copy()
        for k in range(len(u)):
            y = np.minimum(np.maximum(y, u[k] - width), u[k] + width)
            found[k] += y / len(widths)
    return found


def clipped(u: Array, t: Array, top: Array, s: float, x: Numbers, shape: Any) -> Array:
    """Return a saturation with a rounded corner."""
    most = (1.0 - s) * top
    return np.asarray(u / (1.0 + np.abs(u / most) ** x["p"]) ** (1.0 / x["p"]))


def knee(u: Array, t: Array, top: Array, s: float, x: Numbers, shape: Any) -> Array:
    """Return a level above which little is added."""
    most = (1.0 - s) * top
    begin = (1.0 - x["a"]) * most
    beyond = np.maximum(np.abs(u) - begin, 0.0)
    return np.asarray(
        np.sign(u) * (np.minimum(np.abs(u), begin) + x["a"] * most * np.tanh(beyond / (x["a"] * most)))
    )


def leaking(u: Array, t: Array, top: Array, s: float, x: Numbers, shape: Any) -> Array:
    """Return an input whose changes fade, but for a part, with a power of their size."""
    moved = u - u[0]
    y = moved.copy()
    for k, h in steps(t):
        y[k] = y[k - 1] + moved[k] - moved[k - 1]
        y[k] /= 1.0 + s * h * (np.abs(y[k]) / top + 1e-3) ** (x["p"] - 1.0)
    return u[0] + x["part"] * y + (1.0 - x["part"]) * moved


def sheared(u: Array, t: Array, top: Array, s: float, x: Numbers, shape: Any) -> Array:
    """Return vectors (k, 3 m) turned about an axis, and sheared or stretched by a part of it."""
    axis = np.array([x["x"], x["y"], x["z"]])
    axis = s * axis / np.linalg.norm(axis)
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    turn = np.eye(3) + cross + 0.5 * cross @ cross + x["a"] * s * np.asarray(shape)
    return np.asarray((u.reshape(len(u), -1, 3) @ turn.T).reshape(u.shape))


def sagging(u: Array, t: Array, top: Array, s: float, x: Numbers, shape: Any) -> Array:
    """Return inputs of one supply (all columns) that fall with their sum; `T`: late."""
    load = np.mean(np.abs(u) / top, axis=1, keepdims=True) ** x["p"]
    if "T" in x:
        load = _lag(load, t, x["T"])
    return u * (1.0 - s * load)


def wavy(u: Array, t: Array, top: Array, s: float, x: Numbers, shape: Sequence[float]) -> Array:
    """Return readings of a disc with marks at unequal distances."""
    return u + s * top * sum(np.sin(f * x["n"] * np.pi * u / top + f * x["phase"]) for f in shape)
