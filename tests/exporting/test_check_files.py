"""The check file of each export, replayed without Pliant by the program that the export is for."""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.cli.test_export import BELLOW
from tests.command import called
from tests.exporting.alone import run_alone
from tests.exporting.test_mujoco_alone import ARM, FINGER, OPPOSED
from tests.exporting.test_written_laws import MAIN

HELIX = Path(__file__).parents[2] / "examples" / "helix" / "helix.yaml"
MOUNTED = FINGER.replace("modules: 8,", "base: {mount: {file: arm.xml, at: flange}}, modules: 8,").replace(
    "task:", "physics: mujoco\ntask:"
)
GRASP = FINGER.replace("modules: 8", "modules: 6").replace(
    "{kind: tip_load, pressure: 15 kPa, payload: 5 g}", "{kind: grasp, object: egg, pressure: 15 kPa}"
)
needs_pybullet = pytest.mark.skipif(
    importlib.util.find_spec("pybullet") is None, reason="pybullet is not installed"
)


def exported(folder: Path, study: str | Path, name: str, *more: str) -> dict[str, Any]:
    """Export a study there and return the content of its check file."""
    if not isinstance(study, Path):
        (folder / "study.yaml").write_text(study)
        study = folder / "study.yaml"
    called("export", study, "--out", folder / name, "--store", folder / "store", *more).done()
    found: dict[str, Any] = json.loads((folder / f"{name}.check.json").read_text())
    return found


def replayed(folder: Path, module: str, code: int = 0) -> str:
    """Return the output of a written module on its check file, in a process that cannot import Pliant."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    call = subprocess.run(
        [sys.executable, module, "--check"], cwd=folder, env=environment, capture_output=True, text=True
    )
    assert call.returncode == code, call.stdout + call.stderr
    return call.stdout


@pytest.mark.parametrize(
    "study", [FINGER, OPPOSED, HELIX, MOUNTED], ids=["finger", "opposed", "ball joints", "mounted"]
)
def test_mujoco_does_what_the_study_predicts(study, tmp_path) -> None:
    (tmp_path / "arm.xml").write_text(ARM)
    check = exported(tmp_path, study, "robot.xml")
    assert check["pliant_check"] == 1 and check["files"][:2] == ["robot.xml", "robot_law.py"]
    settled = [state for state in check["states"] if state["equilibrium"]]
    assert len(settled) == 3 and any(np.any(state["tip_force_n"]) for state in settled)
    tips = np.array([state["tip_m"] for state in settled])
    assert np.linalg.norm(np.diff(tips, axis=0), axis=1).min() > 20 * check["tolerance"]["tip_m"]
    assert replayed(tmp_path, "robot_law.py") == "It does what the study predicts.\n"


@pytest.mark.parametrize(
    ("file", "old", "new", "says"),
    [
        ("robot.xml", 'gravity="0.0 0.0 -9.81"', 'gravity="0 0 -8"', "the tip settles"),
        ("robot_law.py", "1.637e-06", "1.7e-06", "efforts_of_largest"),
        ("robot.xml", 'name="tip" pos="0.0055', 'name="tip" pos="0.0056', "tip_m"),
        ("robot.xml.check.json", '"states": [', '"states": [], "other": [', "has no states of a robot"),
    ],
)
def test_a_robot_that_acts_otherwise_is_told(file, old, new, says, tmp_path) -> None:
    exported(tmp_path, FINGER, "robot.xml")
    text = (tmp_path / file).read_text()
    assert old in text
    (tmp_path / file).write_text(text.replace(old, new))
    assert says in replayed(tmp_path, "robot_law.py", code=1)


def test_a_scene_has_the_poses_for_each_arm(tmp_path) -> None:
    check = exported(tmp_path, GRASP, "grip.xml", "--part", "scene")
    prefixes = {state["prefix"] for state in check["states"]}
    assert len(prefixes) > 1 and "arm_0_" in prefixes and check["engine"] is None
    assert not any(state["equilibrium"] for state in check["states"])
    assert "predicts" in replayed(tmp_path, "grip_law.py")


# For each state of the file: under the laws' torques the robot stays there.
BULLET = """
import json, numpy as np, pybullet as p
from scipy.spatial.transform import Rotation as R
from read_law import read, outputs
check = json.load(open("robot.urdf.check.json"))
(law,) = [read(name) for name in check["files"] if name.endswith(".json")]
p.connect(p.DIRECT); p.setGravity(0, 0, -9.81); p.setTimeStep(1e-4)
b = p.loadURDF("robot.urdf", useFixedBase=True, flags=p.URDF_USE_INERTIA_FROM_FILE); n = p.getNumJoints(b)
kind = {i: p.getJointInfo(b, i)[2] for i in range(n)}
moving = [i for i in range(n) if kind[i] != p.JOINT_FIXED]
for i in range(-1, n): p.changeDynamics(b, i, linearDamping=0, angularDamping=0, jointDamping=0)
A = {i: R.from_quat(p.getDynamicsInfo(b, i)[4]) for i in moving}
for i in moving:
    if kind[i] == p.JOINT_SPHERICAL:
        p.setJointMotorControlMultiDof(b, i, p.POSITION_CONTROL, targetPosition=[0, 0, 0, 1], positionGain=0,
                                       velocityGain=0, force=[0, 0, 0])
    else: p.setJointMotorControl2(b, i, p.VELOCITY_CONTROL, force=0)
def jr(f):
    t = np.linalg.norm(f); K = np.array([[0, -f[2], f[1]], [f[2], 0, -f[0]], [-f[1], f[0], 0]])
    return np.eye(3) if t < 1e-9 else np.eye(3) - (1 - np.cos(t)) / t**2 * K + (t - np.sin(t)) / t**3 * K @ K
last = next(i for i in range(n) if p.getJointInfo(b, i)[12] == b"tip")
def tip(): return p.getLinkState(b, last, computeForwardKinematics=True)[4]
said = {"laws": [], "states": []}
for point in check["laws"][0]["points"]:
    found = outputs(law, *point["inputs"])
    said["laws"].append(max(abs(np.array(found[k]) - point[k]).max() for k in ("tau", "dtau_dp", "dtau_du")))
for state in check["states"]:
    for i, u in zip(moving, state["coordinates"]):
        if kind[i] == p.JOINT_SPHERICAL:
            p.resetJointStateMultiDof(b, i, R.from_rotvec(A[i].inv().apply(u)).as_quat(), [0, 0, 0])
        else: p.resetJointState(b, i, u[0], 0.0)
    begin, efforts = tip(), []
    for k in range(STEPS):
        for i in moving:
            if kind[i] == p.JOINT_SPHERICAL:
                q, v = p.getJointStateMultiDof(b, i)[:2]
                f = A[i].apply(R.from_quat(q).as_rotvec())
                tau = np.array(outputs(law, *state["inputs"].values(), *f)["tau"])
                torque = A[i].inv().apply(np.linalg.solve(jr(f).T, tau))
                p.setJointMotorControlMultiDof(b, i, p.TORQUE_CONTROL, force=list(torque))
            else:
                tau = np.array(outputs(law, *state["inputs"].values(), p.getJointState(b, i)[0])["tau"])
                p.setJointMotorControl2(b, i, p.TORQUE_CONTROL, force=tau[0])
            if k == 0: efforts.append(list(tau))
        p.applyExternalForce(b, last, state["tip_force_n"], tip(), p.WORLD_FRAME)
        p.stepSimulation()
    said["states"].append([list(begin), efforts, list(tip())])
"""


@needs_pybullet
@pytest.mark.parametrize("study", [FINGER, HELIX], ids=["finger", "ball joints"])
def test_pybullet_does_what_the_study_predicts(study, tmp_path) -> None:
    """Laws at points, poses and efforts at the states, and 40 ms without motion."""
    check = exported(tmp_path, study, "robot.urdf")
    assert len(check["states"]) == 3 and all(state["equilibrium"] for state in check["states"])
    near = check["tolerance"]
    said = run_alone(BULLET.replace("STEPS", "400"), tmp_path)
    largest = max(max(map(abs, point["dtau_du"])) for point in check["laws"][0]["points"])
    assert max(said["laws"]) <= near["law_of_largest"] * largest
    for state, (begin, efforts, end) in zip(check["states"], said["states"], strict=True):
        assert np.linalg.norm(np.subtract(begin, state["tip_m"])) < 1e-6  # floats of PyBullet's kinematics
        np.testing.assert_allclose(efforts, state["efforts"], atol=1e-6)
        assert np.linalg.norm(np.subtract(end, state["tip_m"])) < near["tip_m"]


@pytest.mark.parametrize("form", ["numpy", "torch", "jax"])
@pytest.mark.parametrize("study", [FINGER, HELIX], ids=["one axis", "three axes"])
def test_a_law_in_python_replays_its_own_check(study, form, tmp_path) -> None:
    if importlib.util.find_spec(form) is None:
        if form != "jax":
            pytest.skip(f"{form} is not installed")
        (tmp_path / "jax").mkdir()  # tests the text, not JAX itself
        (tmp_path / "jax" / "__init__.py").write_text("class config:\n    update = lambda *of: None\n")
        (tmp_path / "jax" / "numpy.py").write_text("from numpy import *\nfrom numpy import abs, max, min\n")
    exported(tmp_path, study, "law.py", "--format", form)
    assert "tolerance 1e-09" in replayed(tmp_path, "law.py")
    place = tmp_path / "law.py.check.json"
    check = json.loads(place.read_text())
    check["laws"][0]["points"][3]["tau"][0] *= 1.001
    place.write_text(json.dumps(check))
    assert "off by" in replayed(tmp_path, "law.py", code=1)


def test_a_law_in_torch_takes_single_precision(tmp_path) -> None:
    """Torch's default; numbers of a law that it cannot represent, such as 1e300, are no error."""
    if importlib.util.find_spec("torch") is None:
        pytest.skip("torch is not installed")
    check = exported(tmp_path, FINGER, "law.py", "--format", "torch")
    points = check["laws"][0]["points"]
    said = run_alone(
        "import json, torch, law\n"
        "points = json.load(open('law.py.check.json'))['laws'][0]['points']\n"
        "at = torch.tensor([point['inputs'] for point in points])\n"
        "out = law.law(at[:, 0], at[:, 1:])\n"
        "said = [[str(one.dtype) for one in out], out[0].tolist()]",
        tmp_path,
    )
    assert set(said[0]) == {"torch.float32"}
    np.testing.assert_allclose(said[1], [point["tau"] for point in points], atol=1e-8)


def test_a_law_in_json_by_its_three_lines(tmp_path) -> None:
    check = exported(tmp_path, HELIX, "helix.urdf" if importlib.util.find_spec("pybullet") else "helix.json")
    if not (tmp_path / "read_law.py").is_file():
        pytest.skip("read_law.py stands beside a URDF, for which pybullet is needed")
    near = check["tolerance"]["law_of_largest"]
    said = run_alone(
        "import json; from read_law import outputs, read\n"
        "law, check = read('helix_law.json'), json.load(open('helix.urdf.check.json'))\n"
        "said = [(outputs(law, *p['inputs'])['tau'], p['tau']) for p in check['laws'][0]['points']]",
        tmp_path,
    )
    found, right = np.swapaxes(np.array(said), 0, 1)
    assert np.abs(found - right).max() <= near * np.abs(right).max() and np.abs(right).max() > 0.0


def test_a_law_in_c_gives_its_check_outputs(tmp_path) -> None:
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("there is no C compiler 'cc' on this machine")
    check = exported(tmp_path, HELIX, "the_law.h")
    (law,) = check["laws"]
    points = law["points"]
    m = sum(not name.startswith("angle_") for name in law["inputs"])
    a = len(law["inputs"]) - m
    text = MAIN.replace("law.h", "the_law.h").format(n=len(points), m=m, a=a)
    (tmp_path / "main.c").write_text(text)
    subprocess.run([compiler, "-std=c99", "-O2", "main.c", "-o", "main", "-lm"], cwd=tmp_path, check=True)
    rows = "\n".join(" ".join(map(repr, point["inputs"])) for point in points)
    done = subprocess.run([tmp_path / "main"], input=rows, capture_output=True, text=True, check=True)
    table = np.array([line.split() for line in done.stdout.splitlines()], float)
    start = 0
    for name, width in (("tau", a), ("dtau_dp", a * m), ("dtau_du", a * a)):
        right = np.array([point[name] for point in points])
        off = np.abs(table[:, start : start + width] - right).max() / np.abs(right).max()
        assert off <= check["tolerance"]["law_of_largest"], name
        start += width


def test_surfaces_and_tables_have_no_check_file(tmp_path) -> None:
    """An STL has no law and no motion; the reachable set is the study's own prediction."""
    (tmp_path / "study.yaml").write_text(BELLOW)
    called("export", tmp_path / "study.yaml", "--out", tmp_path / "robot.stl").done()
    assert not list(tmp_path.glob("*.check.json"))
