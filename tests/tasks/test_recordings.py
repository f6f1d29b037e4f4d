"""Recorded runs through `follow_pressure`: the evidence loop's error, and recovered damping and inertia."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pliant import api
from pliant.errors import UserError
from pliant.records.design import Array
from pliant_plugins.effects.inertia import lumped_inertia
from pliant_plugins.tasks.follow_pressure import FollowPressureConfig

REAL = Path(__file__).parents[3] / "shared/data/measured/two_bellow_bending.csv"
STUDY = """
pliant: 1
name: swinging
surrogate: {{kind: polynomial, form: study, odd: true, coefficients: {{k_n: 2.0e-6, m_a: -1e-6, m_e: 0.02, b_e: 0.1}}}}
chain:
  modules: 1
  module_length: 70 mm
  module_mass: 33.2 g
  payload: {payload}
  gravity: [0, 0, 0]
  actuators: [{{input: pressure_1_pa, sign: 1}}, {{input: pressure_2_pa, sign: -1}}]
physics: {physics}
effects: {effects}
task: {{kind: follow_pressure, {task}}}
measurements: {{file: {file}, outputs: [angle_rad]}}
"""
DAMPED = "[{kind: viscous_damping, time: 0.3 s}, {kind: sensor_bias, bias: 0.01 rad}]"


def study(folder: Path, **said: str) -> api.OpenStudy:
    said = {"physics": "quasistatic", "payload": "0 g", "effects": "[]", "file": "run.csv", **said}
    said.setdefault("task", f"recording: {{file: {said['file']}}}")
    path = folder / "study.yaml"
    path.write_text(STUDY.format(**said))
    return api.open_study(path, store=folder / "store")


def record(folder: Path, time_s: Array, pressure: Array, angle: Array) -> Path:
    with (folder / "run.csv").open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["time_s", "pressure_1_pa", "pressure_2_pa", "angle_rad"])
        rows.writerows(zip(time_s, pressure, 0.0 * pressure, angle, strict=True))
    return folder / "run.csv"


def pulses(count: int, period_s: float) -> tuple[Array, Array]:
    """Return a pressure that comes and goes, 40 kPa."""
    time_s = np.linspace(0.0, 3.0 * period_s, count)
    return time_s, np.where(
        (time_s % period_s > 0.1 * period_s) & (time_s % period_s < 0.6 * period_s), 4e4, 0.0
    )


def moved(opened: api.OpenStudy) -> Array:
    """Return the (t,) angle of the study's motion."""
    rollout = api.simulate(opened).engines[0].artifact.value.rollout
    return np.asarray(rollout.joint_angles.sum(axis=(1, 2)))


def metrics(opened: api.OpenStudy) -> dict[str, Any]:
    return dict(api.simulate(opened).engines[0].artifact.value.metrics)


def test_a_recording_made_by_the_model_leaves_no_error(tmp_path: Path) -> None:
    """Sensors are modelled, and without the damper the error is the evidence loop's."""
    time_s, pressure = pulses(120, 2.0)
    record(tmp_path, time_s, pressure, 0.0 * time_s)
    record(tmp_path, time_s, pressure, 0.01 + moved(study(tmp_path, effects=DAMPED)))
    assert metrics(study(tmp_path, effects=DAMPED))["angle_rmse_rad"] < 1e-12
    bare = study(tmp_path)
    error = api.compare(bare).outputs["angle_rad"].rmse
    assert error > 0.02
    assert metrics(bare)["angle_rmse_rad"] == pytest.approx(error, rel=1e-6)


@pytest.mark.slow
@pytest.mark.skipif(not REAL.is_file(), reason="../shared/data/measured is not there")
def test_real_runs_have_the_evidence_loop_s_error(tmp_path: Path) -> None:
    """The first minute of a measured run of two bellows, with the effects that `improve` found: within 2 %."""
    with REAL.open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["run"] == "7V"][:750]
    names = ("time_s", "pressure_1_pa", "pressure_2_pa", "bend_angle_rad")
    columns = [np.array([float(row[name]) for row in rows]) for name in names]
    with (tmp_path / "run.csv").open("w", newline="") as file:
        table = csv.writer(file)
        table.writerows([[*names[:3], "angle_rad"], *zip(*columns, strict=True)])
    found = (
        "[{kind: viscous_damping, time: 1.42 s}, {kind: sensor_bias, bias: -0.023 rad}, "
        "{kind: viscoelastic, share: 0.085, time: 22 s}]"
    )
    opened = study(tmp_path, effects=found)
    error = api.compare(opened).outputs["angle_rad"].rmse
    assert metrics(opened)["angle_rmse_rad"] == pytest.approx(error, rel=0.02)


@pytest.mark.slow
def test_damping_and_inertia_come_back_from_a_recording(tmp_path: Path) -> None:
    """MuJoCo's own masses and drag, recorded, are found by `extend` as `inertia`: scale 1, and ζ = drag / 2 ω."""
    time_s, pressure = pulses(600, 1.0)
    record(tmp_path, time_s, pressure, 0.0 * time_s)
    drag = 6.0
    physics = f"{{kind: mujoco, drag_1: {drag}, joint_damping: 0, timestep: 0.1 ms}}"
    hidden = study(tmp_path, physics=physics, payload="100 g")
    noise = np.random.default_rng(1).normal(0.0, 1e-3, len(time_s))
    record(tmp_path, time_s, pressure, moved(hidden) + noise)
    opened = study(tmp_path, payload="100 g")
    found = api.extend(opened, ["inertia"])
    omega = np.sqrt(0.1 / lumped_inertia(api.predictor(opened).chain)[0])
    assert found.values["inertia.scale"] == pytest.approx(1.0, abs=0.02)
    assert found.values["inertia.damping_ratio"] == pytest.approx(drag / (2 * omega), rel=0.05)


@pytest.mark.parametrize(
    ("task", "said"),
    [
        ("recording: {file: run.csv, run: other}", "names run 'other'"),
        ("recording: {file: run.csv, outputs: [tip_x_m]}", "has no tip_x_m"),
    ],
)
def test_what_is_not_in_the_file_is_said(tmp_path: Path, task: str, said: str) -> None:
    time_s, pressure = pulses(20, 1.0)
    record(tmp_path, time_s, pressure, 0.0 * time_s)
    with pytest.raises(UserError, match=said):
        api.simulate(study(tmp_path, task=task))


def test_a_recording_leaves_no_room_for_a_waveform() -> None:
    with pytest.raises(ValueError, match="leave pressure_pa, waveform out"):
        FollowPressureConfig.model_validate(
            {"recording": {"file": "run.csv"}, "pressure": "1 kPa", "waveform": "sine"}
        )
