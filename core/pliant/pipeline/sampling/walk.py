"""Solving targets one after another, each from the nearest solved state of the same piece."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from pliant.execution.progress import ProgressBar
from pliant.interfaces.fem import ModuleSolver, StateNotConvergedError
from pliant.pipeline.sampling.saved import Saved
from pliant.pipeline.sampling.targets import FULL, MAIN, Sampled, Target
from pliant.records.design import Array
from pliant.records.fem import PASSED, SELF_CONTACT, Closing, FemState

ROUNDING = 1e-9


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
    stops: list[Target] = field(default_factory=list)
    passing: bool = False  # what overlaps is let pass

    def of(self, piece: str) -> list[Sampled]:
        """What was solved on one piece."""
        return [one for one in self.solved if one.target.piece == piece]

    def rest(self, piece: str = MAIN, explored: str = "") -> FemState:
        """The undeformed state of a piece."""
        target = Target("free", 0.0, explored=explored, piece=piece)
        name = "rest" if piece == MAIN else f"{piece} rest"
        state = self.saved.solve(name, lambda: self._seen(piece, self.pieces[piece].solver.rest()))
        self._count()
        self.solved.append(Sampled(target, state))
        return state

    def reach(self, target: Target) -> FemState | None:
        """The target's state, or None where it failed, which is recorded."""
        start = self._nearest(target)
        try:
            state = self.saved.solve(
                target.name, lambda: self._seen(target.piece, self._solve(target, start))
            )
        except StateNotConvergedError as error:
            self.failed.append(self._failure(target, str(error)))
            self.stops.append(target)
            self._count()
            return None
        self._count()
        self.solved.append(Sampled(target, state))
        return state

    @property
    def walked(self) -> int:
        """How many targets were dealt with."""
        return len(self.solved) + len(self.stops)

    def knows(self, target: Target) -> bool:
        """Whether the target was dealt with."""
        return any(t.name == target.name for t in (*(one.target for one in self.solved), *self.stops))

    def _seen(self, piece: str, state: FemState) -> FemState:
        """The state with its overlap let pass, unless rigid parts meet."""
        passes = self.passing and state.status == SELF_CONTACT and self.pieces[piece].can_take(state)
        return replace(state, status=PASSED) if passes else state

    def _count(self) -> None:
        self.bar.advance(0 if self.saved.reused else 1)

    def _solve(self, target: Target, start: FemState) -> FemState:
        piece = self.pieces[target.piece]
        if target.held:
            alone = target.held.get(piece.main_axis) if len(piece.axes) == 1 else None
            return piece.solver.constrained(target.actuation, target.held if alone is None else alone, start)
        if target.effort:
            return piece.solver.loaded(target.actuation, target.effort, start, piece.axes)
        return piece.solver.free(target.actuation, start)

    def _nearest(self, target: Target) -> FemState:
        """The solved state closest in actuation and in what the target holds, both by what has been covered."""
        piece = self.pieces[target.piece]
        states = [one.state for one in self.of(target.piece)]
        if not target.held and not target.effort:
            below = [s for s in states if s.actuation <= target.actuation] or states
            return max(below, key=lambda s: (s.actuation, s.branch == "free"))
        p = np.array([s.actuation for s in states])
        distance = ((p - target.actuation) / _width(p)) ** 2
        if target.effort:
            names, wanted = list(target.effort), list(target.effort.values())
            values = np.array([s.tau for s in states])
        else:
            names, wanted = list(target.held), list(target.held.values())
            values = np.array([s.deformation for s in states])
        for name, value in zip(names, wanted, strict=True):
            column = values[:, piece.axes.index(name)]
            distance = distance + ((column - value) / _width(np.append(column, value))) ** 2
        return states[int(np.argmin(distance))]

    def _failure(self, target: Target, cause: str) -> dict[str, object]:
        piece = self.pieces[target.piece]
        record: dict[str, object] = {
            "branch": target.branch,
            "actuation": target.actuation,
            "angle_rad": target.held.get(piece.main_axis),
            "cause": cause,
        }
        if target.piece == FULL:
            record["held"] = dict(target.held)
        if target.effort:
            record["effort"] = dict(target.effort)
        return record


def _width(values: Array) -> float:
    """Largest minus smallest, 1 where all are equal."""
    return float(np.ptp(values)) or 1.0
