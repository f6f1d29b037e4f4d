"""Objectives as rewards."""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.records.design import Array

# What a candidate without an objective loses against the worst that is known, as a share of all that is known.
MARGIN = 0.1


class Rewards:
    """Minus the objective.

    A candidate that failed, or whose objective is NaN, gets the worst reward known so far less a margin: a tenth of
    the range of the known ones, 1 where that is 0 or nothing is known. One that breaks constraints loses up to
    another margin, by how far it breaks them (1 or more: all of it).

    They are not normalised by running statistics: PPO normalises the advantages of every batch, and on a problem of
    two conditions (3000 candidates, three seeds) objectives a thousand times as large, or ten higher in one condition,
    were learned as well without.
    """

    def __init__(self) -> None:
        self._worst, self._best = np.inf, -np.inf

    def of(self, objectives: Array, violations: Array) -> Array:
        """(n,) rewards of a batch; objectives of what was refused or has failed are NaN."""
        rewards = -np.asarray(objectives, float)
        known = rewards[np.isfinite(rewards)]
        if len(known):
            self._worst = min(self._worst, float(known.min()))
            self._best = max(self._best, float(known.max()))
        return np.where(np.isfinite(rewards), rewards, self._lowest(np.clip(violations, 0.0, 1.0)))

    def _lowest(self, violations: Array) -> Array:
        known = self._best >= self._worst
        worst, span = (self._worst, self._best - self._worst) if known else (0.0, 0.0)
        lowest: Array = worst - (MARGIN * span or 1.0) * (1.0 + violations)
        return lowest

    def state(self) -> dict[str, Any]:
        """As JSON values."""
        return {"known": [self._worst, self._best] if self._best >= self._worst else None}

    def restore(self, state: dict[str, Any]) -> None:
        """As `state` left them."""
        self._worst, self._best = state["known"] or (np.inf, -np.inf)
