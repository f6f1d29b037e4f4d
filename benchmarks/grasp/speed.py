"""A grasp of 6 s, three fingers of six modules, one core: wall time of the whole episode, compiling included.

python benchmarks/grasp/speed.py [--quick]    prints, and writes benchmarks/out/grasp_speed.json
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np
from benchmarks.grasp.gripper import engine, finger, grasp, write

from pliant.errors import MissingDependencyError

EPISODE_S = 6.0
BAR = 20.0
OBJECTS = {"egg": 5, "cylinder": 1}


def main() -> None:
    """Interleaved repeats of both engines; the least time of each counts, the median is beside it."""
    quick = "--quick" in sys.argv
    engines = {"mujoco": 2 if quick else 9, "pybullet": 1 if quick else 3}
    chain = finger()
    result: dict[str, Any] = {"episode_s": EPISODE_S, "bar_real_time": BAR}
    print("object    engine     least s  median s  × real time  building s")
    for name, weights in OBJECTS.items():
        task = grasp(object=name, extra_weights=weights, pressure=15e3)
        walls: dict[str, list[float]] = {kind: [] for kind in engines}
        building: dict[str, float] = {}
        modes: dict[str, str] = {}
        for repeat in range(max(engines.values())):
            for kind, count in engines.items():
                if repeat >= count:
                    continue
                try:
                    backend = engine(kind)
                except MissingDependencyError as error:
                    print(f"{kind}: {error}")
                    continue
                started = time.perf_counter()
                with backend.build_scene(task.scene(chain)) as built:
                    building[kind] = time.perf_counter() - started
                    built.markers(0)
                started = time.perf_counter()
                modes[kind] = task.run(chain, backend.build_scene).metrics["mode"]
                walls[kind].append(time.perf_counter() - started)
        for kind, times in walls.items():
            if times:
                factor = EPISODE_S / min(times)
                result[f"{name}_{kind}"] = {
                    "least_s": min(times),
                    "median_s": float(np.median(times)),
                    "real_time_factor": factor,
                    "building_s": building[kind],
                    "mode": modes[kind],
                }
                print(
                    f"{name:<10}{kind:<10}{min(times):8.3f}{np.median(times):10.3f}{factor:13.1f}"
                    f"{building[kind]:12.3f}"
                )
    write("grasp_speed", result)
    least = min(v["real_time_factor"] for k, v in result.items() if k.endswith("mujoco"))
    print(f"MuJoCo: at least {least:.1f} × real time; to reach: {BAR:g} ×")


if __name__ == "__main__":
    main()
