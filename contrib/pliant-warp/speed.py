"""4 096 fingers settled at once: the device against the compiled CPU, and their difference.

    python contrib/pliant-warp/speed.py [--cases 4096] [--device auto]

The baseline is `settle_batch` of the quasi-static engine in the same process, on all cores. Both are timed a second
time, when everything is compiled.
"""

from __future__ import annotations

import argparse
import os
import time

import numpy as np
from pliant_warp.backend import MujocoWarp
from pliant_warp.batch import warp_device
from pliant_warp.config import MujocoWarpConfig

from pliant.interfaces.physics import Case, PhysicsBackend
from pliant.records.rollout import Equilibrium, Inputs
from pliant.registry.discovery import discover
from pliant.testing.samples import PRESSURE_PA, sample_chain, sample_table, softening_law
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig

MODULES, CHAINS = 8, 64


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cases", type=int, default=4096)
    parser.add_argument("--device", default="auto")
    arguments = parser.parse_args()
    config = MujocoWarpConfig(device=arguments.device)
    cases = drawn(arguments.cases)
    device_s, found = timed(MujocoWarp(config), cases)
    cpu_s, wanted = timed(Quasistatic(QuasistaticConfig()), cases)
    apart = max(np.abs(a.markers_m - b.markers_m).max() for a, b in zip(found, wanted, strict=True))
    reached = sum(one.converged for one in found)
    relaxed_s, steps = sum(one.wall_s for one in found), max(one.iterations for one in found)
    print(
        f"{len(cases)} fingers of {MODULES} modules, {warp_device(config)}: {device_s:.2f} s, {reached} converged; "
        f"{relaxed_s:.2f} s of it until they are at rest, in {steps} steps, the rest for the verdicts on the host"
    )
    print(f"compiled CPU, {os.cpu_count()} cores: {cpu_s:.2f} s; ratio {cpu_s / device_s:.2f}")
    print(f"largest distance of a marker: {1e3 * apart:.2g} mm")


def drawn(count: int) -> list[Case]:
    """Return fingers of a fitted law, which both engines have compiled, each with its own pressure and pull."""
    rng, polynomial = np.random.default_rng(0), discover().get("surrogate", "polynomial")
    surrogate = polynomial.build(polynomial.config_model()(kind="polynomial"))
    law = surrogate.fit(sample_table(softening_law())).law
    chains = [sample_chain(law, modules=MODULES, payload=0.004 * rng.random()) for _ in range(CHAINS)]
    cases = []
    for k in range(count):
        pull = 0.005 * rng.normal(size=3) * [1.0, 0.0, 1.0]
        pressure = {"pressure_pa": PRESSURE_PA * rng.random()}
        cases.append(Case(chains[k % CHAINS], Inputs(pressure, tip_force_n=pull)))
    return cases


def timed(engine: PhysicsBackend, cases: list[Case]) -> tuple[float, tuple[Equilibrium, ...]]:
    """Return seconds of the second batch, and its equilibria."""
    engine.settle_batch(cases)
    begun = time.perf_counter()
    found = engine.settle_batch(cases)
    return time.perf_counter() - begun, found


if __name__ == "__main__":
    main()
