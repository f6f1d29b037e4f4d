"""A grasp of 6 s, three fingers of six modules, one core: wall time of the whole episode, compiling included.

python -m benchmarks.grasp.speed [--quick]    prints, and writes benchmarks/out/grasp_speed.json
"""

from __future__ import annotations

import time
from itertools import product
from typing import Any

import numpy as np
from benchmarks.grasp.gripper import finger, grasp
from benchmarks.output import component, engine, known, make_parser, write

from pliant.interfaces.effect import Model
from pliant.records.chain import ChainModel

EPISODE_S = 6.0
BAR = 20.0
OBJECTS = {"egg": 5, "cylinder": 1}
EFFECT = "stiffness"
TOUCHING = "_finger_contact"


def main() -> None:
    """Run interleaved repeats; report the least and the median time of each."""
    quick = make_parser(__doc__, "fewer repeats").parse_args().quick
    counts = {"mujoco": 2 if quick else 9, "pybullet": 1 if quick else 3}
    engines = [kind for kind in counts if known(kind)]
    chain = finger()
    chains = {"": chain, "_with_effect": component("effect", EFFECT, factor=1.1).apply(Model(chain)).chain}
    cases: dict[str, tuple[str, str, ChainModel, bool]] = {
        f"{name}_{kind}{end}": (name, kind, chains[end], False)
        for name, kind, end in product(OBJECTS, engines, chains)
    }
    cases |= {f"{name}_mujoco{TOUCHING}": (name, "mujoco", chain, True) for name in OBJECTS}
    walls: dict[str, list[float]] = {key: [] for key in cases}
    more: dict[str, dict[str, Any]] = {}
    for repeat in range(max(counts[kind] for kind in engines)):
        for key, case in cases.items():
            if repeat < counts[case[1]]:
                wall_s, more[key] = _episode(*case)
                walls[key].append(wall_s)
    result: dict[str, Any] = {"episode_s": EPISODE_S, "bar_real_time": BAR}
    print("object, engine                 least s  median s  × real time  building s")
    for key, times in walls.items():
        least, median = min(times), float(np.median(times))
        result[key] = {
            "least_s": least,
            "median_s": median,
            "real_time_factor": EPISODE_S / least,
            **more[key],
        }
        cells = f"{least:8.3f}{median:10.3f}{EPISODE_S / least:13.1f}{more[key]['building_s']:12.3f}"
        print(f"{key:<30}{cells}")
    write("grasp_speed", result)
    least = min(v["real_time_factor"] for k, v in result.items() if k.endswith("mujoco"))
    print(f"MuJoCo: at least {least:.1f} × real time; to reach: {BAR:g} ×")
    touching = min(v["real_time_factor"] for k, v in result.items() if k.endswith(TOUCHING))
    cpu = min(EPISODE_S / v["cpu_s"] for k, v in result.items() if k.endswith(TOUCHING))
    print(
        f"MuJoCo, fingers on fingers and on themselves: at least {touching:.1f} × ({cpu:.1f} × of processor time); "
        f"to reach: {BAR:g} ×"
    )
    for name, kind in product(OBJECTS, engines):
        plain, effect = (result[f"{name}_{kind}{end}"]["least_s"] for end in chains)
        print(f"{name}, {kind}: with '{EFFECT}' {effect / plain:.2f} × the time")


def _episode(name: str, kind: str, chain: ChainModel, touch: bool) -> tuple[float, dict[str, Any]]:
    """Return wall time of a grasp, its result, and the time to build its scene."""
    task = grasp(object=name, extra_weights=OBJECTS[name], pressure=15e3, finger_contact=touch)
    backend = engine(kind)
    started = time.perf_counter()
    with backend.build_scene(task.scene(chain)) as built:
        building_s = time.perf_counter() - started
        built.markers(0)
    started, busy = time.perf_counter(), time.process_time()
    mode = task.run(chain, backend.build_scene).metrics["mode"]
    wall_s, cpu_s = time.perf_counter() - started, time.process_time() - busy
    return wall_s, {"building_s": building_s, "mode": mode, "cpu_s": cpu_s}


if __name__ == "__main__":
    main()
