"""docs/plan_the_next_experiment.md against the commands: runs, files, verdicts."""

import re

import pytest
from tests.docs.pages import ASK_FEW, blocks, commands, page_text, run

from pliant.experiments.experiment_catalogue import timed_catalogue
from pliant.experiments.planned_run import BenchScale
from pliant.testing.samples import sample_chain

PAGE = page_text("plan_the_next_experiment")
CONSOLE = blocks(PAGE, "console")
# A chosen run with its minutes and its order, which come from the menu and do not change.
ORDER = re.compile(r"^(?:run \d+: )?(\w+) \(([\d.]+) min\): (.+)$", re.M)


@pytest.mark.slow
def test_after_data_it_chooses_the_runs_on_the_page(workplace) -> None:
    said = run(commands(PAGE)[0])
    assert set(ORDER.findall(said)) == set(ORDER.findall(CONSOLE[0])) != set()
    (file,) = workplace.glob("plan/run_*_passive_load_steps.csv")
    written = file.read_text(encoding="utf-8").splitlines()
    for line, there in zip(blocks(PAGE, "text")[0].splitlines(), written, strict=False):
        assert there.startswith(line.split("…")[0])


@pytest.mark.slow
def test_the_runs_that_were_done_decide(workplace, monkeypatch) -> None:
    monkeypatch.chdir(workplace / "examples/next_experiment")
    (verdict,) = re.findall(r"^Missing: .*$", CONSOLE[1], re.M)
    assert verdict in run(commands(PAGE)[1], *ASK_FEW)


def test_before_data_it_begins_with_the_runs_on_the_page(workplace) -> None:
    chosen, shown = ORDER.findall(run(commands(PAGE)[2])), ORDER.findall(CONSOLE[2])
    assert chosen[: len(shown)] == shown != []


def test_the_menu_table_is_the_menu() -> None:
    runs = {run.name: run for run in timed_catalogue(BenchScale.from_chain(sample_chain(modules=1), 15e3))}
    told = {}
    for names, minutes in re.findall(r"^\| (`\w+`.*?) \| .* \| ([\d., ]+) \|$", PAGE, re.M):
        given = re.findall(r"[\d.]+", minutes)
        for k, name in enumerate(re.findall(r"`(\w+)`", names)):
            told[name] = pytest.approx(float(given[min(k, len(given) - 1)]))
    assert {name: one.minutes for name, one in runs.items()} == told
