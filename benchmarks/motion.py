"""Motion in time: a beam's frequencies, PyElastica's rod, damping from a recording, measured runs by `follow_pressure`.

python -m benchmarks.motion [--picture]       prints, and writes benchmarks/out/motion.json

The runs are of two bellows, in ../shared/data/measured (left out where absent), with the effects that `improve` found
on 7V (docs/what_real_data_taught_us.md) and a law fitted to 7V with them in place; `compare` is the evidence loop.
"""

from __future__ import annotations

import csv
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.output import ROOT, Bar, engine, make_parser, write
from benchmarks.real.recordings import missing, read_runs, write_rows
from scipy.linalg import eigh

from pliant import api
from pliant.interfaces.effect import Model
from pliant.mechanics.inertia import mass_matrix
from pliant.pipeline.simulate import run_task
from pliant.records.chain import ChainModel, Joint, default_base_rotation
from pliant.records.design import Array, MassProperties
from pliant.records.rollout import Rollout, TaskResult
from pliant.testing.samples import linear_law
from pliant_plugins.effects.inertia import lumped_inertia
from pliant_plugins.tasks.follow_pressure import FollowPressure, FollowPressureConfig
from pliant_plugins.tasks.responses import step_response, swings

LENGTH_M, FLEXURAL_N_M2, LINE_KG_M = 0.3, 2e-3, 0.1
# Roots of cos x cosh x = −1: a beam clamped at one end (Timoshenko, Vibration Problems in Engineering).
ROOTS = np.array([1.8751041, 4.6940911])
BEAM_HZ = ROOTS**2 / (2 * np.pi * LENGTH_M**2) * np.sqrt(FLEXURAL_N_M2 / LINE_KG_M)
# A step compared with PyElastica's rod, with damping in proportion to mass.
STEP_PA, STEP_DRAG_1_S, RECORD_S = 5e3, 2.0, 4e-3
RUNS, TRAINING = ("two_bellow_bending.csv", "two_bellow_bending_more.csv"), "7V"
FOUND = (
    "[{kind: viscous_damping, time: 1.42 s}, {kind: sensor_bias, bias: -0.023 rad}, "
    "{kind: viscoelastic, share: 0.085, time: 22 s}, {kind: bimodulus, asymmetry: -0.037}, "
    "{kind: sensor_scale, excess: 0.034}]"
)
LAW = "{k_n: 2.0e-6, m_a: -1.0e-6, m_e: 0.2, b_e: 0.1}"
STUDY = """
pliant: 1
name: in-motion
surrogate: {{kind: polynomial, form: study, odd: true, coefficients: {law}}}
chain:
  modules: 1
  module_length: 70 mm
  module_mass: 33.2 g
  payload: {payload}
  gravity: [0, 0, 0]
  actuators: [{{input: pressure_1_pa, sign: 1}}, {{input: pressure_2_pa, sign: -1}}]
physics: {physics}
effects: {effects}
task: {{kind: follow_pressure, recording: {{file: {file}, outputs: [angle_rad]}}}}
measurements: {{file: {file}, outputs: [angle_rad]}}
"""


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--picture", action="store_true", help="draw docs/pictures/in_motion.png")
    asked = parser.parse_args()
    order, missed = convergence()
    swung = released()
    hz = np.array([swung.metrics[f"mode_{k}_frequency_hz"] for k in (1, 2)])
    print(f"beam: {BEAM_HZ} Hz; 32 modules miss them by {100 * missed} %, order of convergence {order}")
    print(f"released in MuJoCo: {hz} Hz, {100 * (hz / BEAM_HZ - 1.0)} % off")
    bars = [
        Bar(
            "a beam's first two frequencies by 32 modules", float(np.abs(missed).max()), 0.01, "%", scale=100
        ),
        Bar("the same, released in MuJoCo", float(np.abs(hz / BEAM_HZ - 1.0).max()), 0.01, "%", scale=100),
    ]
    rod = beside_a_rod(hz)
    if rod:
        rod_hz = np.array([rod["mode_1_hz"], rod["mode_2_hz"]])
        print(f"PyElastica's rod of 32 bends: {rod_hz} Hz, {100 * (rod_hz / BEAM_HZ - 1.0)} % off the beam")
        print(
            f"step to {rod['end_rad']:.3f} rad, drag {STEP_DRAG_1_S} 1/s: the chain in MuJoCo is "
            f"{100 * rod['rms_of_span']:.2f} % of it off the rod (root mean square), "
            f"{100 * rod['worst_of_span']:.1f} % at worst; "
            f"rise {rod['chain_rise_s']:.4f} and {rod['rod_rise_s']:.4f} s, overshoot "
            f"{100 * rod['chain_overshoot']:.1f} and {100 * rod['rod_overshoot']:.1f} %"
        )
        apart = float(np.abs(hz / rod_hz - 1.0).max())
        bars.append(Bar("the chain's first two frequencies from the rod's", apart, 0.01, "%", scale=100))
        bars.append(Bar("its answer to a step from the rod's", rod["rms_of_span"], 0.02, "%", scale=100))
    else:
        print("PyElastica is not installed: no rod beside it (pip install 'pliant[peers]')")
    with tempfile.TemporaryDirectory() as place:
        identified = damping_and_inertia(Path(place))
        told = ", ".join(
            f"{name} {found:.4g} (hidden {hidden:.4g})" for name, (found, hidden) in identified.items()
        )
        print(f"from MuJoCo's motion, recorded with noise: {told}")
        runs = {} if missing(*RUNS) else measured_runs(Path(place))
        if runs:
            bars.append(
                Bar(
                    "measured runs: error of the task / of the evidence loop − 1",
                    max(abs(one["task_rad"] / one["compare_rad"] - 1.0) for one in runs.values()),
                    0.02,
                    "%",
                    scale=100,
                )
            )
        for name, one in runs.items():
            print(f"{name}: compare {one['compare_rad']:.5f} rad, follow_pressure {one['task_rad']:.5f} rad")
        if asked.picture and runs:
            draw(swung, runs["9V"])
    numbers = {name: {k: v for k, v in one.items() if isinstance(v, float)} for name, one in runs.items()}
    write(
        "motion",
        {
            "beam_hz": BEAM_HZ.tolist(),
            "order": order.tolist(),
            "identified": identified,
            "rod": rod,
            "runs": numbers,
        },
        bars,
    )


def beam(n: int, gain: float = 1e-6) -> ChainModel:
    """Return a slender rod of n modules without gravity; joints bend under pressure, stiffness EI / l each."""
    piece, along = LENGTH_M / n, np.array([1.0, 0.0, 0.0])

    def rod(length: float) -> MassProperties:
        mass = LINE_KG_M * length
        across = mass * length**2 / 12
        return MassProperties(mass, along * length / 2, np.diag([1e-3 * across, across, across]))

    return ChainModel(
        joints=tuple(Joint(0, along * (piece if i else piece / 2), np.eye(3)) for i in range(n)),
        bodies=(rod(piece / 2), *[rod(piece)] * (n - 1), rod(piece / 2)),
        laws=(linear_law(gain=gain, stiffness=FLEXURAL_N_M2 / piece),),
        tip_offset_m=along * piece / 2,
        base_position_m=np.zeros(3),
        base_rotation=default_base_rotation(),
        gravity_m_s2=np.zeros(3),
    )


def frequencies_hz(n: int) -> Array:
    """Return the first two frequencies of small swings about the straight chain."""
    chain = beam(n)
    stiffness = FLEXURAL_N_M2 / (LENGTH_M / n) * np.eye(n)
    squares = eigh(stiffness, mass_matrix(chain, np.zeros((n, 1))), eigvals_only=True)
    return np.asarray(np.sqrt(squares[:2]) / (2 * np.pi))


def convergence() -> tuple[Array, Array]:
    """Order at 16 and 32 modules (2,), and the share by which 32 modules miss the beam's frequencies (2,)."""
    missed = np.array([frequencies_hz(n) / BEAM_HZ - 1.0 for n in (16, 32)])
    return np.log2(missed[0] / missed[1]), missed[1]


def released() -> TaskResult:
    """Release the beam of 32 modules from the bend of a small pressure, in MuJoCo without added damping."""
    config = FollowPressureConfig.model_validate(
        {"pressure": "100 Pa", "waveform": "release", "duration": "4 s", "record": "4 ms"}
    )
    moves = engine("mujoco", timestep="0.5 ms", joint_damping=0.0, drag_1=0.0)
    return run_task(moves, FollowPressure(config), (), beam(32))


def beside_a_rod(chain_hz: Array) -> dict[str, float]:
    """Compare with PyElastica's rod, released and bent by a step; {} if it is not installed.

    Of the rod's modes, fast ones among them that no engine here follows, those nearest to the chain's.
    """
    if find_spec("elastica") is None:
        return {}
    from benchmarks.physics.swinging_rod import SlenderRod, swing

    rod = SlenderRod(LENGTH_M, FLEXURAL_N_M2, LINE_KG_M, 32)
    per_pa = 1e-6 / FLEXURAL_N_M2  # curvature, by the gain of `beam`
    free = swing(rod, 100.0 * per_pa, 0.0, 4.0, RECORD_S)
    modes = np.array([hz for hz, _ in swings(RECORD_S, free.angle)])
    nearest = [float(modes[np.argmin(np.abs(modes - hz))]) for hz in chain_hz]
    stepped = swing(rod, 0.0, STEP_PA * per_pa, 4.0, RECORD_S, STEP_DRAG_1_S)
    config = FollowPressureConfig(pressure_pa=STEP_PA, waveform="step", duration_s=4.0, record_s=RECORD_S)
    moves = engine("mujoco", timestep="0.5 ms", joint_damping=0.0, drag_1=STEP_DRAG_1_S)
    chain = run_task(moves, FollowPressure(config), (), beam(32))
    assert chain.rollout is not None
    bend, end = chain.rollout.joint_angles.sum(axis=(1, 2)), per_pa * STEP_PA * LENGTH_M
    apart = np.interp(chain.rollout.time_s, stepped.time_s, stepped.angle) - bend
    answers = {"chain": step_response(chain.rollout.time_s, bend)}
    answers["rod"] = step_response(stepped.time_s, stepped.angle)
    return {
        "mode_1_hz": nearest[0],
        "mode_2_hz": nearest[1],
        "end_rad": end,
        "rms_of_span": float(np.sqrt(np.mean(apart**2))) / end,
        "worst_of_span": float(np.abs(apart).max()) / end,
        **{f"{who}_rise_s": answer["rise_time_s"] for who, answer in answers.items()},
        **{f"{who}_overshoot": answer["overshoot_share"] for who, answer in answers.items()},
    }


def study(folder: Path, **said: str) -> api.OpenStudy:
    """Write and open the study of the joint with two chambers in a separate folder."""
    said = {
        "physics": "quasistatic",
        "effects": "[]",
        "payload": "0 g",
        "law": LAW,
        "file": "run.csv",
        **said,
    }
    path = folder / "study.yaml"
    path.write_text(STUDY.format(**said))
    return api.open_study(path, store=folder / "store")


def motion(opened: api.OpenStudy) -> tuple[Rollout, dict[str, Any]]:
    """Simulate the study's task; return its rollout and metrics."""
    made = api.simulate(opened).engines[0].artifact
    assert made is not None
    result = made.value
    return result.rollout, dict(result.metrics)


def record(path: Path, time_s: Array, pressure: Array, angle: Array) -> None:
    """Write a measurement file of one chamber's pressure and the angle."""
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["time_s", "pressure_1_pa", "pressure_2_pa", "angle_rad"])
        rows.writerows(zip(time_s, pressure, 0.0 * pressure, angle, strict=True))


def damping_and_inertia(folder: Path, drag: float = 6.0) -> dict[str, tuple[float, float]]:
    """Return (found, hidden) of each parameter that `extend` fits to a motion of MuJoCo's with noise of 1 mrad."""
    time_s = np.linspace(0.0, 3.0, 600)
    pressure = np.where((time_s % 1.0 > 0.1) & (time_s % 1.0 < 0.6), 4e4, 0.0)
    record(folder / "run.csv", time_s, pressure, 0.0 * time_s)
    physics = f"{{kind: mujoco, drag_1: {drag}, joint_damping: 0, timestep: 0.1 ms}}"
    rollout, _ = motion(study(folder, physics=physics, payload="100 g"))
    noise = np.random.default_rng(1).normal(0.0, 1e-3, len(time_s))
    record(folder / "run.csv", time_s, pressure, rollout.joint_angles.sum(axis=(1, 2)) + noise)
    opened = study(folder, payload="100 g")
    values = api.extend(opened, ["inertia"]).values
    omega = float(np.sqrt(0.1 / lumped_inertia(api.predictor(opened).chain)[0]))
    return {
        "inertia.scale": (float(values["inertia.scale"]), 1.0),
        "inertia.damping_ratio": (float(values["inertia.damping_ratio"]), drag / (2 * omega)),
    }


def measured_runs(folder: Path) -> dict[str, dict[str, Any]]:
    """Return, by run, the error of `compare` and of the task, and the motion."""
    for name, rows in read_runs(RUNS).items():
        renamed = [{("angle_rad" if k == "bend_angle_rad" else k): v for k, v in row.items()} for row in rows]
        write_rows(folder / f"{name}.csv", renamed)
    fitted = api.fit_stated_law(study(folder, effects=FOUND, file=f"{TRAINING}.csv"), held=["b_e"])
    law = fitted.yaml().partition(": ")[2]
    found = {}
    for name in ("7V", "12V", "9V", "7V_again"):
        opened = study(folder, effects=FOUND, law=law, file=f"{name}.csv")
        error = api.compare(opened).outputs["angle_rad"].rmse
        rollout, metrics = motion(opened)
        read = np.genfromtxt(folder / f"{name}.csv", delimiter=",", names=True)["angle_rad"]
        found[name] = {
            "compare_rad": float(error),
            "task_rad": metrics["angle_rmse_rad"],
            "seen": seen_angle(opened, rollout),
            "time_s": rollout.time_s,
            "read": read,
        }
    return found


def seen_angle(opened: api.OpenStudy, rollout: Rollout) -> Array:
    """Return (t,) readings of the motion's angle by the sensors of the study's effects."""
    model = Model(api.predictor(opened).chain)
    for effect in opened.study.effects:
        model = opened.context.build("effect", effect).apply(model)
    true = rollout.joint_angles.sum(axis=(1, 2))
    said = {"angle_rad": true, "time_s": rollout.time_s, "actuation": rollout.actuation.sum(axis=1)}
    return np.asarray(model.reported(said)["angle_rad"])


def draw(swung: TaskResult, run: dict[str, Any]) -> None:
    """Draw a released beam, and a measured run that was not fitted."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.4), width_ratios=(1, 1.5))
    assert swung.rollout is not None
    bend = np.degrees(swung.rollout.joint_angles.sum(axis=(1, 2)))
    left.plot(swung.rollout.time_s, bend, color="#2f6fb0", lw=1.0)
    left.set_title(
        f"32 modules let go: {swung.metrics['mode_1_frequency_hz']:.3f} Hz", loc="left", fontsize=10
    )
    left.set_ylabel("bend (°)")
    time_s = run["time_s"]
    right.plot(time_s, run["read"], color="black", lw=1.2, label="measured, 9V")
    right.plot(time_s, run["seen"], color="#2f6fb0", lw=1.0, label="follow_pressure, fitted on 7V")
    right.set_title(f"two bellows: {run['task_rad']:.4f} rad off (root mean square)", loc="left", fontsize=10)
    right.set_ylabel("bending angle (rad)")
    right.legend(frameon=False, fontsize=8)
    for panel in (left, right):
        panel.set_xlabel("time (s)")
        panel.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    figure.savefig(ROOT / "docs" / "pictures" / "in_motion.png", dpi=110)
    plt.close(figure)


if __name__ == "__main__":
    main()
