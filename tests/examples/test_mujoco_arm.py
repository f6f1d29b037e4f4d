"""The example of a MuJoCo model: a reproducible recording, the hidden effect is named, the improved MJCF is right."""

from __future__ import annotations

import json
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from tests.command import called

pytest.importorskip("mujoco")
FOLDER = Path(__file__).parents[2] / "examples" / "mujoco_arm"
HIDDEN = "coulomb_friction@shoulder"
TRIED = ("coulomb_friction", "viscous_damping", "actuation_gain", "payload")


@pytest.fixture
def arm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the study in a copy of its folder, where the command works."""
    folder = tmp_path / "arm"
    shutil.copytree(FOLDER, folder)
    monkeypatch.chdir(folder)
    return folder / "arm.yaml"


def test_the_study_is_short_and_the_recording_is_what_the_script_makes(arm: Path) -> None:
    assert len(arm.read_text().splitlines()) <= 15
    kept = (arm.parent / "bench.csv").read_text().splitlines()
    (arm.parent / "bench.csv").unlink()
    runpy.run_path(str(arm.parent / "make.py"), run_name="__main__")
    made = (arm.parent / "bench.csv").read_text().splitlines()
    assert made[0] == kept[0] and len(made) == len(kept) == 2001
    for one, other in zip(made[1:], kept[1:], strict=True):
        (run, *numbers), (same, *wanted) = one.split(","), other.split(",")
        assert run == same
        assert [float(x) for x in numbers] == pytest.approx([float(x) for x in wanted], abs=1e-3)


def test_the_diagnosis_names_kind_and_joint_and_the_improved_mjcf_has_it(arm: Path) -> None:
    options = [word for kind in TRIED for word in ("--effect", kind)]
    called("diagnose", arm, *options, "--json", "found.json").done()
    found = json.loads(Path("found.json").read_text())
    assert found["verdict"] == "missing_effect" and found["hypotheses"][0]["kinds"] == [HIDDEN]
    called("extend", arm, "--effect", HIDDEN, "--out", "better.yaml").done()
    said = called("export", "better.yaml", "--out", "arm_improved.xml").done().out
    assert f"{HIDDEN}: joint shoulder" in said and "it does what the study predicts" in said
    line = next(one for one in Path("arm_improved.xml").read_text().splitlines() if 'name="shoulder"' in one)
    assert float(line.partition('frictionloss="')[2].partition('"')[0]) == pytest.approx(0.9, rel=0.03)
    done = subprocess.run(
        [sys.executable, "arm_improved.py", "--check"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout.strip()) == (0, "It does what the study predicts.")
