"""Sequential solution of target states, each from the nearest solved state, with a record of solved and failed ones."""

from __future__ import annotations

import hashlib
import json
import math
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np

from pliant.execution.progress import ProgressBar
from pliant.interfaces.fem import ModuleSolver, StateNotConvergedError
from pliant.records.actuation import Levels
from pliant.records.design import Array
from pliant.records.fem import PASSED, SELF_CONTACT, Branch, Closing, FemState, Role
from pliant.store.store import (
    CorruptedError,
    digests,
    read_checked,
    write_atomically,
    write_value,
    writing_in,
)

MAIN = "main"  # the piece that moves only about the main axis, or the only piece
FULL = "full"  # the piece that moves about all axes
ROUNDING = 1e-9


@dataclass(frozen=True)
class StateTarget:
    """A state to solve.

    Attributes:
        branch: "free" has neither `held` nor `effort`.
        actuation: Pa or N, a tuple for several.
        held: prescribed u by axis (rad or m); axes that are not named are free.
        effort: external effort on one axis by its name (N·m or N), instead of `held`.
        role: "check" is never fitted.
        explored: the axis whose law the state explores, "" for a state of several axes.
        piece: the family's problem on which it is solved.
    """

    branch: Branch
    actuation: Levels
    held: Mapping[str, float] = field(default_factory=dict)
    effort: Mapping[str, float] = field(default_factory=dict)
    role: Role = "fit"
    explored: str = ""
    piece: str = MAIN

    @property
    def name(self) -> str:
        """The identifying text of the target, by which finished states are found."""
        held = " ".join(f"{axis}={u!r}" for axis, u in self.held.items())
        effort = " ".join(f"m_{axis}={m!r}" for axis, m in self.effort.items())
        return " ".join((self.piece, self.role, repr(self.actuation), held or effort or "free"))


@dataclass(frozen=True)
class Sampled:
    """A target of the sampling with its FEM state."""

    target: StateTarget
    state: FemState


def levels(low: float, high: float, count: int) -> Array:
    """Return `count` Chebyshev–Lobatto points on [low, high], ascending, ends included.

    They are near-optimal for polynomials (Trefethen, Approximation Theory and Approximation Practice, ch. 2).
    """
    points = -np.cos(np.pi * np.arange(count) / (count - 1))
    return low + (high - low) * (points + 1) / 2


class StateCache:
    """Finished targets in a folder, so that an interruption loses at most one.

    A solved state has a sub-folder; `states.json` lists, by the target's name, the digests of its files, or
    the cause if the target failed. Damaged states are reported and solved again.
    """

    def __init__(self, folder: Path, note: Callable[[str], None]) -> None:
        self.folder, self.index = folder, folder / "states.json"
        self.states: dict[str, FemState] = {}
        self.entries: dict[str, dict[str, str]] = {}
        try:
            entries = json.loads(self.index.read_text())
        except FileNotFoundError:
            return
        except ValueError:
            entries = None
        if not isinstance(entries, dict):
            note(f"{self.index} is damaged; solving its states anew.")
            return
        for name, entry in entries.items():
            try:
                if "failed" not in entry:
                    self.states[name] = read_checked(self._place(name), entry)
                self.entries[name] = entry
            except (CorruptedError, TypeError) as error:
                note(f"the finished state '{name}' is damaged ({error}); solving it anew.")

    def __len__(self) -> int:
        return len(self.entries)

    def __contains__(self, name: str) -> bool:
        return name in self.entries

    def get(self, name: str) -> FemState | None:
        """Return the state of this name, or None if it was not solved; raise the error of a failed one again."""
        if name in self.entries and name not in self.states:
            raise StateNotConvergedError(self.entries[name]["failed"])
        return self.states.get(name)

    def add(self, name: str, state: FemState) -> None:
        """Write a solved state."""
        place = self._place(name)
        with writing_in(self.folder):
            shutil.rmtree(place, ignore_errors=True)
            place.mkdir()
            write_value(place, state)
            self._write(name, digests(place))

    def add_failure(self, name: str, error: StateNotConvergedError) -> None:
        """Write that a target failed."""
        with writing_in(self.folder):
            self._write(name, {"failed": str(error)})

    def _place(self, name: str) -> Path:
        return self.folder / f"state-{hashlib.sha256(name.encode()).hexdigest()[:16]}"

    def _write(self, name: str, entry: dict[str, str]) -> None:
        self.entries[name] = entry
        write_atomically(self.index, json.dumps(self.entries))


@dataclass(frozen=True)
class Subproblem:
    """One of a module's problems, its axes, and its range of bending."""

    name: str
    solver: ModuleSolver
    axes: tuple[str, ...]
    main_axis: str
    contact_range: tuple[float, float] = (-math.inf, math.inf)
    closing: Closing | None = None

    def solution(self, target: StateTarget) -> Callable[[FemState], FemState]:
        """Return the solver's method for the target, a function of the solved state from which it starts."""
        if target.held:
            alone = target.held.get(self.main_axis) if len(self.axes) == 1 else None
            held = target.held if alone is None else alone
            return partial(self.solver.constrained, target.actuation, held)
        if target.effort:
            return partial(self.solver.loaded, target.actuation, target.effort, axes=self.axes)
        return partial(self.solver.free, target.actuation)

    def can_take(self, state: FemState) -> bool:
        """Return whether rigid parts do not touch in the state."""
        low, high = self.contact_range
        u = dict(zip(self.axes, state.deformation.tolist(), strict=True))
        closed = self.closing is not None and not (
            self.closing.shortening_m(u.get("y", 0.0), u.get("z", 0.0))
            <= self.closing.free_m * (1 + ROUNDING)
        )
        return low <= state.angle_rad <= high and not closed


@dataclass
class SamplingRun:
    """Solved states so far; states are kept by `saved` and counted by `bar`; `notes` are sentences for the user."""

    pieces: Mapping[str, Subproblem]
    saved: StateCache
    bar: ProgressBar
    solved: list[Sampled] = field(default_factory=list)
    failed: list[dict[str, object]] = field(default_factory=list)
    stops: list[StateTarget] = field(default_factory=list)
    passing: bool = False  # whether overlaps are allowed
    inputs: int = 1  # number of actuations
    notes: list[str] = field(default_factory=list)

    def piece_states(self, piece: str) -> list[Sampled]:
        """Return the solved states of one piece."""
        return [one for one in self.solved if one.target.piece == piece]

    def rest(self, piece: str = MAIN, explored: str = "") -> FemState:
        """Return the undeformed state of a piece."""
        actuation = 0.0 if self.inputs == 1 else (0.0,) * self.inputs
        target = StateTarget("free", actuation, explored=explored, piece=piece)
        name = "rest" if piece == MAIN else f"{piece} rest"
        state, known = self.saved.get(name), name in self.saved
        if state is None:
            state = self._passed(target, self.pieces[piece].solver.rest())
            self.saved.add(name, state)
        return self._keep(target, state, known)

    def solve(self, target: StateTarget) -> FemState | None:
        """Return the target's state, cached or solved from the nearest one, or None after recording a failure."""
        name, known = target.name, target.name in self.saved
        try:
            state = self.saved.get(name)
            if state is None:
                try:
                    solve = self.pieces[target.piece].solution(target)
                    state = self._passed(target, solve(self._nearest(target)))
                except StateNotConvergedError as error:
                    self.saved.add_failure(name, error)
                    raise
                self.saved.add(name, state)
        except StateNotConvergedError as error:
            self._fail(target, error, known)
            return None
        return self._keep(target, state, known)

    @property
    def walked(self) -> int:
        """The number of targets that were solved or failed."""
        return len(self.solved) + len(self.stops)

    def reach_new(self, targets: list[StateTarget]) -> None:
        """Solve those of the targets that were neither solved nor failed."""
        for target in targets:
            known = (*(one.target for one in self.solved), *self.stops)
            if all(other.name != target.name for other in known):
                self.solve(target)

    def _passed(self, target: StateTarget, state: FemState) -> FemState:
        """Return the state; its overlap is allowed unless rigid parts touch."""
        passes = self.passing and state.status == SELF_CONTACT
        passes = passes and self.pieces[target.piece].can_take(state)
        return replace(state, status=PASSED) if passes else state

    def _keep(self, target: StateTarget, state: FemState, known: bool) -> FemState:
        """Record a state, `known` if it was cached, and return it."""
        self.bar.advance(0 if known else 1)
        self.solved.append(Sampled(target, state))
        self.pieces[target.piece].solver.learn(state)
        return state

    def _fail(self, target: StateTarget, error: StateNotConvergedError, known: bool) -> None:
        """Record a failure, `known` if it was cached."""
        angle = target.held.get(self.pieces[target.piece].main_axis)
        failure: dict[str, object] = {"branch": target.branch, "actuation": target.actuation}
        failure |= {"angle_rad": angle, "cause": str(error)}
        if target.piece == FULL:
            failure["held"] = dict(target.held)
        if target.effort:
            failure["effort"] = dict(target.effort)
        self.failed.append(failure)
        self.stops.append(target)
        self.bar.advance(0 if known else 1)

    def _nearest(self, target: StateTarget) -> FemState:
        """Return the solved state closest in actuation and prescribed values, each scaled by the covered range."""
        states = [one.state for one in self.piece_states(target.piece)]
        wanted = target.effort or target.held
        if self.inputs > 1:
            return self._nearest_by_actuations(target, states)
        if not wanted:
            below = [s for s in states if s.actuation <= target.actuation] or states
            return max(below, key=lambda s: (s.actuation, s.branch == "free"))

        def width(values: Array) -> float:
            return float(np.ptp(values)) or 1.0

        p = np.array([s.actuation for s in states])
        distance = ((p - target.actuation) / width(p)) ** 2
        values = np.array([s.tau if target.effort else s.deformation for s in states])
        for name, value in wanted.items():
            column = values[:, self.pieces[target.piece].axes.index(name)]
            distance = distance + ((column - value) / width(np.append(column, value))) ** 2
        return states[int(np.argmin(distance))]

    def _nearest_by_actuations(self, target: StateTarget, states: list[FemState]) -> FemState:
        """Return the closest state under several actuations; for a free target only actuations are compared."""
        at = np.array([np.asarray(s.actuation, float) for s in states])
        wanted = np.asarray(target.actuation, float)
        if target.held:
            axes = self.pieces[target.piece].axes
            places = [axes.index(name) for name in target.held]
            at = np.column_stack([at, np.array([s.deformation[places] for s in states])])
            wanted = np.append(wanted, [*target.held.values()])
        width = np.ptp(np.vstack([at, wanted]), axis=0)
        apart = (at - wanted) / np.where(width > 0, width, 1.0)
        return states[int(np.argmin(np.sum(apart**2, axis=1)))]
