"""Trials as the numbers that pycma ranks: evaluated ones, then failed ones, then refused ones by their amount."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from pliant_search.optimizer import Trial


@dataclass(frozen=True)
class ScoredTrial:
    """The result of a sample: an objective, or None if its evaluation failed, or a violation above 0."""

    objective: float | None
    violation: float = 0.0

    @classmethod
    def from_trial(cls, trial: Trial) -> ScoredTrial:
        """Score a trial: an infinite objective counts as a failure, a NaN violation as the largest one."""
        violation = float(trial.violation)
        if not violation <= 0:
            return cls(None, violation if math.isfinite(violation) else 1e300)
        return cls(float(trial.objective) if math.isfinite(trial.objective) else None)


FAILED = ScoredTrial(None)
MOST = 1e150  # so that the distance behind the worst stays finite


def fitness(results: Sequence[ScoredTrial], worst: float | None) -> list[float]:
    """Return one finite number per candidate. Ranks would suffice for pycma's update, but pycma regards a run with
    constant lowest values as converged, which a search outside its constraints is not.

    Args:
        results: of a generation.
        worst: the highest objective that any generation has had, this one included; None where there was none.
    """
    base = 0.0 if worst is None else min(max(worst, -MOST), MOST)
    step = max(abs(base), 1.0)
    return [
        base + step * (1 + math.log1p(r.violation))
        if r.violation > 0
        else base + 0.5 * step
        if r.objective is None
        else min(max(r.objective, -MOST), MOST)
        for r in results
    ]
