"""From an MJCF and a recording to the missing effect, through Pliant's Python interface."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
from tests.pliant_mjcf.mjcf_models import ARM

import pliant

KINDS = ("actuation_gain", "input_offset", "supply_lag", "sensor_scale")


def record(file: Path, gain: float, sd_rad: float = 0.002) -> None:
    """Write runs of an arm whose motors give another torque, computed by another integrator with a small step."""
    model = mujoco.MjModel.from_xml_string(ARM.format(step=0.0005, integrator="RK4", gain=gain))
    noise, parts = np.random.default_rng(3), 40
    lines = ["run,time_s,shoulder_n_m,elbow_n_m,shoulder_angle_deg,elbow_angle_rad"]
    for run in range(3):
        data, time = mujoco.MjData(model), np.arange(0.0, 3.0, 0.02)
        torque = np.stack(
            [
                1.4 * np.sin(2.0 * np.pi * (0.4 + 0.1 * run) * time),
                0.25 * np.sin(2.0 * np.pi * (0.7 + 0.1 * run) * time),
            ],
            axis=1,
        )
        for k, t in enumerate(time):
            read = data.qpos + noise.normal(0.0, sd_rad, 2)
            numbers = (t, *torque[k], np.degrees(read[0]), read[1])
            lines.append(",".join([f"run_{run}", *(f"{one:.7g}" for one in numbers)]))
            for j in range(parts if k + 1 < len(time) else 0):
                data.ctrl[:] = torque[k] + (torque[k + 1] - torque[k]) * j / parts
                mujoco.mj_step(model, data)
    file.write_text("\n".join(lines) + "\n")


def test_a_hidden_gain_is_named(tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text(ARM.format(step=0.002, integrator="implicitfast", gain=1))
    record(tmp_path / "bench.csv", gain=0.85)
    arm = pliant.MjcfModel(tmp_path / "arm.xml", store=tmp_path / "store")
    compared = arm.compare(tmp_path / "bench.csv")
    assert compared.rmse_over_floor > 3.0
    found = arm.diagnose(tmp_path / "bench.csv", effects=KINDS)
    assert found.verdict == "missing_effect"
    assert found.record.explained and "actuation_gain" in str(found)
    improved = arm.improve(tmp_path / "bench.csv", effects=KINDS)
    assert "actuation_gain" in improved.to_frame()["added"].tolist()


def test_numbers_of_the_file_that_are_slightly_off_are_no_effect(tmp_path: Path) -> None:
    """A gain of 0.996 leaves nine times the noise; a model whose numbers may be off lacks nothing for it."""
    (tmp_path / "arm.xml").write_text(ARM.format(step=0.001, integrator="implicitfast", gain=1))
    record(tmp_path / "bench.csv", gain=0.996, sd_rad=0.0003)
    found = {}
    for error in (0.005, 0.0):
        arm = pliant.MjcfModel(tmp_path / "arm.xml", number_error=error, store=tmp_path / "store")
        found[error] = arm.diagnose(tmp_path / "bench.csv", effects=KINDS)
    # without repeats the noise is not known, so that it is not "nothing missing" either
    assert found[0.005].verdict == "insufficient_data" and found[0.0].verdict == "missing_effect"


def test_errors_of_the_numbers_are_said_to_explain_the_error(tmp_path: Path) -> None:
    """With a stated sigma, nothing is missing: the numbers explain an error that is well above the noise."""
    (tmp_path / "arm.xml").write_text(ARM.format(step=0.001, integrator="implicitfast", gain=1))
    record(tmp_path / "bench.csv", gain=0.996, sd_rad=0.0003)
    sigma = dict.fromkeys(("shoulder_angle_rad", "elbow_angle_rad"), "0.0003 rad")
    arm = pliant.MjcfModel(tmp_path / "arm.xml", store=tmp_path / "store")
    measured = arm.with_({"measurements": {"file": str(tmp_path / "bench.csv"), "sigma": sigma}})
    found = measured.diagnose(effects=KINDS)
    assert found.verdict == "nothing_missing"
    sentence = found.record.judgement.sentence
    assert "at most 0.5 % in the model's own numbers" in sentence and "9.18" in sentence
