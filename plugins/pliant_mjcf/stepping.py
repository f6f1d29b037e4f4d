"""Steps of several runs of one compiled model at once, by `mujoco.batch`, in pieces that fit into memory.

Without forces of effects MuJoCo steps whole pieces on several threads. With them all runs are stepped in lock step, and
the forces and changes of controls are computed for all runs at once before each step.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError
from numpy.typing import NDArray

from pliant.records.design import Array
from pliant_mjcf.changes import DriveChange, StateForce

TIME = mujoco.mjtState.mjSTATE_TIME
NEVER = np.iinfo(np.int64).max
# Coordinates beyond this (rad or m) have diverged; MuJoCo itself gives up at 1e10.
BEYOND = 1e6
PIECE_NUMBERS = 4_000_000  # of the arrays of one piece
WARNINGS = 1  # column of the number of warnings in `Batch.warning`


@dataclass(frozen=True, eq=False)
class Course:
    """One run to step.

    Attributes:
        start: its state, for mjSTATE_INTEGRATION.
        steps: the number of steps.
        time_s: (t,) from zero.
        control: (t, nu) ctrl at these times, straight lines between them.
    """

    start: Array
    steps: int
    time_s: Array
    control: Array

    def control_at(self, begin: int, end: int, step_s: float) -> Array:
        """Return (end − begin, nu) ctrl at the steps."""
        at = step_s * np.arange(begin, end)
        columns = [np.interp(at, self.time_s, column) for column in self.control.T]
        return np.stack(columns, axis=1) if columns else np.zeros((len(at), 0))


@dataclass(frozen=True, eq=False)
class Piece:
    """Consecutive steps of some runs.

    Attributes:
        begin: the first step.
        runs: (n,) indices of the runs.
        records: (n, steps, …) by field of `mujoco.MjData`; sensors are those at the beginning of a step.
    """

    begin: int
    runs: NDArray[np.intp]
    records: Mapping[str, Array]


@dataclass(eq=False)
class March:
    """Runs on their way; `failed_at` is (r,) the first step of each run that has diverged, else `NEVER`."""

    model: Any
    courses: Sequence[Course]
    forces: Sequence[StateForce] = ()
    controls: Sequence[DriveChange] = ()
    threads: int = 1
    lock_step: bool = False
    failed_at: NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        self.lock_step = self.lock_step or bool(self.forces or self.controls)
        self.failed_at = np.full(len(self.courses), NEVER, np.int64)
        # threads cost more than they give for single steps
        threads = 1 if self.lock_step else max(min(self.threads, len(self.courses)), 1)
        self._batch = Batch(self.model, len(self.courses), nthread=threads, persistent=True)
        self._batch.state[:] = [course.start for course in self.courses]
        self._remembered: list[Any] = []
        self._drives: list[Any] = []
        # live arrays of all runs, a row each
        self._q, self._v = self._batch.bind("qpos"), self._batch.bind("qvel")
        self._ctrl, self._applied = self._batch.bind("ctrl"), self._batch.bind("qfrc_applied")
        self._warned = self._batch.warning[:, :, WARNINGS]
        self._before, self._known_warnings, self._doubtful = self._warnings(), 0, False

    def pieces(self, fields: Sequence[str]) -> Iterator[Piece]:
        """Yield the steps of all runs piece by piece; runs that end or diverge are left out of later ones."""
        data, steps = mujoco.MjData(self.model), np.array([course.steps for course in self.courses])
        numbers = sum(np.size(getattr(data, name)) for name in fields) + self.model.nu + self.model.nq + 1
        most = max(PIECE_NUMBERS // (numbers * len(self.courses)), 1)
        self._remembered = [force.start(self.model, self._q, self._v) for force in self.forces]
        self._drives = [change.start(self.model) for change in self.controls]
        begin = 0
        while len(runs := np.flatnonzero((steps > begin) & (self.failed_at == NEVER))):
            end = min(begin + most, int(steps[runs].min()))
            control = np.stack(
                [self.courses[k].control_at(begin, end, self.model.opt.timestep) for k in runs.tolist()]
            )
            move = self._in_lock_step if self.lock_step else self._rolled
            yield Piece(begin, runs, move(begin, runs, control, fields))
            begin = end

    def _rolled(
        self, begin: int, runs: NDArray[np.intp], control: Array, fields: Sequence[str]
    ) -> Mapping[str, Array]:
        """Return the records of a piece; MuJoCo repeats the last record of a run from its first warning on."""
        n, steps = control.shape[:2]
        warned = self._warnings()
        record = (*dict.fromkeys([*fields, "qpos"]), TIME)
        try:
            found = dict(self._batch.rollout(steps, control, record=record, ids=runs))
        except SimulationError as error:  # such as an arena that is full
            self.failed_at[np.asarray(error.ids, int)] = begin
            sizes = {name: np.shape(getattr(mujoco.MjData(self.model), name)) for name in fields}
            return {name: np.full((n, steps, *size), np.nan) for name, size in sizes.items()}
        times = self.model.opt.timestep * np.arange(begin + 1, begin + steps + 1)
        late = np.abs(found.pop(TIME)[:, :, 0] - times) > 0.5 * self.model.opt.timestep
        for i, run in enumerate(runs):
            if self._warnings()[run] > warned[run]:
                # after a reset by MuJoCo, the time of the first step is right
                k = int(np.argmax(late[i])) if late[i].any() else steps
                self.failed_at[run] = begin if begin + k == 1 else begin + k
        self._note_far(begin, runs, found["qpos"])
        return {name: found[name] for name in fields}

    def _in_lock_step(
        self, begin: int, runs: NDArray[np.intp], control: Array, fields: Sequence[str]
    ) -> Mapping[str, Array]:
        """Return the records of a piece, with the forces and changes of controls before each step."""
        n, steps = control.shape[:2]
        live = {name: self._batch.bind(name) for name in fields}
        found = {name: np.full((n, steps, *values.shape[1:]), np.nan) for name, values in live.items()}
        moving, places = runs, np.arange(n)
        for k in range(steps):
            every = len(moving) == len(self.courses)  # indices cost as much as a step
            self._step(moving, None if every else moving, control[places, k], begin + k)
            for name, values in live.items():
                if every:
                    found[name][:, k] = values
                else:
                    found[name][places, k] = values[moving]
            if self._is_sound():
                continue
            self._note_far(begin + k, moving, self._q[moving, None])
            stopped = np.asarray(self.failed_at[moving] != NEVER)
            for run in moving[stopped].tolist():
                self._batch.state[run] = self.courses[run].start  # finite, for the forces of the others
            places = places[~stopped]
            moving = runs[places]
            if not len(moving):
                break
        return found

    def _step(
        self, moving: NDArray[np.intp], ids: NDArray[np.intp] | None, control: Array, step: int
    ) -> None:
        """Step the moving runs once, and note those that warn."""
        step_s = float(self.model.opt.timestep)
        self._ctrl[moving if ids is not None else slice(None)] = control
        if self.controls:
            self._ctrl[:] = self._changed_controls(step_s)
        if self.forces:
            self._applied[:] = self._force(step_s)
        try:
            self._batch.step(ids)
        except SimulationError as error:
            self.failed_at[np.asarray(error.ids, int)] = step
            self._doubtful = True
        if int(self._warned.sum()) != self._known_warnings:
            now = self._warnings()
            self.failed_at[(now > self._before) & (self.failed_at == NEVER)] = step
            self._before, self._known_warnings = now, int(now.sum())
            self._doubtful = True

    def _is_sound(self) -> bool:
        """Return whether no run has diverged in the last step."""
        doubtful, self._doubtful = self._doubtful, False
        return not doubtful and float(np.abs(self._q).max(initial=0.0)) < BEYOND

    def _force(self, step_s: float) -> Array:
        """Return (r, nv) the sum of the forces, and keep what they remember."""
        total = np.zeros(self._v.shape)
        for k, force in enumerate(self.forces):
            added, self._remembered[k] = force.advance(
                self.model, self._remembered[k], self._q, self._v, step_s
            )
            total += added
        # a force that is not a number stops its own run only
        return total if np.isfinite(total).all() else np.nan_to_num(total, nan=1e300)

    def _changed_controls(self, step_s: float) -> Array:
        """Return (r, nu) the controls with the changes of effects, and keep what they remember."""
        changed = self._ctrl.copy()
        for k, change in enumerate(self.controls):
            changed, self._drives[k] = change.advance(
                self.model, self._drives[k], self._q, self._v, changed, step_s
            )
        return changed

    def _warnings(self) -> NDArray[np.int64]:
        """Return (r,) the number of warnings of each run so far."""
        return np.asarray(self._warned.sum(axis=1))

    def _note_far(self, begin: int, runs: NDArray[np.intp], positions: Array) -> None:
        """Note runs whose (n, steps, nq) positions leave all bounds; the readings of the next step are wrong."""
        far = np.asarray(~(np.abs(positions) < BEYOND).all(axis=2))
        for i in np.flatnonzero(far.any(axis=1)):
            self.failed_at[runs[i]] = min(self.failed_at[runs[i]], begin + int(np.argmax(far[i])) + 1)
