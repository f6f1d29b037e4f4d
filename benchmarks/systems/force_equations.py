"""Hidden forces at joints and tendons, by other equations than the plugins'.

An equation is started anew for every simulation, from the sizes c of its places, its strength s, its numbers x and its
shape; it returns, step by step, a force and a damping at (r, n) places of all runs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from benchmarks.systems.shapes import TINY, Array, Numbers, Shape


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
    """Of (n,) places: sizes of force, range and speed in the clean motion, its middle, a spring's rest, a stiffness.

    The stiffness is that of a position drive, or of the joint's own spring.
    """

    force: Array
    span: Array
    speed: Array
    middle: Array
    rest: Array
    gain: Array


Force = Callable[[Now], tuple[Any, Any]]


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


def falling(c: Sizes, s: float, x: Numbers, shape: Callable[[Array], Array]) -> Force:
    """Return dry friction that vanishes with the speed."""

    def force(n: Now) -> tuple[Any, Any]:
        r = np.abs(n.v) / c.speed
        return 0.0, s * c.force * np.tanh(r / 0.02) * shape(r / x["fall"]) / (r * c.speed + TINY)

    return force


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
