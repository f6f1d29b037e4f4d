"""Comparison of three engines on the same chains: settled states, their differences and times.

    python -m benchmarks.engines_agree    prints, and writes benchmarks/out/engines_agree.json

A finger of eight modules of 11 mm and 1.6 g with the published law (odd form) at 15 kPa, its modules' centre of mass 10
mm off the hinge line, with and without 13 g at the tip; and the published helix of 22 spherical joints with 0, 10, 20
and 50 g. Each is settled in one jump from the straight chain. Times are medians of CPU seconds, on one thread, compared
as ratios to the quasi-static engine of the same run.
"""

from __future__ import annotations

import statistics
from itertools import combinations
from typing import Any

from benchmarks.physics import helix  # sets the number of threads before numpy is imported

# isort: split
import numpy as np
from benchmarks.output import Bar, component, engine, largest_mm, settle, write

from pliant.errors import MissingDependencyError
from pliant.records.chain import ChainModel, Joint, default_base_rotation
from pliant.records.design import MassProperties
from pliant.records.rollout import Equilibrium, Inputs

MODULES, LENGTH_M, MODULE_KG, COM_OFFSET_M = 8, 0.011, 0.0016, 0.010
LAW = {"k_n": 1.637e-6, "m_a": -1.704e-6, "m_e": 0.1012, "b_e": 0.0245}
PRESSURE_PA = 15e3
AGREE_MM = 0.01
REPEATS = 3


def main() -> None:
    pressed = Inputs({"pressure_pa": PRESSURE_PA})
    cases = {
        "finger, own weight": (finger(0.0), pressed),
        "finger, 13 g at the tip": (finger(0.013), pressed),
    }
    chain = helix.helix()
    for load in helix.LOADS_KG:
        cases[f"helix, {1e3 * load:.0f} g at the tip"] = (chain, helix.inputs(load))
    results: dict[str, Any] = {}
    for name, (model, inputs) in cases.items():
        print(f"{name}:")
        results[name] = compare(model, inputs)
    of_helix = [results[name]["largest_marker_distance_mm"] for name in results if name.startswith("helix")]
    apart = max(distance for distances in of_helix for distance in distances.values())
    bar = Bar("settled rings of the helix, largest distance between engines", apart, AGREE_MM, "mm")
    write("engines_agree", {"cases": results}, [bar])


def compare(chain: ChainModel, inputs: Inputs) -> dict[str, Any]:
    """Return tips, residuals, times and pairwise distances of one chain; engines not installed are skipped."""
    ends: dict[str, Equilibrium] = {}
    skipped: dict[str, str] = {}
    table: dict[str, Any] = {}
    for kind in ("quasistatic", "mujoco", "pybullet"):
        try:
            runs = [settle(engine(kind), chain, inputs) for _ in range(REPEATS)]
        except MissingDependencyError as error:
            skipped[kind] = str(error)
            print(f"  {kind:12s} skipped: {error}")
            continue
        ends[kind] = final = runs[-1][0]
        seconds = statistics.median(cpu_s for _, cpu_s in runs)
        ratio = seconds / (table["quasistatic"]["cpu_s"] if table else seconds)
        tip = final.tip_m * 1e3
        print(
            f"  {kind:12s} tip ({tip[0]:.4f}, {tip[1]:.4f}, {tip[2]:.4f}) mm  residual {final.residual:.1e}"
            f" N·m  {final.iterations:4d} iterations  {ratio:7.1f} × quasi-static"
        )
        reached = {
            "residual_n_m": final.residual,
            "converged": final.converged,
            "iterations": final.iterations,
        }
        table[kind] = {
            "tip_m": final.tip_m.tolist(),
            **reached,
            "cpu_s": seconds,
            "cpu_over_quasistatic": ratio,
        }
    pairs = combinations(ends, 2)
    distances = {f"{a}-{b}": largest_mm(ends[a].markers_m, ends[b].markers_m) for a, b in pairs}
    for pair, distance in distances.items():
        print(f"  {pair}: largest marker distance {distance:.1e} mm")
    return {"engines": table, "largest_marker_distance_mm": distances, "skipped": skipped}


def finger(payload_kg: float) -> ChainModel:
    """Return the chain; a module's mass is a 20 × 22 mm block, shared by its two halves."""
    law = component("surrogate", "polynomial", form="study", coefficients=LAW, odd=True).stated()

    def piece(modules: float, centre_m: float) -> MassProperties:
        sides = np.array([modules * LENGTH_M, 0.020, 0.022])
        mass = modules * MODULE_KG
        inertia = mass / 12 * np.diag(np.sum(sides**2) - sides**2)
        return MassProperties(mass, np.array([centre_m, 0.0, COM_OFFSET_M]), inertia)

    along = np.array([LENGTH_M, 0.0, 0.0])
    inner = piece(1.0, LENGTH_M / 2)
    return ChainModel(
        joints=tuple(Joint(0, along * (1.0 if i else 0.5), np.eye(3)) for i in range(MODULES)),
        bodies=(piece(0.5, LENGTH_M / 4), *[inner] * (MODULES - 1), piece(0.5, LENGTH_M / 4)),
        laws=(law,),
        tip_offset_m=along / 2,
        base_position_m=np.zeros(3),
        base_rotation=default_base_rotation(),
        payload_kg=payload_kg,
    )


if __name__ == "__main__":
    main()
