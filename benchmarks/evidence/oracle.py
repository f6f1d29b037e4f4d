"""A scorer with the true forms: an upper bound of identification under the poor protocol.

For every kind that makes sense on the robot, the form of the truth itself, with its shapes, the law's error and the
engine's creep all known, is fitted to the set by its strength alone; BIC with the diagnoser's own effective sample
size decides. The true kind's shapes are those of the set; the others' are drawn as its own were.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from benchmarks.evidence.protocols import protocol
from benchmarks.evidence.robots import ROBOTS, Array
from benchmarks.evidence.sets import MeasuredSet, SetSpec, draw_truth, follow
from benchmarks.evidence.truths import CLEAN, KINDS, HiddenTruth, draw_part, kind_robots

# Strengths that are looked at first, in shares of the largest sensible one; then a few Gauss-Newton steps.
LOOKED_AT = (0.02, 0.06, 0.15, 0.3, 0.6)
STEPS = 4
SLOPE = 1e-3


def mean_squares(spec: SetSpec, made: MeasuredSet) -> dict[str, float]:
    """Return the mean squared error over σ of each kind's best fit; `CLEAN` is the unchanged model."""
    robot = ROBOTS[spec.robot]
    runs = protocol(spec.protocol, robot)
    truth = draw_truth(spec)
    rng = np.random.default_rng(spec.seed)
    slips = np.zeros(len(runs))
    measured = _flat(made.measured, made.sigma)

    def left(candidate: HiddenTruth) -> Callable[[float], Array]:
        def residual(strength: float) -> Array:
            read = follow("functional", robot, runs, candidate.at(strength), slips)
            return _flat(read, made.sigma) - measured

        return residual

    found = {CLEAN: float(np.mean(left(truth)(0.0) ** 2))}
    for kind in KINDS:
        if spec.robot not in kind_robots(kind):
            continue
        part = draw_part(kind, "functional", robot, spec.split, rng)
        signed = "sign" in part.drawn
        if kind == spec.kind and spec.engine == "functional":
            part = truth.parts[0]
        residual = left(replace(truth, parts=(part,)))
        found[kind] = best(residual, -part.largest if signed else 0.0, part.largest, found[CLEAN])
    return found


def best(residual: Callable[[float], Array], least: float, largest: float, at_zero: float) -> float:
    """Minimise the mean square over strengths from `least` to `largest`: the best of a few, then Gauss-Newton."""
    tried = {0.0: at_zero}
    for strength in [end * share for end in (largest, least) if end for share in LOOKED_AT]:
        tried[strength] = _square(residual, strength)
    strength = min(tried, key=lambda s: tried[s])
    for _ in range(STEPS):
        here = _safe(residual, strength)
        there = _safe(residual, strength + SLOPE * largest)
        if here is None or there is None:
            break
        slope = (there - here) / (SLOPE * largest)
        curvature = float(slope @ slope)
        if curvature == 0.0:
            break
        strength = float(np.clip(strength - float(slope @ here) / curvature, least, largest))
        tried[strength] = _square(residual, strength)
    return min(tried.values())


def choice(squares: Mapping[str, float], n_effective: float) -> str:
    """Return the kind with the largest −½ n ln S − ½ k ln n; k is 1, and 0 for `CLEAN`."""

    def evidence(kind: str) -> float:
        price = 0.0 if kind == CLEAN else 0.5 * math.log(n_effective)
        return -0.5 * n_effective * math.log(squares[kind]) - price

    return max(squares, key=evidence)


def _safe(residual: Callable[[float], Array], strength: float) -> Array | None:
    """Return the residual at a strength; None if the form has no equilibrium."""
    try:
        return residual(strength)
    except (RuntimeError, np.linalg.LinAlgError):
        return None


def _square(residual: Callable[[float], Array], strength: float) -> float:
    left = _safe(residual, strength)
    return math.inf if left is None or not np.isfinite(left).all() else float(np.mean(left**2))


def _flat(outputs: Sequence[Mapping[str, Array]], sigma: Mapping[str, float]) -> Array:
    """Return all readings in σ, in one row."""
    return np.concatenate([run[name] / sigma[name] for run in outputs for name in run])
