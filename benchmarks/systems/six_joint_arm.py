"""Time a diagnosis of a six-joint arm with position servos: 8 runs of 10 s at 100 Hz, all effects of MuJoCo models.

    python -m benchmarks.systems.six_joint_arm                     threads of this process
    python -m benchmarks.systems.six_joint_arm --runs 2 --length 5      a first look

The recording has dry friction at joint 3 that the MJCF lacks, by a fourth-order integrator with a quarter of the file's
time step, another law of friction (tanh), and noise. Stages follow from the times at which hypotheses are reported. The
bar is that of issue 43, 60 s with two cores; other processes make wall seconds longer, so that CPU seconds stand beside
them. Threads of one process work if OMP_NUM_THREADS allows several.
"""

from __future__ import annotations

import csv
import json
import tempfile
import time
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from benchmarks.output import OUT, make_parser
from numpy.typing import NDArray

from pliant import api
from pliant.diagnosis.diagnosis import Diagnosis, diagnose
from pliant.store.store import write_atomically

BAR_S = 60.0
JOINTS = tuple(f"j{k}" for k in range(1, 7))
# axis, length of the link m, its radius m, its mass kg, stiffness of the servo N m/rad
LINKS = (
    ("0 0 1", 0.16, 0.060, 4.0, 900.0),
    ("0 1 0", 0.30, 0.050, 3.5, 900.0),
    ("0 1 0", 0.26, 0.040, 2.2, 500.0),
    ("1 0 0", 0.12, 0.035, 1.1, 200.0),
    ("0 1 0", 0.10, 0.030, 0.7, 120.0),
    ("1 0 0", 0.06, 0.025, 0.3, 60.0),
)
HIDDEN, MOMENT_N_M, SPEED_RAD_S = 2, 3.0, 0.005  # index of the joint, its dry friction
SAMPLE_S, STEP_S, NOISE_RAD = 0.01, 0.0005, 0.0015
SIZES_RAD = np.array([0.7, 0.35, 0.5, 0.6, 0.5, 0.8])  # of the commands
HOME_RAD = np.array([0.0, 0.4, 0.9, 0.0, 0.5, 0.0])

Array = NDArray[np.float64]


def arm_xml() -> str:
    """Return the MJCF of the arm: links in a row, a position servo and an angle sensor at every joint."""
    bodies, along = "", "0 0 0.1"
    for name, (axis, length, radius, mass, _) in zip(JOINTS, LINKS, strict=True):
        end = f"0 0 {length}" if name == "j1" else f"{length} 0 0"
        bodies += (
            f'<body name="link_{name}" pos="{along}"><joint name="{name}" axis="{axis}"/>'
            f'<geom type="capsule" size="{radius}" fromto="0 0 0 {end}" mass="{mass}"/>'
        )
        along = end
    drives = "".join(
        f'<position name="{name}_command" joint="{name}" kp="{link[4]}" kv="{0.06 * link[4]}" ctrlrange="-2.5 2.5"/>'
        for name, link in zip(JOINTS, LINKS, strict=True)
    )
    sensors = "".join(f'<jointpos name="{name}_angle" joint="{name}"/>' for name in JOINTS)
    return (
        '<mujoco model="six_joint_arm"><compiler angle="radian"/><option timestep="0.002" integrator="implicitfast"/>'
        '<default><joint armature="0.05" damping="0.8"/><geom contype="0" conaffinity="0"/></default>'
        f"<worldbody>{bodies}{'</body>' * len(JOINTS)}</worldbody>"
        f"<actuator>{drives}</actuator><sensor>{sensors}</sensor></mujoco>"
    )


def commands(run: int, length_s: float) -> Array:
    """Return (t, 6) commands of a run: slow and fast cycles of every joint, from rest at home."""
    time_s = np.arange(0.0, length_s, SAMPLE_S)[:, None]
    rate = (0.12 + 0.07 * run) * np.array([1.0, 1.25, 0.85, 1.4, 0.7, 1.6])
    wave = 0.7 * np.sin(2.0 * np.pi * rate * time_s + run) - 0.7 * np.sin(run)
    wave = wave + 0.2 * np.sin(2.0 * np.pi * 1.9 * rate[::-1] * time_s)
    return np.asarray(HOME_RAD + SIZES_RAD * wave * np.minimum(time_s, 1.0))


def recorded(model: Any, asked: Array) -> Array:
    """Return (t, 6) angles of the arm with the hidden friction, which begins at rest under the first command."""
    data, parts = mujoco.MjData(model), round(SAMPLE_S / STEP_S)
    data.qpos[:] = data.ctrl[:] = asked[0]
    for _ in range(round(2.0 / STEP_S)):
        mujoco.mj_step(model, data)
    found = [data.qpos.copy()]
    for before, after in pairwise(asked):
        for part in range(parts):
            data.ctrl[:] = before + (after - before) * part / parts
            friction = -MOMENT_N_M * np.tanh(data.qvel[HIDDEN] / SPEED_RAD_S)
            data.qfrc_applied[HIDDEN] = friction
            mujoco.mj_step(model, data)
        found.append(data.qpos.copy())
    return np.array(found)


def write_study(folder: Path, runs: int, length_s: float) -> Path:
    """Write MJCF, recording and study; return the study."""
    (folder / "arm.xml").write_text(arm_xml(), encoding="utf-8")
    model = mujoco.MjModel.from_xml_string(arm_xml())
    model.opt.integrator, model.opt.timestep = mujoco.mjtIntegrator.mjINT_RK4, STEP_S
    noise = np.random.default_rng(3)
    heads = [*(f"{name}_command_rad" for name in JOINTS), *(f"{name}_angle_rad" for name in JOINTS)]
    with (folder / "bench.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["run", "time_s", *heads])
        for run in range(runs):
            asked = commands(run, length_s)
            read = recorded(model, asked) + noise.normal(0.0, NOISE_RAD, asked.shape)
            for k, row in enumerate(np.hstack([asked, read])):
                writer.writerow([f"run_{run + 1}", f"{k * SAMPLE_S:.2f}", *(f"{v:.6g}" for v in row)])
    study = folder / "arm.yaml"
    study.write_text(
        "pliant: 1\nname: six-joint-arm\nmodel: {kind: mjcf, file: arm.xml}\nmeasurements: {file: bench.csv}\n",
        encoding="utf-8",
    )
    return study


def stage_of(hypothesis: str) -> str:
    """Return the stage of the diagnosis that reports this hypothesis."""
    if hypothesis == "nothing":
        return "reading, screening"
    if " + " in hypothesis or "," in hypothesis:
        return "sets, forms"
    return "effects at single places" if "@" in hypothesis else "single effects"


def timed(study: Path, workers: int) -> tuple[Diagnosis, dict[str, dict[str, float]]]:
    """Return the diagnosis, and its seconds and CPU seconds by stage."""
    stages: dict[str, dict[str, float]] = {}
    at = [time.perf_counter(), time.process_time()]

    def note(stage: str) -> None:
        now = [time.perf_counter(), time.process_time()]
        row = stages.setdefault(stage, {"hypotheses": 0, "wall_s": 0.0, "cpu_s": 0.0})
        row["hypotheses"] += 1
        row["wall_s"] += now[0] - at[0]
        row["cpu_s"] += now[1] - at[1]
        at[:] = now

    opened = api.open_study(study, store=study.parent / "store")
    model = api.predictor(opened)
    found = diagnose(model, tick=lambda hypothesis: note(stage_of(hypothesis)), workers=workers)
    note("verdict, next run")
    return found, stages


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the times of the stages and the verdict."""
    parser = make_parser(__doc__)
    parser.add_argument("--runs", type=int, default=8)
    parser.add_argument("--length", type=float, default=10.0, help="of a run, s")
    parser.add_argument("--workers", type=int, default=1, help="processes; 1: threads of this one")
    given = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        study = write_study(Path(folder), given.runs, given.length)
        found, stages = timed(study, given.workers)
    print(f"{'stage':28}{'reported':>10}{'wall s':>10}{'CPU s':>10}")
    total = {key: sum(row[key] for row in stages.values()) for key in ("hypotheses", "wall_s", "cpu_s")}
    for stage, row in [*stages.items(), ("whole", total)]:
        print(f"{stage:28}{row['hypotheses']:10.0f}{row['wall_s']:10.1f}{row['cpu_s']:10.1f}")
    named = {
        " + ".join(k) or "nothing": round(p, 3) for k, p in found.judgement.probability.items() if p > 0.01
    }
    kinds = sum(len(one) == 1 for one in found.fits)
    print(
        f"{kinds} effects; {found.verdict}: {named}; next to the noise: {found.left_out_ratio(found.explained):.2f}"
    )
    print(f"bar {BAR_S:g} s wall on two idle cores: {'reached' if total['wall_s'] <= BAR_S else 'MISSED'}")
    data = {
        "stages": stages,
        "verdict": found.verdict,
        "probability": named,
        "effects": kinds,
        "whole": total,
    }
    OUT.mkdir(parents=True, exist_ok=True)
    write_atomically(OUT / "six_joint_arm.json", json.dumps(data, indent=1))


if __name__ == "__main__":
    main()
