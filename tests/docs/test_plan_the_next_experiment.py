"""The sample output of plan_the_next_experiment.md against the commands: runs, orders, files, verdicts."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from pliant.cli.verbs import app

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/plan_the_next_experiment.md").read_text(encoding="utf-8")
CONSOLE = re.findall(r"```console\n(.*?)```", PAGE, re.S)
# A chosen run with its minutes and its order: they come from the menu and stay the same.
ORDER = re.compile(r"^(?:run \d+: )?(\w+) \(([\d.]+) min\): (.+)$", re.M)


@pytest.fixture
def pliant(tmp_path, monkeypatch):
    shutil.copytree(ROOT / "examples/next_experiment", tmp_path / "examples/next_experiment")
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PLIANT_STORE", raising=False)

    def call(command: str) -> str:
        done = CliRunner().invoke(app, command.split(), env={"COLUMNS": "200"})
        assert done.exit_code == 0, done.output
        return done.stdout

    return call


def commands(block: str) -> list[str]:
    return re.findall(r"^\$ pliant (.*)$", block, re.M)


def test_after_data_it_chooses_the_runs_of_the_page(pliant, tmp_path) -> None:
    said = pliant(commands(CONSOLE[0])[0])
    assert "These data do not decide:" in said and "These data do not decide:" in CONSOLE[0]
    assert set(ORDER.findall(said)) == set(ORDER.findall(CONSOLE[0]))
    for name, minutes in re.findall(r"^(\w+) +([\d.]+) +0\.\d{3} +\d+%$", CONSOLE[0], re.M):
        assert re.search(rf"^{name} +{re.escape(minutes)} ", said, re.M), name
    (file,) = tmp_path.glob("plan/run_*_passive_load_steps.csv")
    written = file.read_text(encoding="utf-8").splitlines()
    (shown,) = re.findall(r"```text\n(.*?)```", PAGE, re.S)
    for line, there in zip(shown.splitlines(), written, strict=False):
        assert there.startswith(line.split("…")[0])


def test_the_runs_that_were_done_decide(pliant, monkeypatch, tmp_path) -> None:
    monkeypatch.chdir(tmp_path / "examples/next_experiment")
    (verdict,) = re.findall(r"^Missing: .*$", CONSOLE[1], re.M)
    assert verdict in pliant(commands(CONSOLE[1])[0])


def test_before_data_it_begins_with_the_runs_of_the_page(pliant) -> None:
    said = pliant(commands(CONSOLE[2])[0])
    chosen, shown = ORDER.findall(said), ORDER.findall(CONSOLE[2])
    assert chosen[: len(shown)] == shown
    assert re.search(r"^\d+ runs, [\d.]+ min: \d+ groups of \d+ effects\.$", said, re.M)


def test_the_table_of_the_menu_is_the_menu(pliant) -> None:
    from pliant.experiments.experiment_catalogue import timed_catalogue
    from pliant.experiments.planned_run import BenchScale
    from pliant.testing.samples import sample_chain

    runs = {run.name: run for run in timed_catalogue(BenchScale.of_chain(sample_chain(modules=1), 15e3))}
    named = [
        (re.findall(r"`(\w+)`", row[0]), re.findall(r"[\d.]+", row[1]))
        for row in re.findall(r"^\| (`\w+`.*?) \| .* \| ([\d., ]+) \|$", PAGE, re.M)
    ]
    told = {
        name: minutes[min(k, len(minutes) - 1)] for names, minutes in named for k, name in enumerate(names)
    }
    assert {name: float(value) for name, value in told.items()} == {n: r.minutes for n, r in runs.items()}
