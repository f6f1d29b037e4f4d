"""`pliant experiment`: the example from its first run to the improved study, a dry run, and mistakes in the study."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from tests.command import called

EXAMPLE = Path(__file__).parents[2] / "examples" / "experiment"


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for file in EXAMPLE.iterdir():
        shutil.copy(file, tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path / "finger.yaml"


def test_the_example_names_the_hidden_friction_and_is_not_done_twice(study: Path) -> None:
    words = (
        "experiment",
        study,
        "--effect",
        "friction_hysteresis",
        "--effect",
        "sensor_scale",
        "--json",
        "-",
    )
    first = json.loads(called(*words).done().out)
    assert (first["verdict"], first["selected"]) == ("missing_effect", ["friction_hysteresis"])
    assert Path(first["improved_study"]).exists() and Path(first["report"]).exists()
    assert all(Path(name).exists() for name in first["recordings"])
    again = json.loads(called(*words).done().out)
    assert again["runs"] == first["runs"]


def test_a_dry_run_moves_nothing(study: Path) -> None:
    found = json.loads(called("experiment", study, "--dry-run", "--json", "-").done().out)
    assert found["corners"][-1]["pressure (kPa)"] == "0 kPa"
    assert found["expected"]["angle_rad"]["high"] > 0.1
    assert not list(Path("runs").glob("*/run_*"))


def test_another_folder_for_another_bench(study: Path) -> None:
    folder = Path("runs/experiment-experiment")
    folder.mkdir(parents=True)
    (folder / "experiment.json").write_text('{"format": 1, "study": "other"}')
    called("experiment", study).refused("another study")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("high: 15 kPa,", "high: 15 mm,", ("line", "'15 mm' is a length")),
        ("high: 15 kPa,", "high: -1 kPa,", ("'high' should be above 'low'",)),
        ("payload_kg:", "payload:", ("did you mean 'payload_kg'?",)),
        ("low: -60 deg", "low: -60 mm", ("experiment.outputs.angle_rad",)),
        ("    pressure_pa: {", "    presure_pa: {", ("did you mean 'pressure_pa'?",)),
        ("truth: truth.yaml", "truth: nowhere.yaml", ("no such file",)),
        ("kind: simulated", "kind: simulate", ("did you mean 'simulated'?",)),
        ("runs: 10", "runs: 1", ("runs",)),
    ],
)
def test_mistakes_are_one_sentence(study: Path, old: str, new: str, words: tuple[str, ...]) -> None:
    text = study.read_text()
    assert old in text
    study.write_text(text.replace(old, new, 1))
    called("experiment", study, "--dry-run").refused(*words)


def test_a_study_without_a_bench_is_refused(study: Path) -> None:
    text = study.read_text()
    study.write_text(text[: text.index("bench:")])
    called("experiment", study).refused("experiment")
