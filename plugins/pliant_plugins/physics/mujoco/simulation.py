"""One chain in MuJoCo: motions in real time, in compiled calls where laws, terms and loads allow it; relaxation."""

from __future__ import annotations

import ctypes
import math
import warnings
from contextlib import ExitStack
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from pliant.mechanics.statics import ChainStatics, Loads
from pliant.mechanics.terms import TermMemory
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import REFERENCE_TEMPERATURE_C, History
from pliant.records.rollout import Rollout
from pliant_plugins.physics.compiled.motion import move
from pliant_plugins.physics.dynamic import DynamicSimulation
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.mujoco.joints import ChainJoints
from pliant_plugins.physics.mujoco.mjcf import chain_mjcf
from pliant_plugins.physics.mujoco.warned import silent, unstable
from pliant_plugins.physics.stepping import check_driven, n_parts, sample_by_sample


class Samples(NamedTuple):
    """Inputs of t samples: actuators (t, k), end moment (t,), tip force (t, 3), temperature (t,), duration (t,).

    The inputs of a sample hold during the time that leads to it; a first duration of 0 only places its inputs.
    """

    values: Array
    moment: Array
    tip_force: Array
    temperature: Array
    duration: Array

    @staticmethod
    def from_history(chain: ChainModel, history: History) -> Samples:
        """Take the samples of a history with times unchanged: inputs are constant from the preceding sample."""
        assert history.time_s is not None
        return Samples(
            np.stack([history.actuation[a.input] for a in chain.actuators], axis=1).astype(float),
            np.asarray(history.moment_n_m, float),
            np.asarray(history.tip_force_n, float),
            np.asarray(history.temperature_c, float),
            np.diff(history.time_s, prepend=history.time_s[0]),
        )

    def in_parts(self, parts: NDArray[np.int64]) -> Samples:
        """Sample k reached in parts[k] equal parts, with inputs on straight lines from the sample before."""
        number = np.repeat(np.arange(len(parts)), parts)
        share = (np.arange(len(number)) - np.repeat(np.cumsum(parts) - parts, parts) + 1) / parts[number]

        def mixed(column: Array) -> Array:
            weight = share.reshape(-1, *[1] * (column.ndim - 1))
            before = column[np.maximum(number - 1, 0)]
            return np.asarray(weight * column[number] + (1.0 - weight) * before)

        return Samples._make([*map(mixed, self[:4]), self.duration[number] / parts[number]])


class MujocoSimulation(DynamicSimulation):
    """See `DynamicSimulation`; `warm` and `advance` are what `step_through` needs."""

    joints: ChainJoints

    def __init__(
        self,
        chain: ChainModel,
        config: MujocoConfig,
        model: mujoco.MjModel | None = None,
        prefix: str = "",
    ) -> None:
        """Build the simulation; `model` contains the chain, its names with the prefix, by default the chain alone."""
        statics = ChainStatics(chain)
        self._config = config
        self.model = mujoco.MjModel.from_xml_string(chain_mjcf(chain)) if model is None else model
        self.data = mujoco.MjData(self.model)
        self.joints = ChainJoints(self.model, self.data, chain, statics, prefix)
        super().__init__(chain, statics, self.joints, config.tolerance, config.max_settle_steps)
        # Where whole motions are compiled: mj_step, mj_kinematics, the model and the data.
        self.addresses: tuple[int, ...] | None = None
        functions = _functions()
        known = self.joints.laws is not None and self.joints.terms is not None
        if functions is not None and known and hasattr(self.model, "_address"):
            self.addresses = (*functions, self.model._address, self.data._address)
        self._relaxing = ExitStack()

    def begin_relaxing(self) -> None:
        """Begin pseudo-time: the settle step, without physical damping.

        MuJoCo's warnings on large moves are not passed on: such moves are undone, and the end is checked by the
        statics.
        """
        self.model.opt.timestep = self._config.settle_timestep_s
        self._relaxing.enter_context(silent())

    def end_relaxing(self) -> None:
        """Do nothing: `step` sets its own step."""
        unstable(self.data)
        self._relaxing.close()

    def relax_step(self, loads: Loads, q: Array, load_stiffness: Array, caution: float) -> None:
        """Make one pseudo-time step (`pliant.mechanics.relaxation`): the loads' stiffness is implicit too."""
        self._drive(loads, 0.0, load_stiffness, caution)
        mujoco.mj_step(self.model, self.data)

    def step(self, duration_s: float) -> None:
        """Make equal steps no longer than the config's; unstable motion is a RuntimeWarning."""
        if duration_s > 0.0:
            self._memory = self._march(duration_s)
            self._complain(f"within the last {duration_s:g} s")
            self._time_s += duration_s

    def advance(self, duration_s: float) -> bool:
        """Move on in time; settle where the step takes for ever.

        A motion that becomes unbounded is taken back: the chain halts where it was before.
        """
        if math.isinf(duration_s):
            return self.settle().converged
        if duration_s <= 0.0:
            return True
        start = self.q
        memory = self._march(duration_s)
        if unstable(self.data) is not None or not np.isfinite(self.q).all():
            self.halt(start)
            return False
        self._memory = memory
        self._time_s += duration_s
        return True

    def markers(self) -> Array:
        mujoco.mj_kinematics(self.model, self.data)
        return self.joints.markers()

    def roll(self, history: History) -> Rollout | None:
        """Simulate a history from the present state; None if that takes single steps in Python.

        Raises:
            UserError: an input that is missing or not a number.
        """
        if self.addresses is None or history.time_s is None:
            return None
        check_driven(self.chain, [history])
        q, markers, _ = self._run(Samples.from_history(self.chain, history), places=True)
        self._complain(f"within run '{history.run}'")
        actuation = np.stack([history.actuation[name] for name in history.actuation], axis=1)
        return Rollout(history.time_s, actuation, q, markers)

    def through(self, history: History, longest_step_s: float) -> tuple[Array, NDArray[np.bool_]]:
        """Simulate as `sample_by_sample`, in one compiled call if possible."""
        if history.time_s is None or self.addresses is None:
            return sample_by_sample(self, history, longest_step_s)
        q, reached = sample_by_sample(self, history, longest_step_s, last=1)
        samples = Samples.from_history(self.chain, history)
        parts = n_parts(samples.duration, longest_step_s)
        start = self.snapshot()
        samples = Samples(*(column[1:] for column in samples.in_parts(parts)))
        path, _, memory = self._run(samples)
        if unstable(self.data) is not None or not np.isfinite(path).all():
            self.restore(start)
            self.apply(history.at(len(history) - 1))
            later, known = sample_by_sample(self, history, longest_step_s, first=1)
        else:
            self._memory = memory
            self._time_s += float(samples.duration.sum())
            self.apply(history.at(len(history) - 1))
            later = path[np.cumsum(parts[1:]) - 1]
            known = np.ones(len(later), bool)
        return np.concatenate([q, later]), np.concatenate([reached, known])

    def _drive(self, loads: Loads, *how: Any) -> None:
        """Apply forces for the next step, see `ChainJoints.drive`."""
        self.joints.drive(loads, *how)

    def _march(self, duration_s: float) -> TermMemory:
        """Move on in real time under the present loads; the memory of law terms at the end."""
        loads, config = self.now(), self._config
        if self.addresses is not None and not loads.forces and not loads.cords:
            temperature = self._memory.temperature_c if self.chain.terms else REFERENCE_TEMPERATURE_C
            values = self.statics.efforts.values(loads.actuation)
            columns = (values, loads.moment_n_m, loads.tip_force_n, temperature, duration_s)
            return self._run(Samples(*(np.array([column]) for column in columns)))[2]
        n_steps = max(1, math.ceil(duration_s / config.timestep_s - 1e-9))
        step_s = self.model.opt.timestep = _rounded_step(duration_s, n_steps)
        # Resistance in proportion to mass is the same decay for every velocity.
        kept = math.exp(-config.drag_1_s * step_s)
        with silent():
            for _ in range(n_steps):
                self.joints.slow(kept)
                if loads.memory is not None:
                    loads = loads.after(loads.memory.over(step_s))
                self._drive(loads, config.joint_damping)
                mujoco.mj_step(self.model, self.data)
                loads = self.joints.remember(loads)
        return self._memory if loads.memory is None else loads.memory.over(math.inf)

    def _run(self, samples: Samples, places: bool = False) -> tuple[Array, Array, TermMemory]:
        """Return coordinates (t, n, a), positions of base, joints, tip (t, n + 2, 3) or (0, …), and the final memory.

        The caller checks `unstable`.
        """
        assert self.addresses is not None
        joints, config = self.joints, self._config
        views, t = joints.views(), len(samples.duration)
        coordinates, seen = np.empty((t, len(views[0]))), np.empty((t if places else 0, *views[-1].shape))
        before, states = joints.q, self._memory.states.copy()
        durations, number = np.unique(samples.duration, return_inverse=True)
        parts = np.maximum(np.ceil(durations / config.timestep_s - 1e-9), durations > 0.0).astype(np.int64)
        each = [_rounded_step(d, n) for d, n in zip(durations.tolist(), parts.tolist(), strict=True)]
        counts, steps = parts[number], np.array(each)[number]
        ends = [0, *(np.flatnonzero(np.diff(steps)) + 1).tolist(), len(steps)]
        compiled = (self.addresses, joints.laws, joints.terms, joints.layout, views)
        with silent():
            for first, last in pairwise(ends):  # stretches of equal steps
                here, step_s = slice(first, last), float(steps[first])
                self.model.opt.timestep = step_s or config.timestep_s
                inputs = tuple(np.ascontiguousarray(column[here]) for column in samples[:4])
                options = (step_s, config.joint_damping, math.exp(-config.drag_1_s * step_s))
                record = (coordinates[here], seen[here] if places else seen)
                move(*compiled, inputs, counts[here], options, (before, states.reshape(-1)), record)
        q = joints.coordinates(coordinates.reshape(t, -1, joints.width) if joints.ball else coordinates)
        return q, seen, TermMemory(before, states, temperature_c=float(samples.temperature[-1]))

    def _complain(self, where: str) -> None:
        """Issue a RuntimeWarning if the motion has become unbounded since the last call."""
        bad = unstable(self.data)
        if bad is not None:
            warnings.warn(f"mujoco: the motion is unstable ({bad}) {where}", RuntimeWarning, stacklevel=3)


def _rounded_step(duration_s: float, count: int) -> float:
    """Return the step that divides a duration, rounded so that equal durations get equal steps."""
    return float(f"{duration_s / count:.12g}") if count else 0.0


@cache
def _functions() -> tuple[int, int] | None:
    """Return addresses of mj_step and mj_kinematics in the loaded library; None if it is not found."""
    folder = Path(mujoco.__file__).parent
    for path in sorted([*folder.glob("libmujoco*"), *folder.glob("mujoco.dll")]):
        try:
            library = ctypes.CDLL(str(path))
            step, kinematics = (
                ctypes.cast(f, ctypes.c_void_p).value for f in (library.mj_step, library.mj_kinematics)
            )
        except (OSError, AttributeError):
            continue
        if step and kinematics:
            return step, kinematics
    return None
