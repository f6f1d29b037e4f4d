"""The chain against a Cosserat rod: the linear-law helix, and the error of a wrong torque frame.

    python -m benchmarks.physics.rod      prints, and writes benchmarks/out/physics_rod.json

The rod is PyElastica's, with bends at four places per module; shear and stretch are suppressed by a stiffness at
which it stretches by 0.015 %. Both are without the end cylinder. The chain is settled by the quasi-static engine,
with the right law and with efforts taken for torques in the child's and in the parent's frame. Cut in four joints
per module, as the rod is, the chain shows how much of its distance is discretisation.
"""

from __future__ import annotations

import numpy as np
from benchmarks.output import Bar, engine, largest_mm, settle, write
from benchmarks.physics import cosserat
from benchmarks.physics.helix import LOADS_KG, UnmappedLaw, cut, helix, inputs, linear_law

LOAD_KG = 0.020


def main() -> None:
    law, still = linear_law(), engine("quasistatic")
    laws = {"right": law, "child": UnmappedLaw(law, "child"), "parent": UnmappedLaw(law, "parent")}
    chains = {name: helix(one, end_cylinder=False) for name, one in laws.items()}
    chains["cut in 4"] = helix(linear_law(cells=4), cut(4), end_cylinder=False)
    cosserat.settle_rod(law, LOAD_KG, cosserat.COMPILING)
    print("distance of the tip from the rod's, mm; in brackets: of the ring moved most by the wrong frame")
    print(f"{'load':>6} {'chain':>9} {'cut in 4':>9} {'in child frame':>17} {'in parent frame':>17}")
    rows = {}
    for load in LOADS_KG:
        rod = cosserat.settle_rod(law, load, cosserat.FINE)
        settled = {name: settle(still, chain, inputs(load))[0] for name, chain in chains.items()}
        away = {name: 1e3 * float(np.linalg.norm(end.tip_m - rod.tip_m)) for name, end in settled.items()}
        right = settled["right"].markers_m
        moved = {name: largest_mm(settled[name].markers_m, right) for name in ("child", "parent")}
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
    bar = Bar("tip of the linear-law chain from the rod's, 20 g", reached, 0.5, "mm")
    write("physics_rod", {"loads": rows, "cells_per_module": cosserat.FINE.cells}, [bar])


if __name__ == "__main__":
    main()
