"""docs/bring_your_own_data.md is true: its commands run, its output and its answer are what the command says."""

import json
import re
import shlex
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from pliant.cli.verbs import app
from pliant.registry.discovery import discover

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "bring_your_own_data.md").read_text(encoding="utf-8")
NOTES, _ = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
STUDY = re.findall(r"```yaml\n(pliant: 1.*?)```", PAGE, re.DOTALL)[0]


@pytest.fixture
def workplace(tmp_path, monkeypatch):
    shutil.copy(ROOT / "examples" / "elsewhere" / "bellow.csv", tmp_path / "bellow.csv")
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PLIANT_STORE", raising=False)
    return tmp_path


def said(*words: str) -> str:
    done = CliRunner().invoke(app, list(words))
    assert done.exit_code == 0, done.output
    return done.stdout


def without_times(text: str) -> str:
    return re.sub(r", [\d.]+ m?s\b", "", text)


def test_the_question_is_the_one_of_the_page(workplace):
    done = CliRunner().invoke(app, ["fit", "bellow.csv"])
    assert done.exit_code == 2
    assert done.stderr.strip() in PAGE
    head = (workplace / "bellow.csv").read_text().splitlines()[:5]
    assert "\n".join(head) in PAGE


def test_the_one_command_says_what_the_page_says_and_its_study_runs(workplace):
    (workplace / "bellow.yaml").write_text(NOTES)
    command, shown = re.findall(r"```console\n\$ pliant (fit [^\n]*)\n(table.*?)```", PAGE, re.DOTALL)[0]
    output = said(*shlex.split(command))
    # digits of a fit may differ from machine to machine; what is said of which number may not
    digits = re.compile(r"\d[\d.e+-]*")
    assert digits.sub("0", without_times(output)) == digits.sub("0", without_times(shown))
    share, stated = (float(re.search(r"worst error ([\d.]+) %", text)[1]) for text in (output, shown))
    assert share == pytest.approx(stated, rel=0.2)
    (use,) = re.findall(r"^\$ pliant (simulate [^\n]*)", PAGE, re.M)
    assert "settled" in said(*shlex.split(use))


def test_the_study_of_the_page_runs_and_all_kinds_can_be_compared(workplace):
    (workplace / "bellow.yaml").write_text(NOTES)
    (workplace / "own.yaml").write_text(STUDY)
    said("simulate", "own.yaml", "--json", "own.json")
    assert json.loads((workplace / "own.json").read_text())["converged"]


@pytest.mark.slow
def test_comparing_names_every_kind(workplace):
    (workplace / "bellow.yaml").write_text(NOTES)
    said("fit", "bellow.csv", "--compare", "--json", "all.json")
    compared = json.loads((workplace / "all.json").read_text())["compared"]
    assert set(compared) == set(discover().kinds("surrogate"))
    assert compared["table"]["worst_of_range"] < 0.005
