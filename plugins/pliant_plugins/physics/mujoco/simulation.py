"""A chain alone in MuJoCo as a simulation, also through histories."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pliant.mechanics.statics import ChainStatics
from pliant.records.chain import ChainModel
from pliant_plugins.physics.dynamic import DynamicSimulation
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.mujoco.engine import MujocoChain


@dataclass(frozen=True)
class Moved:
    """The end of a timed step; `converged` is False where the motion became unbounded."""

    converged: bool


class MujocoSimulation(DynamicSimulation):
    """See `DynamicSimulation`; `warm` and `advance` are what `step_through` needs."""

    def __init__(self, chain: ChainModel, config: MujocoConfig) -> None:
        statics = ChainStatics(chain)
        self.engine = MujocoChain(chain, statics, config)
        super().__init__(chain, statics, self.engine, config.tolerance, config.max_settle_steps)

    def warm(self, temperature_c: float) -> None:
        """Set the temperature that law terms see from now on."""
        if self._memory is not None:
            self._memory = replace(self._memory, temperature_c=temperature_c)

    def advance(self, duration_s: float) -> Moved:
        """Move on in time; settle where the step takes for ever.

        A motion that becomes unbounded is taken back: the chain halts where it was before.
        """
        if math.isinf(duration_s):
            return Moved(self.settle().converged)
        if duration_s <= 0.0:
            return Moved(True)
        start = self.engine.q
        memory, bad = self.engine.march(self.now(), duration_s)
        if bad is not None or not np.isfinite(self.engine.q).all():
            self.engine.halt(start)
            return Moved(False)
        self._memory = memory
        self._time_s += duration_s
        return Moved(True)
