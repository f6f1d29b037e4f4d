"""What is to be solved, what was, and what failed: targets one after another, each from the nearest solved state."""

from __future__ import annotations

import hashlib
import json
import math
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
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

MAIN = "main"  # the piece that moves about the main axis alone, or the only piece
FULL = "full"  # the piece that moves about all axes
ROUNDING = 1e-9


@dataclass(frozen=True)
class StateTarget:
    """A state to solve.

    Attributes:
        branch: "free" has neither `held` nor `effort`.
        actuation: Pa or N, a tuple of several.
        held: u by axis (rad or m); axes that are not named are free.
        effort: external effort on one axis by its name (N·m or N), instead of `held`.
        role: "check" is never fitted.
        explored: the axis whose law the state explores, "" for a state of several.
        piece: which of the family's problems it is solved on.
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
        """The same text for the same target: what finished states are found by."""
        held = " ".join(f"{axis}={u!r}" for axis, u in self.held.items())
        effort = " ".join(f"m_{axis}={m!r}" for axis, m in self.effort.items())
        return " ".join((self.piece, self.role, repr(self.actuation), held or effort or "free"))


@dataclass(frozen=True)
class Sampled:
    """A target of the sampling with the state that FEM found for it."""

    target: StateTarget
    state: FemState


@dataclass(frozen=True)
class Sampling:
    """All solved states, the targets that failed with their cause, and how the states were chosen.

    Attributes:
        solved: in the order of solution.
        failed: one record for each target that did not converge.
        mirrored: axes about which the module proved symmetric, so that a state at −u is one at u.
        summary: JSON values for the report.
    """

    solved: tuple[Sampled, ...]
    failed: tuple[dict[str, object], ...]
    mirrored: tuple[str, ...] = ()
    summary: Mapping[str, object] = field(default_factory=dict)


def levels(low: float, high: float, count: int) -> Array:
    """`count` Chebyshev–Lobatto points on [low, high], ascending, ends included.

    They serve polynomials best (Trefethen, Approximation Theory and Approximation Practice, ch. 2).
    """
    points = -np.cos(np.pi * np.arange(count) / (count - 1))
    return low + (high - low) * (points + 1) / 2


class Saved:
    """Finished targets in a folder, so that an interruption loses at most one.

    A solved state has a sub-folder; `states.json` holds, by the target's name, the digests of its files, or
    the cause where the target failed. What is damaged is said and solved anew.
    """

    def __init__(self, folder: Path, note: Callable[[str], None]) -> None:
        self.folder, self.index = folder, folder / "states.json"
        self.states: dict[str, FemState] = {}
        self.entries: dict[str, dict[str, str]] = {}
        self.reused = False
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

    def solve(self, name: str, compute: Callable[[], FemState]) -> FemState:
        """The saved state of this name, or a computed one, saved; a saved failure is raised again."""
        self.reused = name in self.entries
        if name in self.states:
            return self.states[name]
        if self.reused:
            raise StateNotConvergedError(self.entries[name]["failed"])
        try:
            state = compute()
        except StateNotConvergedError as error:
            self._remember(name, {"failed": str(error)})
            raise
        place = self._place(name)
        with writing_in(self.folder):
            shutil.rmtree(place, ignore_errors=True)
            place.mkdir()
            write_value(place, state)
            self._remember(name, digests(place))
        return state

    def _place(self, name: str) -> Path:
        return self.folder / f"state-{hashlib.sha256(name.encode()).hexdigest()[:16]}"

    def _remember(self, name: str, entry: dict[str, str]) -> None:
        self.entries[name] = entry
        with writing_in(self.folder):
            write_atomically(self.index, json.dumps(self.entries))


@dataclass(frozen=True)
class Piece:
    """One of a module's problems, the axes that it moves about, and the bending that it can take."""

    name: str
    solver: ModuleSolver
    axes: tuple[str, ...]
    main_axis: str
    contact_range: tuple[float, float] = (-math.inf, math.inf)
    closing: Closing | None = None

    def can_take(self, state: FemState) -> bool:
        """Whether the state lies where rigid parts stay apart."""
        low, high = self.contact_range
        u = dict(zip(self.axes, state.deformation.tolist(), strict=True))
        closed = self.closing is not None and not (
            self.closing.shortening_m(u.get("y", 0.0), u.get("z", 0.0))
            <= self.closing.free_m * (1 + ROUNDING)
        )
        return low <= state.angle_rad <= high and not closed


@dataclass
class Walk:
    """What has been solved so far; states are kept by `saved` and counted by `bar`."""

    pieces: Mapping[str, Piece]
    saved: Saved
    bar: ProgressBar
    solved: list[Sampled] = field(default_factory=list)
    failed: list[dict[str, object]] = field(default_factory=list)
    stops: list[StateTarget] = field(default_factory=list)
    passing: bool = False  # what overlaps is let pass
    inputs: int = 1  # how many actuations there are

    def of(self, piece: str) -> list[Sampled]:
        """What was solved on one piece."""
        return [one for one in self.solved if one.target.piece == piece]

    def rest(self, piece: str = MAIN, explored: str = "") -> FemState:
        """The undeformed state of a piece."""
        actuation = 0.0 if self.inputs == 1 else (0.0,) * self.inputs
        target = StateTarget("free", actuation, explored=explored, piece=piece)
        name = "rest" if piece == MAIN else f"{piece} rest"
        return self._kept(name, target, self.pieces[piece].solver.rest)

    def reach(self, target: StateTarget) -> FemState | None:
        """The target's state, or None where it failed, which is recorded."""
        start = self._nearest(target)
        try:
            return self._kept(target.name, target, lambda: self._solve(target, start))
        except StateNotConvergedError as error:
            angle = target.held.get(self.pieces[target.piece].main_axis)
            failure: dict[str, object] = {"branch": target.branch, "actuation": target.actuation}
            failure |= {"angle_rad": angle, "cause": str(error)}
            if target.piece == FULL:
                failure["held"] = dict(target.held)
            if target.effort:
                failure["effort"] = dict(target.effort)
            self.failed.append(failure)
            self.stops.append(target)
            self.bar.advance(0 if self.saved.reused else 1)
            return None

    @property
    def walked(self) -> int:
        """How many targets were dealt with."""
        return len(self.solved) + len(self.stops)

    def reach_new(self, targets: list[StateTarget]) -> None:
        """Reach those of the targets that were not dealt with."""
        for target in targets:
            known = (*(one.target for one in self.solved), *self.stops)
            if all(other.name != target.name for other in known):
                self.reach(target)

    def _kept(self, name: str, target: StateTarget, solve: Callable[[], FemState]) -> FemState:
        """The state, its overlap let pass unless rigid parts meet; solved or found among the saved ones."""

        def seen() -> FemState:
            state = solve()
            passes = self.passing and state.status == SELF_CONTACT
            passes = passes and self.pieces[target.piece].can_take(state)
            return replace(state, status=PASSED) if passes else state

        state = self.saved.solve(name, seen)
        self.bar.advance(0 if self.saved.reused else 1)
        self.solved.append(Sampled(target, state))
        self.pieces[target.piece].solver.learn(state)
        return state

    def _solve(self, target: StateTarget, start: FemState) -> FemState:
        piece = self.pieces[target.piece]
        if target.held:
            alone = target.held.get(piece.main_axis) if len(piece.axes) == 1 else None
            return piece.solver.constrained(target.actuation, target.held if alone is None else alone, start)
        if target.effort:
            return piece.solver.loaded(target.actuation, target.effort, start, piece.axes)
        return piece.solver.free(target.actuation, start)

    def _nearest(self, target: StateTarget) -> FemState:
        """The solved state closest in actuation and in what the target holds, both by what has been covered."""
        states = [one.state for one in self.of(target.piece)]
        wanted = target.effort or target.held
        if self.inputs > 1:
            return self._nearest_of_several(target, states)
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

    def _nearest_of_several(self, target: StateTarget, states: list[FemState]) -> FemState:
        """The same under several actuations; a free target's own place is not known, and actuations alone count."""
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
