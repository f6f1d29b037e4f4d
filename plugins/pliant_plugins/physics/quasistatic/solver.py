"""What solves a chain, and the way in Python: any law, law terms with memory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from pliant.mechanics.statics import Balance, ChainStatics, Loads
from pliant.records.design import Array
from pliant_plugins.physics.quasistatic.newton import NewtonOptions, Solution, minimise


class Solver(Protocol):
    """The equilibrium of one chain under any loads."""

    def solve(self, q: Array, loads: Loads) -> Solution:
        """The stable equilibrium reached from coordinates q (n, a)."""


@dataclass(frozen=True, eq=False)
class PlainSolver:
    """`ChainStatics` and `minimise`."""

    statics: ChainStatics
    options: NewtonOptions

    def solve(self, q: Array, loads: Loads) -> Solution:
        """See `Solver`."""
        return minimise(_Problem(self.statics, loads), q, self.options)


@dataclass(frozen=True, eq=False)
class _Problem:
    statics: ChainStatics
    loads: Loads

    def balance(self, q: Array) -> Balance:
        return self.statics.balance(q, self.loads)

    def potential(self, q: Array) -> float:
        return self.statics.potential(q, self.loads)
