"""The chain against a Cosserat rod: the linear-law helix, and what a wrong torque frame would cost.

    python -m benchmarks.physics.rod      prints, and writes benchmarks/out/physics_rod.json

The rod is PyElastica's, with bends at four places per module; shear and stretch are suppressed by a stiffness at
which it stretches by 0.015 %. Both are without the end cylinder. The chain is settled by the quasi-static engine,
with the right law and with efforts taken for torques in the child's and in the parent's frame. Cut in four joints
per module, as the rod is, the chain shows how much of its distance is discretisation.
"""

from __future__ import annotations

import numpy as np
from benchmarks.output import Bar, write
from benchmarks.physics import cosserat
from benchmarks.physics.frames import UnmappedLaw
from benchmarks.physics.helix import LOADS_KG, cut, helix, inputs, linear_law

from pliant.records.chain import ChainModel
from pliant.records.rollout import Equilibrium
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig

LOAD_KG = 0.020


def main() -> None:
    """Settle the rod, the chain and the two wrong chains under every load."""
    law = linear_law()
    chains = {"right": law, "child": UnmappedLaw(law, "child"), "parent": UnmappedLaw(law, "parent")}
    cosserat.settle_rod(law, LOAD_KG, cosserat.COMPILING)
    print("distance of the tip from the rod's, mm; in brackets: of the ring moved most by the wrong frame")
    print(f"{'load':>6} {'chain':>9} {'cut in 4':>9} {'in child frame':>17} {'in parent frame':>17}")
    rows = {}
    for load in LOADS_KG:
        rod = cosserat.settle_rod(law, load, cosserat.FINE)
        settled = {name: settle(helix(chain, end_cylinder=False), load) for name, chain in chains.items()}
        settled["cut in 4"] = settle(helix(linear_law(cells=4), cut(4), end_cylinder=False), load)
        away = {name: 1e3 * float(np.linalg.norm(e.tip_m - rod.tip_m)) for name, e in settled.items()}
        moved = {name: _largest_mm(settled[name], settled["right"]) for name in ("child", "parent")}
        wrong = " ".join(f"{away[name]:10.2f} ({moved[name]:.2f})" for name in moved)
        print(f"{1e3 * load:4.0f} g {away['right']:9.3f} {away['cut in 4']:9.3f} {wrong}", flush=True)
        rows[f"{1e3 * load:.0f} g"] = {
            "tip_from_rod_mm": away,
            "ring_moved_mm": moved,
            "rod_tip_m": rod.tip_m.tolist(),
            "chain_tip_m": settled["right"].tip_m.tolist(),
            "rod_stretch": rod.longest_stretch,
            "rod_steps": rod.steps,
        }
    reached = rows[f"{1e3 * LOAD_KG:.0f} g"]["tip_from_rod_mm"]["right"]
    bar = Bar("tip of the linear-law chain from the rod's, 20 g", reached, 0.5, "mm", at_most=True)
    write("physics_rod", {"loads": rows, "cells_per_module": cosserat.FINE.cells}, [bar])


def settle(chain: ChainModel, load_kg: float) -> Equilibrium:
    """The chain's equilibrium under pressure and the tip load."""
    with Quasistatic(QuasistaticConfig()).build(chain) as simulation:
        simulation.apply(inputs(load_kg))
        return simulation.settle()


def _largest_mm(one: Equilibrium, other: Equilibrium) -> float:
    return 1e3 * float(np.linalg.norm(one.markers_m - other.markers_m, axis=1).max())


if __name__ == "__main__":
    main()
