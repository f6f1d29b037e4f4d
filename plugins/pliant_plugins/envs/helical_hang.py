"""``gymnasium.make("pliant/HelicalHang-v0")``"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from pliant.records.design import Array
from pliant_plugins.envs.reach import ReachEnv

WEIGHT_N_KG = 9.81
TIP_LOADS_KG = (0.0, 0.01, 0.02, 0.05)


class HelicalHangEnv(ReachEnv):
    """Hold the tip of a helical actuator at the target with 0, 10, 20 or 50 g hung there, or the study's `loads`."""

    default_study: ClassVar[str] = "helical_hang"
    force_scale_n: ClassVar[float] = TIP_LOADS_KG[-1] * WEIGHT_N_KG

    def _draw_force(self) -> Array:
        config = getattr(self.plant.task, "config", None)
        loads = getattr(config, "loads_kg", TIP_LOADS_KG)
        return np.array([0.0, 0.0, -WEIGHT_N_KG * self.np_random.choice(loads)])
