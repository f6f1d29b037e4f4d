"""``gymnasium.make("pliant/TendonFinger-v0")``"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from pliant.records.design import Array
from pliant_plugins.envs.reach import ReachEnv

WEIGHT_N_KG = 9.81


class TendonFingerEnv(ReachEnv):
    """Pull the tendon until the tip is at the target; up to 50 g hang at the tip, another weight each time."""

    default_study: ClassVar[str] = "tendon_finger"
    force_scale_n: ClassVar[float] = 0.05 * WEIGHT_N_KG

    def _draw_force(self) -> Array:
        return np.array([0.0, 0.0, -self.np_random.uniform(0.0, self.force_scale_n)])
