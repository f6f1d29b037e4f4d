"""A chain alone in MuJoCo as a simulation, also through histories."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pliant.mechanics.statics import ChainStatics
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.rollout import Rollout
from pliant_plugins.physics.dynamic import DynamicSimulation
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.mujoco.engine import MujocoChain
from pliant_plugins.physics.mujoco.motion import Samples
from pliant_plugins.physics.mujoco.warned import unstable
from pliant_plugins.physics.stepping import check_driven, n_parts, sample_by_sample


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

    def roll(self, history: History) -> Rollout | None:
        """Through a history from where the chain is; None where that takes single steps in Python.

        Raises:
            UserError: an input that is missing or not a number.
        """
        if self.engine.compiled is None or history.time_s is None:
            return None
        check_driven(self.chain, [history])
        q, markers, _ = self.engine.go(Samples.of(self.chain, history), self._memory, places=True)
        self.engine.complain(f"within run '{history.run}'")
        actuation = np.stack([history.actuation[name] for name in history.actuation], axis=1)
        return Rollout(history.time_s, actuation, q, markers)

    def follow(self, samples: Samples) -> Array | None:
        """Coordinates (t, n, a); None, and nothing has changed, where the motion became unbounded."""
        start = self.snapshot()
        q, _, memory = self.engine.go(samples, self._memory)
        if unstable(self.engine.data) is not None or not np.isfinite(q).all():
            self.restore(start)
            return None
        self._memory = None if self._memory is None else memory
        self._time_s += float(samples.duration.sum())
        return q


def through(
    simulation: MujocoSimulation, history: History, longest_step_s: float
) -> tuple[Array, NDArray[np.bool_]]:
    """`sample_by_sample`, in one compiled call where that is possible."""
    if history.time_s is None or simulation.engine.compiled is None:
        return sample_by_sample(simulation, history, longest_step_s)
    q, reached = sample_by_sample(simulation, history, longest_step_s, last=1)
    samples = Samples.of(simulation.chain, history)
    parts = n_parts(samples.duration, longest_step_s)
    path = simulation.follow(samples.in_parts(parts).after_first())
    simulation.apply(history.at(len(history) - 1))
    if path is None:
        later, known = sample_by_sample(simulation, history, longest_step_s, first=1)
    else:
        later = path[np.cumsum(parts[1:]) - 1]
        known = np.ones(len(later), bool)
    return np.concatenate([q, later]), np.concatenate([reached, known])
