"""The compiled way to the equilibrium of a chain, for one and for many."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pliant.mechanics.efforts import actuation_values
from pliant.mechanics.statics import Loads
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant_plugins.physics.compiled.body import load_arrays
from pliant_plugins.physics.compiled.equilibrium import settle
from pliant_plugins.physics.compiled.packs import Packs
from pliant_plugins.physics.quasistatic.newton import NewtonOptions, Solution


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
