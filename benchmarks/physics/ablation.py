"""Step size and damping against the distance from equilibrium after the 2 s run: the study's ablation.

    python -m benchmarks.physics.ablation      prints, and writes benchmarks/out/physics_ablation.json

The helix with 20 g at the tip, 1 s of ramp and 1 s of hold. MuJoCo over steps of 1 to 50 ms and viscous damping of
the joints, without and (last column) with its default drag; the published formulation over steps around its
1/2400 s and friction of its motors.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from benchmarks.output import engine, known, largest_mm, settle, write
from benchmarks.physics import published
from benchmarks.physics.helix import Ended, helix, helix_law, inputs, law_efforts, roll_history

from pliant.records.design import Array

LOAD_KG = 0.020
STEPS_S = (1e-3, 2e-3, 5e-3, 10e-3, 20e-3, 50e-3)
DAMPINGS = (1e-4, 3e-4, 1e-3, 3e-3, "default")
PUBLISHED_STEPS_S = (1 / 2400, 1 / 1200, 1 / 480)
MOTORS_N_M = (3e-5, 1e-4, 1e-3)
# Further from equilibrium than the helix is long: the motion has no bound.
LOST_MM = 120.0


def main() -> None:
    law = helix_law()
    chain = helix(law)
    rest = settle(engine("quasistatic"), chain, inputs(LOAD_KG))[0].markers_m

    def mujoco(step_s: float, damping: float | str) -> Ended:
        own = {} if isinstance(damping, str) else {"joint_damping": damping, "drag_1_s": 0.0}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # the table reports diverged motions
            return roll_history(engine("mujoco", timestep_s=step_s, **own), chain, LOAD_KG, step_s)

    def script(step_s: float, motor_n_m: float) -> Ended:
        return published.run(chain, law_efforts(law), LOAD_KG, motor_n_m, step_s)

    title = "mujoco: joint damping, N·m·s/rad"
    tables = {"mujoco": table(title, STEPS_S, DAMPINGS, rest, mujoco), "published": []}
    if known("pybullet"):
        title = "published formulation: friction of the motors, N·m"
        tables["published"] = table(title, PUBLISHED_STEPS_S, MOTORS_N_M, rest, script)
    write("physics_ablation", {"load_kg": LOAD_KG, **tables})


def table(
    title: str,
    steps: Sequence[float],
    dampings: Sequence[Any],
    rest_m: Array,
    run: Callable[[float, Any], Ended],
) -> list[dict[str, Any]]:
    """Print distance from equilibrium and CPU time, a row per step size, a column per damping."""
    print(f"{title}; mm from equilibrium after 2 s (CPU ms)")
    print(f"{'step, ms':>9} " + "".join(f"{damping:>18}" for damping in dampings))
    rows = []
    for step in steps:
        cells = []
        for damping in dampings:
            end = run(step, damping)
            away = largest_mm(end.markers_m, rest_m)
            bounded = bool(np.isfinite(away)) and away < LOST_MM
            known_mm = away if bounded else None
            rows.append({"step_s": step, "damping": damping, "away_mm": known_mm, "cpu_s": end.cpu_s})
            cells.append(f"{away:9.3f}" if bounded else f"{'diverged':>9}")
            cells.append(f" ({1e3 * end.cpu_s:6.1f})")
        print(f"{1e3 * step:9.2f} " + "".join(cells), flush=True)
    return rows


if __name__ == "__main__":
    main()
