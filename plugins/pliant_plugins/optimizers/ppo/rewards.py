"""Objectives as rewards."""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.records.design import Array

# What a candidate without an objective loses against the worst that is known, as a share of all that is known.
MARGIN = 0.1
LARGEST = 10.0  # of a normalised reward, as in stable-baselines3's VecNormalize


class Rewards:
    """Minus the objective. A candidate that was refused, or failed, or whose objective is NaN gets the worst reward
    known so far less a tenth of the range of the known ones; before anything is known, −1.

    With `normalize` the running mean and deviation are taken out. In episodes of one step neither changes which
    policy is best.
    """

    def __init__(self, normalize: bool) -> None:
        self._normalize = normalize
        self._worst, self._best = np.inf, -np.inf
        self._count, self._mean, self._square = 0.0, 0.0, 0.0

    def of(self, objectives: Array) -> Array:
        """(n,) rewards of a batch; not-a-number objectives are those that failed."""
        rewards = -np.asarray(objectives, float)
        known = rewards[np.isfinite(rewards)]
        if len(known):
            self._worst = min(self._worst, float(known.min()))
            self._best = max(self._best, float(known.max()))
        filled = np.where(np.isfinite(rewards), rewards, self._lowest)
        return self._normalised(filled) if self._normalize else filled

    @property
    def _lowest(self) -> float:
        if self._best < self._worst:
            return -1.0
        return self._worst - (MARGIN * (self._best - self._worst) or 1.0)

    def _normalised(self, rewards: Array) -> Array:
        """By the statistics of all rewards up to these (Chan and others, 1979)."""
        count, mean = self._count + len(rewards), float(rewards.mean())
        shift = mean - self._mean
        self._square += float(np.sum((rewards - mean) ** 2)) + shift**2 * self._count * len(rewards) / count
        self._mean += shift * len(rewards) / count
        self._count = count
        deviation = np.sqrt(self._square / count) or 1.0
        scaled: Array = np.clip((rewards - self._mean) / deviation, -LARGEST, LARGEST)
        return scaled

    def state(self) -> dict[str, Any]:
        """As JSON values."""
        known = self._best >= self._worst
        return {
            "known": [self._worst, self._best] if known else None,
            "moments": [self._count, self._mean, self._square],
        }

    def restore(self, state: dict[str, Any]) -> None:
        """As `state` left them."""
        self._worst, self._best = state["known"] or (np.inf, -np.inf)
        self._count, self._mean, self._square = state["moments"]
