"""Ratio of an error to its noise floor: whether it is small, and how much a perfect model would remove."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pliant.formatting import whole_percent
from pliant.measurements.floors import Floor

# In units of the noise: an error below it is small, whatever its standard error.
CLEARLY_ABOVE = 1.15
# An error above the noise by fewer standard errors is not distinguished from it.
STANDARD_ERRORS = 2.0


@dataclass(frozen=True)
class Excess:
    """An RMS error over its noise floor.

    Attributes:
        ratio: error / floor; NaN where the floor is unknown.
        se: standard error of the ratio; NaN where it is unknown.
    """

    ratio: float = math.nan
    se: float = math.nan

    @staticmethod
    def from_ratio(ratio: float, floors: Mapping[str, Floor], n_effective: float) -> Excess:
        """Return the ratio with its standard error, from s / √(2 n_eff) of the readings and those of the floors."""
        known = [floor for floor in floors.values() if floor.value > 0]
        floor_se = float(np.sqrt(np.mean([(one.se / one.value) ** 2 for one in known]))) if known else 0.0
        return Excess(ratio, float(ratio * np.hypot(1.0 / np.sqrt(2.0 * max(n_effective, 1.0)), floor_se)))

    @property
    def slight(self) -> bool:
        """Return whether the ratio is below `CLEARLY_ABOVE`: there is little to gain."""
        return self.ratio < CLEARLY_ABOVE

    @property
    def small(self) -> bool:
        """Return whether the error is slight, or not distinguished from the noise."""
        unsure = STANDARD_ERRORS * self.se if math.isfinite(self.se) else 0.0
        return self.slight or self.ratio - 1.0 < unsure

    @property
    def gain(self) -> str:
        """Return how much of the error a perfect model would remove, in words."""
        share = 1.0 - 1.0 / self.ratio if self.ratio > 1.0 else 0.0
        return f"at most {whole_percent(share)} of the error to gain" if share > 0.0 else "nothing to gain"

    @property
    def words(self) -> str:
        """Return words for a small error: ``small: 1.04 ± 0.06 times the noise (at most 4 % of the error to gain)``."""
        if self.slight:
            return f"small: {self} times the noise ({self.gain})"
        return f"not distinguishable from the noise: {self} times it"

    def __str__(self) -> str:
        """Return ``1.04 ± 0.06``."""
        return f"{self.ratio:.2f} ± {self.se:.2f}" if math.isfinite(self.se) else f"{self.ratio:.2f}"
