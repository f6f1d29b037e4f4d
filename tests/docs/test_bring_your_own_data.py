"""docs/bring_your_own_data.md is correct: its commands run, and the quoted answer is the command's output."""

import json
import re
import shutil

import pytest
from tests.docs.pages import ROOT, blocks, commands, page_text, run
from typer.testing import CliRunner

from pliant.cli.verbs import app
from pliant.registry.discovery import discover

PAGE = page_text("bring_your_own_data")
NOTES, STUDY = (
    next(text for text in blocks(PAGE, "yaml") if text.startswith(start)) for start in ("rename", "pliant: 1")
)


@pytest.fixture
def table(workplace):
    shutil.copy(ROOT / "examples/elsewhere/bellow.csv", workplace / "bellow.csv")
    (workplace / "bellow.yaml").write_text(NOTES)


def test_the_question_is_the_one_on_the_page(workplace, table):
    (workplace / "bellow.yaml").unlink()
    done = CliRunner().invoke(app, ["fit", "bellow.csv"])
    assert done.exit_code == 2
    assert done.stderr.strip() in PAGE


@pytest.mark.slow
def test_the_command_and_the_study_on_the_page_run(workplace, table):
    worst = re.compile(r"worst error ([\d.]+) %")
    share, stated = (float(worst.search(text)[1]) for text in (run(commands(PAGE)[0]), PAGE))
    assert share == pytest.approx(stated, rel=0.2)
    assert "settled" in run(next(command for command in commands(PAGE) if command.startswith("simulate")))
    (workplace / "own.yaml").write_text(STUDY)
    run("simulate own.yaml --json own.json")
    assert json.loads((workplace / "own.json").read_text())["converged"]


@pytest.mark.slow
def test_comparing_names_every_kind(workplace, table):
    run("fit bellow.csv --compare --json all.json")
    compared = json.loads((workplace / "all.json").read_text())["compared"]
    assert set(compared) == set(discover().kinds("surrogate"))
    assert compared["table"]["worst_of_range"] < 0.005
