"""A chain alone in MuJoCo: it moves in real time, relaxes in pseudo-time, or goes through histories."""

from __future__ import annotations

import math
import warnings
from contextlib import ExitStack
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from pliant.mechanics.statics import ChainStatics, Loads
from pliant.mechanics.terms import Memory
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.rollout import Rollout
from pliant_plugins.physics.dynamic import DynamicSimulation
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.mujoco.joints import ChainJoints
from pliant_plugins.physics.mujoco.mjcf import chain_mjcf
from pliant_plugins.physics.mujoco.motion import CompiledMotion, Samples, step_of
from pliant_plugins.physics.mujoco.warned import silent, unstable
from pliant_plugins.physics.stepping import check_driven, n_parts, sample_by_sample


class MujocoChain:
    """The compiled model and its data."""

    def __init__(self, chain: ChainModel, statics: ChainStatics, config: MujocoConfig) -> None:
        self._config = config
        self.model = mujoco.MjModel.from_xml_string(chain_mjcf(chain))
        self.data = mujoco.MjData(self.model)
        self.joints = ChainJoints(self.model, self.data, chain, statics)
        self._rested = statics.efforts.terms.rested()
        self.compiled = CompiledMotion.of(self.model, self.data, self.joints)
        self._relaxing = ExitStack()

    @property
    def q(self) -> Array:
        """(n, a) joint coordinates."""
        return self.joints.q

    @property
    def rates(self) -> Array:
        """(n, a) rates dq/dt of the joint coordinates."""
        return self.joints.rates

    def place(self, q: Array, rates: Array) -> None:
        """Set joint coordinates and their rates."""
        self.joints.place(q, rates)

    def halt(self, q: Array) -> None:
        """Put the chain at q without velocity."""
        self.place(q, np.zeros_like(q))

    def begin_relaxing(self) -> None:
        """Pseudo-time of the settle step, without physical damping.

        What MuJoCo says of bold moves is not passed on: they are undone, and the end is judged by the statics.
        """
        self.model.opt.timestep = self._config.settle_timestep_s
        self._relaxing.enter_context(silent())

    def end_relaxing(self) -> None:
        """`travel` sets its own step."""
        unstable(self.data)
        self._relaxing.close()

    def relax_step(self, loads: Loads, q: Array, load_stiffness: Array, caution: float) -> None:
        """One pseudo-time step (`pliant.mechanics.relaxation`): the loads' stiffness is made implicit too."""
        self.joints.drive(loads, 0.0, load_stiffness, caution)
        mujoco.mj_step(self.model, self.data)

    def travel(self, loads: Loads, duration_s: float) -> Memory | None:
        """Advance in real time in equal steps no longer than the config's; the memory of law terms at the end.

        Where MuJoCo calls the motion unstable, that is a RuntimeWarning.
        """
        memory, bad = self.march(loads, duration_s)
        _complain(bad, f"within the last {duration_s:g} s")
        return memory

    def march(self, loads: Loads, duration_s: float) -> tuple[Memory | None, str | None]:
        """`travel` without a warning: the memory, and which quantity became unbounded, or None."""
        if self.compiled is not None and not loads.forces and not loads.cords:
            samples = Samples.held(self.joints.statics.efforts.values(loads.actuation), loads, duration_s)
            end = self.go(samples, loads.memory)[2]
            return (None if loads.memory is None else end), unstable(self.data)
        n_steps = max(1, math.ceil(duration_s / self._config.timestep_s - 1e-9))
        step_s = self.model.opt.timestep = step_of(duration_s, n_steps)
        # Resistance in proportion to mass is the same decay for every velocity.
        kept = math.exp(-self._config.drag_1_s * step_s)
        with silent():
            for _ in range(n_steps):
                self.data.qvel *= kept
                if loads.memory is not None:
                    loads = loads.after(loads.memory.over(step_s))
                self.joints.drive(loads, self._config.joint_damping)
                mujoco.mj_step(self.model, self.data)
                loads = self.joints.remember(loads)
        memory = None if loads.memory is None else loads.memory.over(math.inf)
        return memory, unstable(self.data)

    def go(
        self, samples: Samples, memory: Memory | None, places: bool = False
    ) -> tuple[Array, Array, Memory]:
        """`CompiledMotion.run` with the config's step and damping; the caller asks `unstable`."""
        assert self.compiled is not None
        config = self._config
        past = self._rested if memory is None else memory
        with silent():
            return self.compiled.run(
                samples, past, config.timestep_s, config.joint_damping, config.drag_1_s, places
            )

    def complain(self, where: str) -> None:
        """A RuntimeWarning where the motion has become unbounded since the last call."""
        _complain(unstable(self.data), where)

    def markers(self) -> Array:
        """(n + 2, 3) base, joints and tip from MuJoCo's own kinematics."""
        mujoco.mj_kinematics(self.model, self.data)
        return self.joints.markers()

    def close(self) -> None:
        """MuJoCo frees its memory with the object."""


def _complain(bad: str | None, where: str) -> None:
    if bad is not None:
        warnings.warn(f"mujoco: the motion is unstable ({bad}) {where}", RuntimeWarning, stacklevel=3)


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
