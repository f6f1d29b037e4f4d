"""The grid: Chebyshev levels of actuation and angle; and the check states, which no fit will see."""

from __future__ import annotations

import numpy as np

from pliant.interfaces.fem import FemConfig
from pliant.pipeline.sampling.free import free_levels, largest_free
from pliant.pipeline.sampling.targets import MAIN, Target, levels
from pliant.pipeline.sampling.walk import Walk


def grid(walk: Walk, config: FemConfig, limit: float, axis: str) -> tuple[float, float]:
    """Free branch, then every angle at every actuation, nearest to the free branch first; returns the box."""
    free_levels(walk, levels(0.0, limit, config.pressures)[1:], axis)
    free = [one.state for one in walk.of(MAIN)]
    low, high = box(walk, config)
    actuations, angles = [s.actuation for s in free], [s.angle_rad for s in free]
    for p in levels(0.0, limit, config.pressures):
        here = float(np.interp(p, actuations, angles))
        for u in sorted(levels(low, high, config.angles), key=lambda u: abs(u - here)):
            walk.reach(Target("constrained", float(p), {axis: float(u)}, explored=axis))
    return low, high


def box(walk: Walk, config: FemConfig) -> tuple[float, float]:
    """Smallest and largest angle of the data: `angle_low` and `angle_high` times the largest free one."""
    largest = largest_free(walk)
    return config.angle_low * largest, config.angle_high * largest


def check_targets(
    limit: float, low: float, high: float, count: int, seed: int, axis: str, piece: str = MAIN
) -> list[Target]:
    """`count` states spread over the box by a seeded Latin hypercube."""
    random = np.random.default_rng(seed)
    strata = np.stack([random.permutation(count), random.permutation(count)], axis=1)
    points = (strata + random.random((count, 2))) / max(count, 1)
    return [
        Target(
            "constrained",
            float(a * limit),
            {axis: float(low + b * (high - low))},
            role="check",
            explored=axis,
            piece=piece,
        )
        for a, b in points
    ]
