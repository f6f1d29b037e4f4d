"""An exported grasp in plain MuJoCo: the same scene and the same lift of the egg, in a process without Pliant."""

from __future__ import annotations

import json
from pathlib import Path

import mujoco
import numpy as np
import pytest
from tests.exporting.alone import run_alone
from tests.tasks.conftest import built, finger  # noqa: F401

from pliant.records.chain import ChainModel
from pliant_plugins.tasks.grasp.config import GraspConfig
from pliant_plugins.tasks.grasp.episode import phases, play
from pliant_plugins.tasks.grasp.task import Grasp

CONFIG = GraspConfig.model_validate({"pressure": "15 kPa", "object": "egg"})
REPLAY = """
import json, mujoco, grip_law
model, data = grip_law.load()
inputs = [k for k in range(model.nu) if model.actuator(k).name.endswith("pressure_pa")]
up, step_s = model.actuator("carriage_z").id, model.opt.timestep
for duration, velocity, pressure in json.load(open("commands.json")):
    data.ctrl[inputs], data.ctrl[up] = pressure, velocity
    count = max(1, round(duration / step_s))
    model.opt.timestep = duration / count
    for _ in range(count):
        mujoco.mj_step(model, data)
said = [list(data.body("object_0").xpos), [float(data.joint(f"arm_0_joint_{k}").qpos[0]) for k in range(1, 7)]]
"""


def test_the_file_holds_the_scene_at_rest(finger: ChainModel, tmp_path: Path) -> None:  # noqa: F811
    scene = Grasp(CONFIG).scene(finger)
    files = built("physics", "mujoco").export_scene(scene, tmp_path / "grip.xml")
    assert [file.name for file in files] == ["grip.xml", "grip_law.py"]
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "grip.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with built("physics", "mujoco").build_scene(scene) as simulation:
        for k in range(len(scene.arms)):
            np.testing.assert_allclose(data.site(f"arm_{k}_tip").xpos, simulation.markers(k)[-1], atol=1e-12)
    np.testing.assert_allclose(data.body("object_0").xpos, scene.objects[0].position_m, atol=1e-12)
    assert model.body("object_0").mass[0] == pytest.approx(scene.objects[0].mass.mass_kg)
    # driven by its actuator the carriage has its velocity at once, and the fingers move with it
    data.ctrl[model.actuator("carriage_z").id] = -0.05
    for _ in range(10):
        mujoco.mj_step(model, data)
    assert data.joint("carriage_z").qvel[0] == pytest.approx(-0.05, rel=1e-6)


@pytest.mark.slow
def test_the_egg_is_lifted_as_in_pliant(finger: ChainModel, tmp_path: Path) -> None:  # noqa: F811
    engine, task = built("physics", "mujoco"), Grasp(CONFIG)
    scene = task.scene(finger)
    engine.export_scene(scene, tmp_path / "grip.xml")
    full = CONFIG.actuation(finger)["pressure_pa"]
    commands = [(d, p.velocity_m_s[2], share * full) for p in phases(CONFIG) for d, share, _ in p.steps()]
    (tmp_path / "commands.json").write_text(json.dumps(commands))
    with engine.build_scene(scene) as simulation:
        end = play(simulation, CONFIG, {"pressure_pa": full}).states[-1]
    place, angles = run_alone(REPLAY, tmp_path)
    away = np.linalg.norm(place - end.positions_m[0])
    print(
        f"the egg ends {1e3 * away:.2f} mm from where it does in Pliant, {1e3 * end.positions_m[0, 2]:.1f} mm high"
    )
    assert end.positions_m[0, 2] - scene.objects[0].position_m[2] > 0.05
    assert away < 1e-3
    np.testing.assert_allclose(angles, end.coordinates[0].ravel(), atol=5e-3)
