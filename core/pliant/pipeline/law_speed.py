"""How many times a second a law can be evaluated, with its slopes, on this machine at this moment."""

from __future__ import annotations

import time

import numpy as np

from pliant.records.law import JointLaw

AT_ONCE = 20_000
REPEATS = 5
FALLBACK = np.array([0.0, 1.0])  # a limit that a stated law does not give


def evaluations_per_second(law: JointLaw, count: int = AT_ONCE) -> float:
    """Best of a few calls of `law.evaluate` with `count` random states of its domain; one call warms it up."""
    box = np.vstack([law.domain.actuation, law.domain.deformation])
    box = np.where(np.isfinite(box), box, FALLBACK)
    values = box[:, 0] + np.ptp(box, axis=1) * np.random.default_rng(0).random((count, len(box)))
    p, u = np.ascontiguousarray(values[:, 0]), np.ascontiguousarray(values[:, 1:])
    law.evaluate(p, u)
    best = np.inf
    for _ in range(REPEATS):
        started = time.perf_counter()
        law.evaluate(p, u)
        best = min(best, time.perf_counter() - started)
    return count / best
