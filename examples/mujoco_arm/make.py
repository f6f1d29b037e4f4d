"""Write bench.csv: the arm by another integrator with a short step, with an effect that arm.xml does not have.

python make.py
"""

from __future__ import annotations

import csv
from itertools import pairwise
from pathlib import Path

import mujoco
import numpy as np

HERE = Path(__file__).parent
JOINTS = ("yaw", "shoulder", "elbow")
HIDDEN_JOINT, MOMENT_N_M, SPEED_RAD_S = 1, 0.9, 0.01  # dry friction of the shoulder's gear
STEP_S, SAMPLE_S, LENGTH_S, RUNS = 0.00025, 0.01, 5.0, 4
NOISE_RAD = 0.002
SIZES = np.array([0.8, 0.35, 0.6])  # of the commands, rad


def commands(run: int) -> np.ndarray:
    """Return (t, 3) commands of a run: two sines of each joint, from rest."""
    time = np.arange(0.0, LENGTH_S, SAMPLE_S)[:, None]
    rate = (0.22 + 0.13 * run) * np.array([1.0, 1.3, 0.8])
    wave = 0.7 * np.sin(2.0 * np.pi * rate * time) + 0.3 * np.sin(2.0 * np.pi * 2.3 * rate * time + run)
    return SIZES * wave * np.minimum(time, 1.0)


def simulated(model: mujoco.MjModel, asked: np.ndarray) -> np.ndarray:
    """Return (t, 3) angles under commands that are straight lines between their samples."""
    data, parts = mujoco.MjData(model), round(SAMPLE_S / STEP_S)
    for _ in range(round(2.0 / STEP_S)):  # the arm comes to rest first
        mujoco.mj_step(model, data)
    found = [data.qpos.copy()]
    for before, after in pairwise(asked):
        for part in range(parts):
            data.ctrl[:] = before + (after - before) * part / parts
            friction = -MOMENT_N_M * np.tanh(data.qvel[HIDDEN_JOINT] / SPEED_RAD_S)
            data.qfrc_applied[HIDDEN_JOINT] = friction
            mujoco.mj_step(model, data)
        found.append(data.qpos.copy())
    return np.array(found)


def main() -> None:
    """Write the recording."""
    model = mujoco.MjModel.from_xml_path(str(HERE / "arm.xml"))
    model.opt.integrator, model.opt.timestep = mujoco.mjtIntegrator.mjINT_RK4, STEP_S
    noise = np.random.default_rng(7)
    heads = [*(f"{name}_command_rad" for name in JOINTS), *(f"{name}_angle_deg" for name in JOINTS)]
    with (HERE / "bench.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["run", "time_s", *heads])
        for run in range(RUNS):
            asked = commands(run)
            seen = np.degrees(simulated(model, asked) + noise.normal(0.0, NOISE_RAD, asked.shape))
            for k, row in enumerate(np.hstack([asked, seen])):
                writer.writerow([f"run_{run + 1}", f"{k * SAMPLE_S:.2f}", *(f"{value:.5g}" for value in row)])


if __name__ == "__main__":
    main()
