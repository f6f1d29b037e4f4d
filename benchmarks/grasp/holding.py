"""Holding limits of egg and cylinder, MuJoCo against PyBullet under one friction rule, and the creep of what is held.

python -m benchmarks.grasp.holding [--quick]    prints, and writes benchmarks/out/grasp_holding.json; resumes

The limit is the largest extra mass, at the object's centre, with which a grasp without noise is `stable`, by
bisection from a mass that is held and one that is not.
"""

from __future__ import annotations

from typing import Any

from benchmarks.grasp.gripper import engine_code_digest, finger, grasp
from benchmarks.output import engine, known, make_parser, read, write

from pliant.interfaces.physics import PhysicsBackend
from pliant.records.chain import ChainModel

CASES = tuple((name, kpa) for name in ("egg", "cylinder") for kpa in (13, 15))
WITHIN_SHARE, WITHIN_KG = 0.10, 0.020
CREEP_M_S = 1e-4
CREEP_SHARE = 0.75  # of the limit: held by a margin, so that what moves is the engine's creep
HEAVIEST_KG = 0.64
HOLD_S = 4.0
# MuJoCo's defaults solref (0.02, 1) and solimp 0.95 in the engine's words, and friction as soft as pressing.
MUJOCO_DEFAULTS = {
    "contact_stiffness": 1 / (0.95 * 0.02) ** 2,
    "contact_damping": 2 / (0.95 * 0.02),
    "slip_damping": 2 / (0.95 * 0.02),
    "impratio": 1.0,
}


def main() -> None:
    quick = make_parser(__doc__, "two cases, coarsely; nothing is taken over").parse_args().quick
    resolution = 0.010 if quick else 0.002
    chain = finger()
    law = chain.laws[0].record()
    numbers = [array.round(12).tolist() for array in law.arrays.values()]
    # Dependencies of a limit: the law, and the code of task and engines.
    made_of = f"{engine_code_digest('mujoco', 'pybullet')} {law.kind} {sorted(law.values.items())} {numbers}"
    found: dict[str, Any] = {} if quick else read("grasp_holding")
    if found.get("chain") != made_of:
        found = {"chain": made_of}
    engines = [kind for kind in ("mujoco", "pybullet") if known(kind)]
    print("object, pressure      MuJoCo  PyBullet  apart")
    for name, kpa in CASES[:: 2 if quick else 1]:
        limits = {}
        for kind in engines:
            key = f"{name}_{kpa}_{kind}_{resolution:g}"
            if key not in found:
                found[key] = limit_kg(engine(kind), chain, name, 1e3 * kpa, resolution)
            limits[kind] = found[key]
            write("grasp_holding", found)
        print(_line(name, kpa, limits))
    for name, kpa in CASES:
        extra = CREEP_SHARE * found.get(f"{name}_{kpa}_mujoco_{resolution:g}", 0.0)
        settings: dict[str, dict[str, float]] = {"ours": {}, "MuJoCo's defaults": MUJOCO_DEFAULTS}
        creeps = {
            which: creep_m_s(engine("mujoco", **own), chain, name, 1e3 * kpa, extra)
            for which, own in settings.items()
        }
        found[f"creep_{name}_{kpa}"] = {"extra_kg": extra, "creep_m_s": creeps}
        shown = {k: "fell" if v is None else f"{1e3 * v:.3f} mm/s" for k, v in creeps.items()}
        texts = ", ".join(f"{which} {value}" for which, value in shown.items())
        print(
            f"creep of the {name} at {kpa} kPa with {1e3 * extra:.0f} g: {texts} (to reach {1e3 * CREEP_M_S:g})"
        )
    write("grasp_holding", found)


def limit_kg(
    backend: PhysicsBackend, chain: ChainModel, name: str, pressure: float, within_kg: float
) -> float:
    """Return the largest extra mass held; 0 if not even the object itself is held."""

    def held(extra_kg: float) -> bool:
        """Return whether the object with this extra mass at its centre is lifted and stays."""
        weights = {"extra_weights": 1, "weight_kg": extra_kg} if extra_kg > 0 else {}
        task = grasp(object=name, pressure=pressure, **weights)
        return bool(task.run(chain, backend.build_scene).metrics["mode"] == "stable")

    low, high = 0.0, 0.02
    if not held(0.0):
        return 0.0
    while high < HEAVIEST_KG and held(high):
        low, high = high, 2 * high
    while high - low > within_kg:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if held(middle) else (low, middle)
    return low


def creep_m_s(
    backend: PhysicsBackend, chain: ChainModel, name: str, pressure: float, extra_kg: float
) -> float | None:
    """Return the speed at which a held object sinks, over the second half of a long hold; None if it fell."""
    task = grasp(
        object=name, pressure=pressure, extra_weights=1, weight_kg=extra_kg or 1e-6, final_time_s=2 * HOLD_S
    )
    result = task.run(chain, backend.build_scene)
    if result.metrics["z_end_m"] < 0.5 * task.config.lift_height_m:
        return None
    time_s, height = result.frames.time_s, result.frames.positions_m[:, 0, 2]
    late = int(abs(time_s - (time_s[-1] - HOLD_S)).argmin())
    return float((height[late] - height[-1]) / (time_s[-1] - time_s[late]))


def _line(name: str, kpa: int, limits: dict[str, float]) -> str:
    texts = [f"{1e3 * limits[k]:7.1f} g" if k in limits else "      –" for k in ("mujoco", "pybullet")]
    line = f"{name:<9} {kpa} kPa     {'  '.join(texts)}"
    if len(limits) < 2:
        return line
    apart = abs(limits["mujoco"] - limits["pybullet"])
    share = apart / max(*limits.values(), 1e-9)
    verdict = "within" if share <= WITHIN_SHARE or apart <= WITHIN_KG else "NOT within"
    return f"{line}  {1e3 * apart:5.1f} g, {100 * share:.0f} %: {verdict} 10 % or 20 g"


if __name__ == "__main__":
    main()
