"""``gymnasium.make("pliant/TipLoad-v0")``"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from pliant.records.design import Array
from pliant_plugins.envs.reach import ReachEnv


class TipLoadEnv(ReachEnv):
    """The same with a dead force at the tip, in any direction of the bending plane and up to `force_scale_n`."""

    default_study: ClassVar[str] = "tip_load"
    force_scale_n: ClassVar[float] = 0.13

    def _draw_force(self) -> Array:
        size, angle = self.np_random.uniform(0.0, self.force_scale_n), self.np_random.uniform(0.0, 2 * np.pi)
        plane = self.chain.base_rotation[:, [0, 2]]  # chain x and z: bending is about y
        return np.asarray(size * plane @ [np.cos(angle), np.sin(angle)])
