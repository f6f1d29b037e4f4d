"""An engine with inertia, small and sufficiently accurate, and engines whose pendulum is wrong in one way each."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from tests.conformance.broken.physics import EngineConfig, variants

from pliant.interfaces.physics import Capabilities
from pliant.interfaces.simulation import SimulationState
from pliant.mechanics.inertia import mass_matrix
from pliant.records.chain import ChainModel
from pliant.registry.component import Component
from pliant.testing.stand_ins import StandIn, StandInSimulation

INNER_S = 1e-3


class SwingingSimulation(StandInSimulation):
    """M q̈ = unbalanced effort, dashpots among the terms included, by the symplectic Euler method."""

    inertia_factor = 1.0
    dashpot_factor = 1.0
    growth = 0.0

    def __init__(self, chain: ChainModel) -> None:
        # rate-dependent terms belong to this engine; the statics has none of them
        self.dashpots = [term for term in chain.terms if term.needs_time]
        super().__init__(chain.with_(terms=tuple(t for t in chain.terms if not t.needs_time)))
        self.v = np.zeros_like(self.q)

    def step(self, duration_s: float) -> None:
        count = max(int(np.ceil(duration_s / INNER_S)), 20)
        h = duration_s / count
        self.loads = self.applied
        for _ in range(count):
            force = np.asarray(self.statics.residual(self.q, self.loads)).ravel()
            for term in self.dashpots:
                force = force - self.dashpot_factor * term.parameters[0] * self.v.ravel()
            mass = self.inertia_factor * mass_matrix(self.chain, self.q)
            self.v = (
                self.v + h * np.linalg.solve(mass, force).reshape(self.q.shape) + h * self.growth * self.v
            )
            self.q = self.q + h * self.v
        self.time_s += duration_s

    def snapshot(self) -> SimulationState:
        return SimulationState(self.time_s, self.q.copy(), self.v.copy())


class Swinging(StandIn):
    """An engine that integrates inertia."""

    capabilities = Capabilities(StandIn.capabilities.joints, dynamic=True)
    simulation: type[SwingingSimulation] = SwingingSimulation

    def build(self, chain: ChainModel) -> SwingingSimulation:
        return self.simulation(chain)


GOOD = Component(
    "physics",
    "small",
    f"{EngineConfig.__module__}:EngineConfig",
    f"{__name__}:Swinging",
    "symplectic Euler",
)
simulated = variants.row_adder(Swinging, "simulation")


def _at_once(up: Any, self: Any, duration_s: float) -> None:
    StandInSimulation.step(self, duration_s)


def _other_rates(up: Any, self: Any) -> SimulationState:
    good: SimulationState = up()
    return replace(good, velocity=3 * good.velocity)


# quasi-static, contrary to its declaration
simulated("swings_with_its_period", step=_at_once)
simulated("gains_no_energy", step=_at_once)
simulated("damps_as_the_law_says", step=_at_once)
simulated("swings_with_its_period", inertia_factor=1.3)
simulated("gains_no_energy", growth=1.0)
simulated("gains_no_energy", snapshot=_other_rates)
simulated("damps_as_the_law_says", dashpot_factor=0.0)
simulated("damps_as_the_law_says", dashpot_factor=2.0)
