"""A grasp of 6 s, three fingers of six modules, one core: wall time of the whole episode, compiling included.

python benchmarks/grasp/speed.py [--quick]    prints, and writes benchmarks/out/grasp_speed.json
"""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np
from benchmarks.grasp.gripper import engine, finger, grasp, with_effect
from benchmarks.output import write

from pliant.errors import MissingDependencyError
from pliant.records.chain import ChainModel

EPISODE_S = 6.0
BAR = 20.0
OBJECTS = {"egg": 5, "cylinder": 1}
EFFECT = "stiffness"


def main() -> None:
    """Interleaved repeats; the least time of each counts, the median is beside it."""
    quick = "--quick" in sys.argv
    counts = {"mujoco": 2 if quick else 9, "pybullet": 1 if quick else 3}
    engines = {kind: count for kind, count in counts.items() if _known(kind)}
    chain = finger()
    chains = {"": chain, "_with_effect": with_effect(chain, EFFECT, factor=1.1)}
    cases = {
        f"{name}_{kind}{effect}": (name, kind, chain, count)
        for name in OBJECTS
        for kind, count in engines.items()
        for effect, chain in chains.items()
    }
    walls: dict[str, list[float]] = {key: [] for key in cases}
    more: dict[str, dict[str, Any]] = {}
    for repeat in range(max(engines.values())):
        for key, (name, kind, chain, count) in cases.items():
            if repeat < count:
                wall_s, more[key] = _episode(name, kind, chain)
                walls[key].append(wall_s)
    result: dict[str, Any] = {"episode_s": EPISODE_S, "bar_real_time": BAR}
    print("object, engine                 least s  median s  × real time  building s")
    for key, times in walls.items():
        one = result[key] = _figures(times, more[key])
        print(
            f"{key:<30}{one['least_s']:8.3f}{one['median_s']:10.3f}{one['real_time_factor']:13.1f}"
            f"{one['building_s']:12.3f}"
        )
    write("grasp_speed", result)
    least = min(v["real_time_factor"] for k, v in result.items() if k.endswith("mujoco"))
    print(f"MuJoCo: at least {least:.1f} × real time; to reach: {BAR:g} ×")
    for name in OBJECTS:
        for kind in engines:
            plain, effect = (result[f"{name}_{kind}{end}"]["least_s"] for end in chains)
            print(f"{name}, {kind}: with '{EFFECT}' {effect / plain:.2f} × the time")


def _known(kind: str) -> bool:
    try:
        engine(kind)
    except MissingDependencyError as error:
        print(f"{kind}: {error}")
        return False
    return True


def _episode(name: str, kind: str, chain: ChainModel) -> tuple[float, dict[str, Any]]:
    """Wall time of a grasp, how it ended, and the time that building its scene takes."""
    task, backend = grasp(object=name, extra_weights=OBJECTS[name], pressure=15e3), engine(kind)
    started = time.perf_counter()
    with backend.build_scene(task.scene(chain)) as built:
        building_s = time.perf_counter() - started
        built.markers(0)
    started = time.perf_counter()
    mode = task.run(chain, backend.build_scene).metrics["mode"]
    return time.perf_counter() - started, {"building_s": building_s, "mode": mode}


def _figures(times: Sequence[float], more: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "least_s": min(times),
        "median_s": float(np.median(times)),
        "real_time_factor": EPISODE_S / min(times),
        **more,
    }


if __name__ == "__main__":
    main()
