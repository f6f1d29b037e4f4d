"""The examples of own models: short files, reproducible recordings, and the hidden effect is named."""

from __future__ import annotations

import json
import runpy
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from pliant.cli.verbs import app

FOLDER = Path(__file__).parents[2] / "examples" / "own_model"
# Folder → its model, the library it needs, the hidden effect, and kinds that stand for all candidates.
CASES = {
    "pendulum": ("pendulum.py", "numpy", "state@coulomb", ("parameter@damping", "supply_lag", "sensor_lag")),
    "rod": ("rod.py", "elastica", "supply_lag", ("parameter@stiffness", "parameter@damping", "dead_time")),
    "soromox": (
        "robot.py",
        "soromox",
        "state@sheath_friction",
        ("parameter@stiffness", "supply_lag", "backlash"),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_a_model_has_at_most_40_lines_and_a_study_15(name: str) -> None:
    assert len((FOLDER / name / CASES[name][0]).read_text().splitlines()) <= 40
    assert len((FOLDER / name / "study.yaml").read_text().splitlines()) <= 15


@pytest.mark.parametrize(
    "name", ["pendulum", *(pytest.param(one, marks=pytest.mark.slow) for one in ("rod", "soromox"))]
)
def test_the_recording_is_what_the_script_makes(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip(CASES[name][1])
    folder = tmp_path / name
    shutil.copytree(FOLDER / name, folder)
    (folder / "recording.csv").unlink()
    monkeypatch.chdir(folder)
    monkeypatch.syspath_prepend(str(folder))
    runpy.run_path("make_recording.py")
    made, kept = ((one / "recording.csv").read_text().splitlines() for one in (folder, FOLDER / name))
    assert made[0] == kept[0]
    for one, other in zip(made[1:], kept[1:], strict=True):
        (run, *numbers), (same, *wanted) = one.split(","), other.split(",")
        assert run == same
        assert [float(x) for x in numbers] == pytest.approx([float(x) for x in wanted], abs=2e-5)


@pytest.mark.parametrize(
    "name", ["pendulum", *(pytest.param(one, marks=pytest.mark.slow) for one in ("rod", "soromox"))]
)
def test_the_hidden_effect_is_named(name: str, tmp_path: Path) -> None:
    _, library, hidden, others = CASES[name]
    pytest.importorskip(library)
    where = [
        "--out",
        str(tmp_path / "out"),
        "--store",
        str(tmp_path / "store"),
        "--json",
        str(tmp_path / "it.json"),
    ]
    asked = [word for kind in (hidden, *others) for word in ("--effect", kind)]
    done = CliRunner().invoke(app, ["diagnose", str(FOLDER / name / "study.yaml"), *where, *asked])
    assert done.exit_code == 0, done.output
    found = json.loads((tmp_path / "it.json").read_text())
    assert found["verdict"] == "missing_effect", done.output
    assert found["selected"] == [hidden]
