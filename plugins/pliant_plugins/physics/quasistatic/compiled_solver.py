"""The compiled way to the equilibrium of a chain, for one and for many that share laws and geometry."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from threading import Lock
from typing import Any, TypeVar

import numpy as np

from pliant.mechanics.efforts import actuation_values
from pliant.mechanics.statics import Loads
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant_plugins.physics.compiled.body import Body, load_arrays
from pliant_plugins.physics.compiled.equilibrium import settle
from pliant_plugins.physics.compiled.laws import CompiledLaws
from pliant_plugins.physics.quasistatic.newton import NewtonOptions, Solution

MOST_PACKS = 256
Packed = TypeVar("Packed")


class Packs:
    """The last few hundred packed laws and bodies, known by the identity of what they were made of."""

    def __init__(self) -> None:
        self._kept: dict[tuple[Any, ...], tuple[ChainModel, Any]] = {}
        self._lock = Lock()

    def laws(self, chain: ChainModel) -> CompiledLaws | None:
        """See `CompiledLaws.of`; loads, payload and pose of a chain do not matter."""
        key = ("laws", *map(id, chain.laws), id(chain.joints), chain.actuators)
        return self._keep(key, chain, CompiledLaws.of)

    def body(self, chain: ChainModel) -> tuple[Any, ...]:
        """See `Body.arrays`; loads, payload and gravity of a chain do not matter."""
        parts = (
            chain.joints,
            chain.bodies,
            chain.laws,
            chain.tip_offset_m,
            chain.base_position_m,
            chain.base_rotation,
        )
        return self._keep(("body", *map(id, parts)), chain, lambda c: Body.of(c).arrays)

    def _keep(self, key: tuple[Any, ...], chain: ChainModel, make: Callable[[ChainModel], Packed]) -> Packed:
        found = self._kept.get(key)
        if found is None:
            # The chain is kept: the identities of its parts stay their own.
            found = (chain, make(chain))
            with self._lock:
                while len(self._kept) >= MOST_PACKS:
                    self._kept.pop(next(iter(self._kept)))
                self._kept[key] = found
        packed: Packed = found[1]
        return packed


@dataclass(frozen=True, eq=False)
class CompiledSolver:
    """`pliant_plugins.physics.compiled`: chains without law terms whose laws all have a scalar form."""

    chain: ChainModel
    body: tuple[Any, ...]
    laws: tuple[Any, ...]
    boxes: Array
    options: tuple[float, int, float]

    @staticmethod
    def of(chain: ChainModel, options: NewtonOptions, packs: Packs) -> CompiledSolver | None:
        """None for a chain that it cannot solve."""
        body, laws = packs.body(chain), packs.laws(chain)
        if chain.terms or laws is None:
            return None
        numbers = (options.tolerance, options.max_iterations, options.max_step)
        solver = CompiledSolver(chain, body, laws.arrays, laws.boxes, numbers)
        if not settle.signatures:  # compile or load now, so that no equilibrium's time includes it
            solver.solve(np.zeros((chain.n_joints, len(chain.axes))), Loads.none(chain))
        return solver

    def solve(self, q: Array, loads: Loads) -> Solution:
        """See `Solver`; where Newton's way fails it follows the overdamped motion from q."""
        pressures = actuation_values(self.chain.actuators, loads.actuation)
        arrays = load_arrays(loads, pressures, self.chain.payload_kg)
        q, markers = q.copy(), np.empty((len(q) + 2, 3))
        converged, stable, size, iterations, outside = settle(
            self.body, self.laws, self.boxes, arrays, q, markers, self.options, True
        )
        return Solution(q, size, converged, stable, iterations, markers, not outside)
