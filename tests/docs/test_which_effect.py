"""docs/which_effect.md is true: its commands and its Python run, its numbers are those of the code."""

import json
import re
import shlex
from pathlib import Path
from typing import get_args

import pytest
from typer.testing import CliRunner

from pliant.cli.verbs import app
from pliant.diagnosis.excitation import SEPARABLE
from pliant.diagnosis.verdict import THRESHOLDS, Verdict

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "which_effect.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def workplace(tmp_path_factory):
    folder = tmp_path_factory.mktemp("which_effect")
    (folder / "examples").symlink_to(ROOT / "examples")
    return folder


@pytest.fixture(scope="module")
def diagnosed(workplace):
    """The page's one command, with its JSON."""
    patch = pytest.MonkeyPatch()
    patch.chdir(workplace)
    patch.delenv("PLIANT_STORE", raising=False)
    (command,) = re.findall(r"^\$ pliant ([^#\n]*)", PAGE, re.M)
    done = CliRunner().invoke(app, [*shlex.split(command), "--json", "found.json"])
    patch.undo()
    assert done.exit_code == 0, done.output
    return done.output, json.loads((workplace / "found.json").read_text())


def test_the_command_runs_and_writes_its_page(workplace, diagnosed):
    said, found = diagnosed
    assert found["report"] == "runs/hidden-effect-diagnose/report.html" and found["report"] in said
    assert (workplace / found["report"]).is_file()


def test_every_key_of_the_json_table_is_there(diagnosed):
    _, found = diagnosed
    table = PAGE[PAGE.index("## JSON") :]
    keys = [key for row in re.findall(r"^\| (`[^|]*) \|", table, re.M) for key in re.findall(r"`(\w+)`", row)]
    assert len(keys) > 15
    assert [key for key in keys if key not in found] == []
    assert {"value", "sd", "unit", "plausible"} <= set(
        next(iter(found["hypotheses"][0]["parameters"].values()))
    )


def test_the_table_of_verdicts_is_complete():
    rows = re.findall(r"^\| `(\w+)` \|", PAGE[: PAGE.index("## What these")], re.M)
    assert sorted(rows) == sorted(get_args(Verdict))


def test_the_numbers_are_those_of_the_code():
    text = " ".join(PAGE.split())
    for said in (
        f"− {THRESHOLDS.effect:g} m ln(1 + c): Schwarz",
        f"any form, and pays {THRESHOLDS.unknown:g}",
        f"the evidences over {THRESHOLDS.temperature:g}",
        f"{THRESHOLDS.excited:g} noise floors, because the joint law",
        f"{100 * THRESHOLDS.model_form_tolerance:g} % of what the best simpler explanation explains",
        f"{100 * THRESHOLDS.unknown_form_tolerance:g} % of what the best listed explanation explains",
        f"has at least {100 * THRESHOLDS.believed:g} %",
        f"more than {THRESHOLDS.between_run_scatter:g} times as much",
        f"fewer than {THRESHOLDS.fewest:g} independent",
        f"< {SEPARABLE:g} at a strength",
    ):
        assert said in text, said


def test_the_python_runs(workplace, monkeypatch, capsys):
    monkeypatch.chdir(workplace)
    (code,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    exec(code, {})
    said = capsys.readouterr().out
    assert said.startswith("Missing: ") and "was not shown; do this: " in said
