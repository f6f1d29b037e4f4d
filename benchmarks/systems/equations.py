"""Equations of hidden effects, other ones than the plugins' own: of signals, of forces, of the model's numbers.

A signal's equation maps (k, m) values of channels at the truth's own fine steps. A force's equation is started anew for
every simulation and returns, step by step, a force and a damping at its places, for all runs. A change acts on the
compiled model.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Numbers = Mapping[str, float]
# Of the size in units of its largest (or typical) one, the time and the form's numbers: about 1.
Shape = Callable[[Array, Any, Numbers], Array]
TINY = 1e-12


class Now(NamedTuple):
    """What a force's equation sees of (r, n) places at a step."""

    q: Array
    v: Array
    drive: Array
    command: Array
    time_s: float
    step_s: float


@dataclass(frozen=True, eq=False)
class Sizes:
    """Of (n,) places: sizes of force, range and speed in the clean motion, its middle, where a spring rests, a stiffness.

    The stiffness is that of a position drive, or of the joint's own spring.
    """

    force: Array
    span: Array
    speed: Array
    middle: Array
    rest: Array
    gain: Array


Force = Callable[[Now], tuple[Any, Any]]
Signal = Callable[..., Array]


# Shapes: how an effect that is a constant in the plugin changes with size or time.
def evenly(r: Array, t: Any, x: Numbers) -> Array:
    return 1.0 + x["a"] * r


def square(r: Array, t: Any, x: Numbers) -> Array:
    return 1.0 + x["a"] * r * r


def soon(r: Array, t: Any, x: Numbers) -> Array:
    return 1.0 - x["a"] * np.tanh(3.0 * r)


def power(r: Array, t: Any, x: Numbers) -> Array:
    return np.asarray((r + 0.02) ** (x["p"] - 1.0))


def thinning(r: Array, t: Any, x: Numbers) -> Array:
    return 1.0 / (1.0 + x["a"] * r)


def warming(r: Array, t: Any, x: Numbers) -> Array:
    return 1.0 - x["a"] * np.exp(-np.maximum(t, 0.0) / x["T"]) + 0.0 * r


def gain(u: Array, t: Array, top: Array, s: float, x: Numbers, shape: Shape) -> Array:
    """Return a factor that depends on the level or on time."""
    return u * (1.0 + s * shape(np.abs(u) / top, t[:, None], x))


def offset(u: Array, t: Array, top: Array, s: float, x: Numbers, shape: Shape) -> Array:
    """Return an offset that depends on the level or on time."""
    return u + s * top * shape(np.abs(u) / top, t[:, None], x)


def eccentric(u: Array, t: Array, top: Array, s: float, x: Numbers, shape: Shape) -> Array:
    """Return an offset that is larger at some levels: a disc beside its axis."""
    return u + s * top * (1.0 + x["a"] * np.sin(np.pi * u / top + x["phase"]))


def softplus(e: Array, w: Array) -> Array:
    return np.asarray(w * np.logaddexp(0.0, e / w))


def root(e: Array, w: Array) -> Array:
    return np.asarray(0.5 * (e + np.sqrt(e * e + w * w)))


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


# Forces.
def spring(c: Sizes, s: float, x: Numbers, shape: Shape) -> Force:
    def force(n: Now) -> tuple[Any, Any]:
        e = n.q - c.rest
        return -s * c.force / c.span * e * shape(np.abs(e) / c.span, n.time_s, x), 0.0

    return force


def shifted(c: Sizes, s: float, x: Numbers, shape: Shape) -> Force:
    """Return the force of a spring that rests elsewhere, by an amount that changes with angle or time."""
    return lambda n: (c.gain * s * shape(np.abs(n.q - c.rest) / c.span, n.time_s, x), 0.0)


def dashpot(c: Sizes, s: float, x: Numbers, shape: Shape) -> Force:
    return lambda n: (0.0, s * c.force / c.speed * shape(np.abs(n.v) / c.speed, n.time_s, x))


def rubbing(c: Sizes, s: float, x: Numbers, shape: Callable[[Array], Array]) -> Force:
    """Return dry friction that sets in within a small speed."""

    def force(n: Now) -> tuple[Any, Any]:
        r = np.abs(n.v) / c.speed
        return 0.0, s * c.force * shape(r / x["w"]) / (r * c.speed + TINY)

    return force


def tanh(r: Array) -> Array:
    return np.asarray(np.tanh(r))


def rooted(r: Array) -> Array:
    return np.asarray(r / np.sqrt(1.0 + r * r))


def falling(c: Sizes, s: float, x: Numbers, shape: Callable[[Array], Array]) -> Force:
    """Return dry friction that vanishes with the speed."""

    def force(n: Now) -> tuple[Any, Any]:
        r = np.abs(n.v) / c.speed
        return 0.0, s * c.force * np.tanh(r / 0.02) * shape(r / x["fall"]) / (r * c.speed + TINY)

    return force


def exponential(r: Array) -> Array:
    return np.asarray(np.exp(-r))


def lorentz(r: Array) -> Array:
    return np.asarray(1.0 / (1.0 + r * r))


def bristle(c: Sizes, s: float, x: Numbers, shape: Any) -> Force:
    """Return the friction of Dahl (p = 1) and of Bouc & Wen (p > 1)."""
    memory: dict[str, Array] = {}

    def force(n: Now) -> tuple[Any, Any]:
        z, before = memory.get("z", np.zeros_like(n.q)), memory.get("q", n.q)
        step = np.clip((n.q - before) / (x["slip"] * c.span), -1.0, 1.0)
        z = np.clip(z + step * (1.0 - np.abs(z) ** x["p"] * (step * z > 0.0)), -1.0, 1.0)
        memory.update(z=z, q=n.q.copy())
        return -s * c.force * z, 0.0

    return force


def stops(c: Sizes, s: float, x: Numbers, shape: Sequence[float]) -> Force:
    """Return several springs that slip one after the other."""
    memory: dict[str, Any] = {}

    def force(n: Now) -> tuple[Any, Any]:
        zs, before = memory.get("z", [np.zeros_like(n.q)] * len(shape)), memory.get("q", n.q)
        limits = [x["slip"] * c.span * one for one in shape]
        zs = [np.clip(z + n.q - before, -limit, limit) for z, limit in zip(zs, limits, strict=True)]
        memory.update(z=zs, q=n.q.copy())
        return -s * c.force * sum(z / m for z, m in zip(zs, limits, strict=True)) / len(shape), 0.0

    return force


def relaxing(c: Sizes, s: float, x: Numbers, shape: Sequence[float]) -> Force:
    """Return springs that relax, each in its own time."""
    memory: dict[str, Any] = {}

    def force(n: Now) -> tuple[Any, Any]:
        hs, before = memory.get("h", [np.zeros_like(n.q)] * len(shape)), memory.get("q", n.q)
        times = [x["T"] * one for one in shape]
        hs = [(h + n.q - before) / (1.0 + n.step_s / time) for h, time in zip(hs, times, strict=True)]
        memory.update(h=hs, q=n.q.copy())
        return -s * c.force / c.span * sum(hs) / len(shape), 0.0

    return force


def gap(c: Sizes, s: float, x: Numbers, shape: Callable[..., Array]) -> Force:
    """Return what a play with rounded ends takes from a position drive; `above`: only where the drive pushes."""

    def force(n: Now) -> tuple[Any, Any]:
        e, half = n.command - n.q, s * c.span
        width = x["a"] * half + TINY
        pulled = shape(-e - half, width) - shape(-half, width)
        pushed = e if x.get("one_way") else shape(e - half, width) - shape(-half, width)
        left = np.where(e < 0.0, -pulled, pushed)
        return c.gain * (left - e), 0.0

    return force


def ripple(c: Sizes, s: float, x: Numbers, shape: Any) -> Force:
    return lambda n: (s * c.force * np.sin(x["n"] * 2.0 * np.pi * n.q / c.span + x["phase"]), 0.0)


def cogged(c: Sizes, s: float, x: Numbers, shape: Any) -> Force:
    """Return a share of the drive that changes its sign from tooth to tooth."""
    return lambda n: (
        s * n.drive * np.sign(np.sin(x["n"] * 2.0 * np.pi * n.q / c.span + x["phase"])),
        0.0,
    )


def coupled(c: Sizes, s: float, x: Numbers, shape: Any) -> Force:
    """Return forces of each joint's neighbour: by product with its own position."""
    return lambda n: (
        s * c.force * np.roll((n.q - c.middle) / c.span, 1, axis=1) * (x["a"] + (n.q - c.middle) / c.span),
        0.0,
    )


def dragged(c: Sizes, s: float, x: Numbers, shape: Any) -> Force:
    """Return forces with the size of the speed of each joint's neighbour."""
    return lambda n: (s * c.force * np.abs(np.roll(n.v / c.speed, 1, axis=1)) ** x["p"], 0.0)


def arm(c: Sizes, s: float, x: Numbers, shape: Any) -> Force:
    """Return a moment arm that changes with the angle, beside the centre."""
    return lambda n: (s * n.drive * np.sin(x["n"] * (n.q - c.middle) / c.span + x["phase"]), 0.0)


def lost_arm(c: Sizes, s: float, x: Numbers, shape: Any) -> Force:
    return lambda n: (-s * n.drive * ((n.q - c.middle) / c.span - x["a"]) ** 2, 0.0)


def gusts(c: Sizes, s: float, x: Numbers, shape: Sequence[float]) -> Force:
    """Return a push that comes and goes with time, whatever the system does, at places by their order."""

    def force(n: Now) -> tuple[Any, Any]:
        wave = sum(np.sin(2.0 * np.pi * f * x["hz"] * n.time_s + f * x["phase"]) for f in shape)
        return s * c.force * wave + 0.0 * n.q, 0.0

    return force


# Signals without a plugin.
def sagging(u: Array, t: Array, top: Array, s: float, x: Numbers, shape: Any) -> Array:
    """Return inputs of one supply (all columns) that fall with their sum; `T`: late."""
    load = np.mean(np.abs(u) / top, axis=1, keepdims=True) ** x["p"]
    if "T" in x:
        load = _lag(load, t, x["T"])
    return u * (1.0 - s * load)


def wavy(u: Array, t: Array, top: Array, s: float, x: Numbers, shape: Sequence[float]) -> Array:
    """Return readings of a disc with marks at unequal distances."""
    return u + s * top * sum(np.sin(f * x["n"] * np.pi * u / top + f * x["phase"]) for f in shape)


# Changes of numbers.
def heavier(model: Any, body: int, s: float, x: Numbers, shape: Any) -> None:
    """Change the mass, with the inertia to a power, and take a share of it from the body before."""
    before = int(model.body_parentid[body])
    taken = x.get("taken", 0.0) * s * model.body_mass[body]
    if model.body_mass[before] > 2.0 * abs(taken):
        model.body_mass[before] -= taken
    model.body_mass[body] *= 1.0 + s
    model.body_inertia[body] *= (1.0 + s) ** x["p"]


def beside(model: Any, body: int, s: float, x: Numbers, shape: Any) -> None:
    """Move the centre of mass by a share of the body's size, and change the mass or the inertia a little."""
    way = np.array([x["x"], x["y"], x["z"]])
    model.body_ipos[body] += s * size_m(model, body) * way / np.linalg.norm(way)
    model.body_mass[body] *= 1.0 + x.get("mass", 0.0) * s
    model.body_inertia[body] *= 1.0 + x.get("inertia", 0.0) * s


def turning(model: Any, body: int, s: float, x: Numbers, shape: Any) -> None:
    """Change the three inertias unequally."""
    model.body_inertia[body] *= 1.0 + s * (1.0 + x["a"] * np.asarray(shape))
    model.body_mass[body] *= 1.0 + x.get("mass", 0.0) * s


def loaded(model: Any, body: int, s: float, x: Numbers, shape: Any) -> None:
    """Add a ball or a point beside the origin of the body's frame, by its parallel axes."""
    mass, more = float(model.body_mass[body]), s * float(model.body_mass[body])
    point = x["away"] * size_m(model, body) * np.array([x["x"], x["y"], x["z"]])
    centre = model.body_ipos[body].copy()
    new = (mass * centre + more * point) / (mass + more)
    model.body_inertia[body] += (
        mass * np.sum((centre - new) ** 2) + more * np.sum((point - new) ** 2) + 0.4 * more * x["ball"] ** 2
    )
    model.body_mass[body], model.body_ipos[body] = mass + more, new


def draining(model: Any, body: int, s: float, x: Numbers, shape: Any) -> Callable[[float], None]:
    """Return what changes a body's mass with time: it empties, or what it holds moves."""
    mass = float(model.body_mass[body])

    def change(time_s: float) -> None:
        swing = np.sin(2.0 * np.pi * x["hz"] * time_s) if "hz" in x else np.exp(-max(time_s, 0.0) / x["T"])
        model.body_mass[body] = mass * (1.0 + s * swing)

    return change


def size_m(model: Any, body: int) -> float:
    """Return the radius of gyration of a body."""
    return float(np.sqrt(0.5 * model.body_inertia[body].sum() / max(model.body_mass[body], TINY)))


def lighter(model: Any, body: int, s: float, x: Numbers, shape: Callable[[Array], Array]) -> None:
    """Scale weights by forces that act against them, more at the far bodies or at the near ones."""
    along = np.linspace(0.0, 1.0, model.nbody - 1)
    model.body_gravcomp[1:] -= s * (1.0 + x["a"] * shape(along))
    model.ngravcomp = model.nbody - 1


def tilted(model: Any, body: int, s: float, x: Numbers, shape: Any) -> None:
    """Tilt gravity and change its size a little."""
    down = model.opt.gravity.copy()
    side = np.array([np.cos(x["way"]), np.sin(x["way"]), 0.0])
    model.opt.gravity[:] = down * (np.cos(s) + x["a"] * s) + np.linalg.norm(down) * np.sin(s) * side


def mounted(model: Any, body: int, s: float, x: Numbers, shape: Any) -> None:
    """Turn what hangs on the world about an axis near the horizontal, and shift it along the turn."""
    axis = np.array([np.cos(x["way"]), np.sin(x["way"]), x["third"]])
    turn, matrix, quat = np.empty(4), np.empty(9), np.empty(4)
    mujoco.mju_axisAngle2Quat(turn, axis / np.linalg.norm(axis), s)
    mujoco.mju_quat2Mat(matrix, turn)
    for k in np.flatnonzero(model.body_parentid[1:] == 0) + 1:
        lever = model.body_pos[k] + np.array([0.0, 0.0, x["lever_m"]])
        model.body_pos[k] = matrix.reshape(3, 3) @ lever - np.array([0.0, 0.0, x["lever_m"]])
        mujoco.mju_mulQuat(quat, turn, model.body_quat[k])
        model.body_quat[k] = quat
