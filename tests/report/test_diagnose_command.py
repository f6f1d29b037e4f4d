"""`pliant diagnose` writes its page to the given path."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from pliant.cli.verbs import app

STUDY = Path(__file__).parents[2] / "examples" / "hidden_effect" / "finger.yaml"
FEW = ["--effect", "viscoelastic", "--effect", "stiffness", "--effect", "sensor_bias"]


@pytest.fixture
def workplace(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PLIANT_STORE", raising=False)
    monkeypatch.setenv("COLUMNS", "80")
    return tmp_path


def run(*words):
    return CliRunner().invoke(app, ["diagnose", str(STUDY), *FEW, *words])


@pytest.mark.slow
def test_the_page_is_in_the_requested_folder_without_pictures_from_another_verdict(workplace):
    pictures = workplace / "here" / "pictures"
    pictures.mkdir(parents=True)
    for name in ("hypotheses", "repeats", "changes_2", "mine"):
        (pictures / f"{name}.png").write_bytes(b"old")
    done = run("--out", "here", "--json", "found.json", "--quiet")
    assert done.exit_code == 0 and done.stdout == ""
    found = json.loads((workplace / "found.json").read_text())
    assert (found["out"], found["report"]) == ("here", "here/report.html")
    assert "hidden-effect" in (workplace / "here" / "report.html").read_text(encoding="utf-8")
    left = {p.stem for p in pictures.iterdir()}
    assert "changes_2" not in left and {"mine", "changes_1", "hypotheses"} <= left


def test_a_folder_that_cannot_be_written_is_refused_before_the_work(workplace):
    (workplace / "file").write_text("")
    done = run("--out", "file/inside")
    assert done.exit_code == 2 and "cannot be written" in done.stderr
