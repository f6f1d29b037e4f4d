"""A chain's motion in MuJoCo in compiled calls, where its laws, terms and loads allow it."""

from __future__ import annotations

import ctypes
import math
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from pliant.mechanics.statics import Loads
from pliant.mechanics.terms import Memory
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import REFERENCE_TEMPERATURE_C, History
from pliant_plugins.physics.compiled.laws import CompiledLaws
from pliant_plugins.physics.compiled.motion import move
from pliant_plugins.physics.mujoco.joints import ChainJoints


@dataclass(frozen=True, eq=False)
class Samples:
    """Inputs of t samples: actuators (t, k), end moment (t,), tip force (t, 3), temperature (t,), duration (t,).

    The inputs of a sample hold during the time that leads to it; a first duration of 0 only places its inputs.
    """

    values: Array
    moment: Array
    tip_force: Array
    temperature: Array
    duration: Array

    @staticmethod
    def held(values: Array, loads: Loads, duration_s: float) -> Samples:
        """One sample: these loads for this duration."""
        temperature = REFERENCE_TEMPERATURE_C if loads.memory is None else loads.memory.temperature_c
        return Samples(
            values[None],
            np.array([loads.moment_n_m]),
            loads.tip_force_n[None],
            np.array([temperature]),
            np.array([duration_s]),
        )

    @staticmethod
    def of(chain: ChainModel, history: History) -> Samples:
        """Those of a history with times, as they are: inputs hold from the sample before."""
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

        return Samples(
            mixed(self.values),
            mixed(self.moment),
            mixed(self.tip_force),
            mixed(self.temperature),
            self.duration[number] / parts[number],
        )

    def after_first(self) -> Samples:
        """All samples but the first, where the chain already is."""
        columns = (self.values, self.moment, self.tip_force, self.temperature, self.duration)
        return Samples(*(column[1:] for column in columns))


class CompiledMotion:
    """Runs a chain through samples in compiled calls, with its laws, terms and MuJoCo's own functions."""

    def __init__(
        self, addresses: tuple[int, ...], laws: CompiledLaws, terms: Any, joints: ChainJoints
    ) -> None:
        self._addresses, self._laws, self._terms = addresses, laws.arrays, terms
        self._joints = joints

    @staticmethod
    def of(model: mujoco.MjModel, data: mujoco.MjData, joints: ChainJoints) -> CompiledMotion | None:
        """None where MuJoCo's functions have no address, or a law or term is not compiled."""
        functions, laws, terms = _functions(), joints.compiled, joints.terms
        if functions is None or laws is None or terms is None or not hasattr(model, "_address"):
            return None
        return CompiledMotion((*functions, model._address, data._address), laws, terms, joints)

    def run(
        self,
        samples: Samples,
        memory: Memory,
        timestep_s: float,
        damping: float,
        drag: float,
        places: bool = False,
    ) -> tuple[Array, Array, Memory]:
        """Coordinates (t, n, a), places of base, joints and tip (t, n + 2, 3) or (0, …), the memory at the end."""
        joints, model = self._joints, self._joints.model
        views = joints.views()
        t = len(samples.duration)
        coordinates, seen = np.empty((t, len(views[0]))), np.empty((t if places else 0, *views[-1].shape))
        before, states = joints.q, memory.states.copy()
        durations, number = np.unique(samples.duration, return_inverse=True)
        parts = np.maximum(np.ceil(durations / timestep_s - 1e-9), durations > 0.0).astype(np.int64)
        each = [step_of(d, n) for d, n in zip(durations.tolist(), parts.tolist(), strict=True)]
        counts, steps = parts[number], np.array(each)[number]
        for first, last in pairwise(_changes(steps)):
            here = slice(first, last)
            step_s = float(steps[first])
            model.opt.timestep = step_s or timestep_s
            move(
                self._addresses,
                self._laws,
                self._terms,
                joints.layout,
                views,
                tuple(
                    np.ascontiguousarray(column[here])
                    for column in (samples.values, samples.moment, samples.tip_force, samples.temperature)
                ),
                counts[here],
                (step_s, damping, math.exp(-drag * step_s)),
                (before, states),
                (coordinates[here], seen[here] if places else seen),
            )
        q = joints.coordinates(coordinates.reshape(t, -1, 4) if joints.ball else coordinates)
        return q, seen, Memory(before, states, temperature_c=float(samples.temperature[-1]))


def step_of(duration_s: float, count: int) -> float:
    """The step that divides a duration, without the rounding of clocks: equal durations get equal steps."""
    return float(f"{duration_s / count:.12g}") if count else 0.0


def _changes(steps: Array) -> list[int]:
    """Where stretches of equal steps begin, and the end."""
    return [0, *(np.flatnonzero(np.diff(steps)) + 1).tolist(), len(steps)]


@cache
def _functions() -> tuple[int, int] | None:
    """Addresses of mj_step and mj_kinematics in the library that the package has loaded; None if it is not found."""
    folder = Path(mujoco.__file__).parent
    for path in sorted([*folder.glob("libmujoco*"), *folder.glob("mujoco.dll")]):
        try:
            library = ctypes.CDLL(str(path))
            found = [ctypes.cast(f, ctypes.c_void_p).value for f in (library.mj_step, library.mj_kinematics)]
        except (OSError, AttributeError):
            continue
        step, kinematics = found
        if step and kinematics:
            return step, kinematics
    return None
