"""The history of the published run in Pliant's engines, and how far from equilibrium it ends."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from benchmarks.physics.helix import PRESSURE_PA, inputs
from benchmarks.physics.published import DURATION_S, RAMP_S

from pliant.interfaces.physics import PhysicsBackend, Run
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import History


@dataclass(frozen=True, eq=False)
class Ended:
    """Where a run ended, and the CPU time that it took."""

    angles_rad: Array
    markers_m: Array
    cpu_s: float


def run_history(backend: PhysicsBackend, chain: ChainModel, load_kg: float, step_s: float) -> Ended:
    """1 s of pressure ramp, then hold, from the straight chain, step by step; building is not counted."""
    with backend.build(chain) as simulation:
        start = time.process_time()
        for k in range(round(DURATION_S / step_s)):
            pressure = PRESSURE_PA * min((k + 1) * step_s / RAMP_S, 1.0)
            simulation.apply(inputs(load_kg, pressure))
            simulation.step(step_s)
        cpu_s = time.process_time() - start
        return Ended(simulation.snapshot().position, simulation.markers(), cpu_s)


def roll_history(backend: PhysicsBackend, chain: ChainModel, load_kg: float, step_s: float) -> Ended:
    """The same in one call of the engine, which may stay in compiled code; here building the model is counted."""
    time_s: Array = step_s * np.arange(round(DURATION_S / step_s) + 1.0)
    still = inputs(load_kg)
    pressure = PRESSURE_PA * np.minimum(time_s / RAMP_S, 1.0)
    history = History.of({"pressure_pa": pressure}, time_s, tip_force_n=still.tip_force_n)
    start = time.process_time()
    (rollout,) = backend.rollout_batch((Run(chain, history),))
    cpu_s = time.process_time() - start
    return Ended(rollout.joint_angles[-1], rollout.markers_m[-1], cpu_s)


def away_mm(markers_m: Array, equilibrium_m: Array) -> float:
    """Largest distance of a marker from where it settles, mm."""
    return 1e3 * float(np.linalg.norm(markers_m - equilibrium_m, axis=1).max())


def residual_n_m(chain: ChainModel, angles_rad: Array, load_kg: float) -> float:
    """Largest unbalanced effort of a state by the common statics, N·m."""
    loads = Loads.of(chain, inputs(load_kg))
    return float(np.abs(ChainStatics(chain).residual(angles_rad, loads)).max())
