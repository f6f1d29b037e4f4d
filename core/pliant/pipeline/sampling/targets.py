"""What is to be solved, what was, and what failed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from pliant.records.design import Array
from pliant.records.fem import Branch, FemState, Role

MAIN = "main"  # the piece that moves about the main axis alone, or the only piece
FULL = "full"  # the piece that moves about all axes


@dataclass(frozen=True)
class Target:
    """A state to solve.

    Attributes:
        branch: "free" has neither `held` nor `effort`.
        actuation: Pa or N.
        held: u by axis (rad or m); axes that are not named are free.
        effort: external effort on one axis by its name (N·m or N), instead of `held`.
        role: "check" is never fitted.
        explored: the axis whose law the state explores, "" for a state of several.
        piece: which of the family's problems it is solved on.
    """

    branch: Branch
    actuation: float
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
    """A solved target."""

    target: Target
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
