"""Which states of a module are solved, in which order, and how an interrupted sampling goes on.

Free branch first (it tells the largest free angle), then angles from `angle_low` to `angle_high` times that
angle at every pressure, then check states that no fit will see. Levels are Chebyshev–Lobatto points, which
serve polynomials best (Trefethen, Approximation Theory and Approximation Practice, ch. 2).
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pliant.errors import NotReachedError
from pliant.interfaces.fem import FemConfig, ModuleSolver, StateNotConvergedError
from pliant.pipeline.progress import Progress
from pliant.records.design import Array
from pliant.records.fem import Branch, FemState, Role
from pliant.store.store import (
    CorruptedError,
    digests,
    read_checked,
    write_atomically,
    write_value,
    writing_in,
)

STRAIGHT_RAD = 1e-9  # a largest free angle below this is rounding


@dataclass(frozen=True)
class Target:
    """A state to solve; `angle_rad` is None on the free branch."""

    branch: Branch
    actuation: float
    angle_rad: float | None
    role: Role


@dataclass(frozen=True)
class Sampled:
    """A solved target."""

    target: Target
    state: FemState


@dataclass(frozen=True)
class Sampling:
    """All solved states and the targets that failed, with their cause."""

    solved: tuple[Sampled, ...]
    failed: tuple[dict[str, object], ...]


def levels(low: float, high: float, count: int) -> Array:
    """`count` Chebyshev–Lobatto points on [low, high], ascending, ends included."""
    points = -np.cos(np.pi * np.arange(count) / (count - 1))
    return low + (high - low) * (points + 1) / 2


def free_targets(config: FemConfig, limit: float) -> list[Target]:
    """The free branch: every pressure level above zero, ascending."""
    pressures = levels(0.0, limit, config.pressures)[1:]
    return [Target("free", float(p), None, "fit") for p in pressures]


def constrained_targets(config: FemConfig, limit: float, free: Sequence[Sampled]) -> list[Target]:
    """The grid of angles at every pressure, nearest to the free branch first, then the check states.

    Raises `NotReachedError` for a module that stays straight: the grid is scaled by its free angle.
    """
    pressures = np.array([s.state.actuation for s in free])
    angles = np.array([s.state.angle_rad for s in free])
    largest = float(np.abs(angles).max())
    if largest < STRAIGHT_RAD:
        raise NotReachedError("the module does not bend under pressure, so that no angles can be chosen")
    grid = levels(config.angle_low * largest, config.angle_high * largest, config.angles)
    targets = [
        Target("constrained", float(p), float(u), "fit")
        for p in levels(0.0, limit, config.pressures)
        for u in sorted(grid, key=lambda u, p=p: abs(u - np.interp(p, pressures, angles)))  # type: ignore[misc]
    ]
    random = np.random.default_rng(config.seed)
    count = config.check_states
    strata = np.stack([random.permutation(count), random.permutation(count)], axis=1)
    points = (strata + random.random((count, 2))) / max(count, 1)
    low, high = grid[0], grid[-1]
    targets += [
        Target("constrained", float(a * limit), float(low + b * (high - low)), "check") for a, b in points
    ]
    return targets


def sample(
    solver: ModuleSolver, config: FemConfig, limit: float, partial: Path, progress: Progress
) -> Sampling:
    """Solve all targets up to the actuation `limit`, each from the nearest solved state.

    Finished states are kept in `partial`.

    Raises `NotReachedError` when the free branch cannot be followed or does not bend, since the grid is scaled
    by it.
    """
    saved = _Saved(partial, progress.note)
    total = config.pressures + config.pressures * config.angles + config.check_states
    bar = progress.begin("FEM states", total, done=len(saved))
    try:
        rest = saved.solve("rest", solver.rest)
        solved = [Sampled(Target("free", 0.0, None, "fit"), rest)]
        bar.advance(0 if saved.reused else 1)
        failed: list[dict[str, object]] = []
        for make_targets in (
            lambda: free_targets(config, limit),
            lambda: constrained_targets(config, limit, solved),
        ):
            for target in make_targets():
                _solve_one(solver, target, solved, failed, saved)
                bar.advance(0 if saved.reused else 1)
                if failed and failed[0]["branch"] == "free":
                    raise NotReachedError(f"the free branch stopped: {failed[0]['cause']}")
    finally:
        bar.finish()
    return Sampling(tuple(solved), tuple(failed))


def _solve_one(
    solver: ModuleSolver,
    target: Target,
    solved: list[Sampled],
    failed: list[dict[str, object]],
    saved: _Saved,
) -> None:
    start = _nearest(target, solved)

    def solve() -> FemState:
        if target.angle_rad is None:
            return solver.free(target.actuation, start)
        return solver.constrained(target.actuation, target.angle_rad, start)

    angle = "free" if target.angle_rad is None else repr(target.angle_rad)
    name = f"{target.role} {target.actuation!r} {angle}"
    try:
        solved.append(Sampled(target, saved.solve(name, solve)))
    except StateNotConvergedError as error:
        failed.append(
            {
                "branch": target.branch,
                "actuation": target.actuation,
                "angle_rad": target.angle_rad,
                "cause": str(error),
            }
        )


def _nearest(target: Target, solved: Sequence[Sampled]) -> FemState:
    """The solved state closest in actuation and angle, both scaled by what has been covered."""
    states = [s.state for s in solved]
    if target.angle_rad is None:
        return max(states, key=lambda s: s.actuation)
    p = np.array([s.actuation for s in states])
    u = np.array([s.angle_rad for s in states])
    distance = ((p - target.actuation) / np.ptp(p)) ** 2 + ((u - target.angle_rad) / np.ptp(u)) ** 2
    return states[int(np.argmin(distance))]


class _Saved:
    """Finished targets in a folder, so that an interruption loses at most one.

    A solved state has a sub-folder; `states.json` holds, by the target's name, the digests of its files, or
    the cause where the target failed. What is damaged is said and solved anew.
    """

    def __init__(self, folder: Path, note: Callable[[str], None]) -> None:
        self.folder = folder
        self.index = folder / "states.json"
        self.states: dict[str, FemState] = {}
        self.entries = self._sound(self._read_index(note), note)
        self.reused = False

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

    def _read_index(self, note: Callable[[str], None]) -> dict[str, Any]:
        try:
            entries = json.loads(self.index.read_text())
        except FileNotFoundError:
            return {}
        except ValueError:
            entries = None
        if not isinstance(entries, dict):
            note(f"{self.index} is damaged; solving its states anew.")
            return {}
        return entries

    def _sound(self, entries: Mapping[str, Any], note: Callable[[str], None]) -> dict[str, dict[str, str]]:
        """The entries whose files are as they were written; their states are kept in `states`."""
        sound = {}
        for name, entry in entries.items():
            try:
                if "failed" not in entry:
                    self.states[name] = read_checked(self._place(name), entry)
                sound[name] = entry
            except (CorruptedError, TypeError) as error:
                note(f"the finished state '{name}' is damaged ({error}); solving it anew.")
        return sound
