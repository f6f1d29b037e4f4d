"""docs/design_for_a_task.md: its studies, typed in as they stand, and its commands at a small budget."""

import json
import re
import shlex
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from pliant import api
from pliant.cli.verbs import app
from pliant.config.loading import load_study
from pliant.config.search import SearchConfig
from pliant.records.search import Verification
from pliant.registry.discovery import discover
from pliant.report.search import lines

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/design_for_a_task.md").read_text(encoding="utf-8")
# Fewer candidates, scenarios, and folds of the meta-model's scores; nothing is solved by FEM.
SMALL = ("meta_model.folds=2", "search.verify.fem=false", "search.budget=8")
FEWER = {
    "reach.yaml": SMALL,
    "sure.yaml": ("meta_model.folds=2", "search.budget=4", "search.robust.samples=2"),
    "front": ("meta_model.folds=2", "search.budget=8", "optimizer.population=8"),
}


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)


def outputs():
    """Command of the page → the lines that it prints there."""
    return {
        command: shown.splitlines()
        for command, shown in re.findall(
            r"```console\n\$ pliant ([^\n]*)\n```\n\n```\n(.*?)```", PAGE, re.DOTALL
        )
    }


def command(name):
    (found,) = [one for one in outputs() if one.split()[-1] == name or f"--out {name}" in one]
    return found


def form(line):
    """A line with its numbers taken out."""
    return re.sub(r"-?\d[\d.]*(e[+-]?\d+)?", "#", line).rstrip()


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with the studies of the page and the examples."""
    folder = tmp_path_factory.mktemp("typed")
    (folder / "examples").symlink_to(ROOT / "examples")
    for text in blocks("yaml"):
        if re.search(r"^pliant: 1$", text, re.M):
            (folder / f"{re.search(r'^name: (.*)$', text, re.M)[1]}.yaml").write_text(text, encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def done():
    """What commands have printed and written."""
    return {}


@pytest.fixture
def run(place, monkeypatch, done):
    monkeypatch.chdir(place)
    monkeypatch.setenv("PLIANT_STORE", str(place / "store"))

    def inner(name):
        if name not in done:
            done[name] = searched(name)
        return done[name]

    def searched(name):
        words = shlex.split(command(name))
        ended = CliRunner().invoke(app, [*words, *FEWER[name], "--workers", "1"])
        assert ended.exit_code == 0, ended.output
        out = words[words.index("--out") + 1] if "--out" in words else f"runs/{Path(name).stem}"
        return ended.stdout.splitlines(), json.loads((place / out / "optimize.json").read_text())

    return inner


def heads(shown):
    """First words of lines, each once; what depends on the candidates is left out."""
    first = [line.split()[0] for line in shown if line and not line.startswith(" ")]
    return [
        head for head in dict.fromkeys(first) if head not in ("refused", "failed", "limit", "law", "note:")
    ]


def same_lines(shown, printed, starts):
    """Lines that begin so have the same form on the page and in the output."""
    for start in starts:
        here, there = ([form(line) for line in of if line.startswith(start)] for of in (shown, printed))
        assert here, start
        assert set(here) == set(there), start


@pytest.fixture
def reached(run):
    return run("reach.yaml")


def test_the_example_prints_what_the_page_shows(reached):
    printed, told = reached
    shown = outputs()[command("reach.yaml")]
    assert heads(shown) == heads(printed)
    same_lines(shown, printed, ("best", "search", "study", "report", "         n", "         R"))
    predicted = [
        re.sub(r"[\d.−]+( mm)? verified, ", "", line) for line in shown
    ]  # nothing is solved by FEM here
    same_lines(predicted, printed, ("checked",))
    assert list(told["best"]["values"]) == ["n", "r", "R", "l", "task.pressure"]
    assert told["evaluations"] == 8


def test_the_best_of_the_page_keeps_its_own_constraints():
    """Its numbers, put into the study's formulas."""
    shown = "\n".join(outputs()[command("reach.yaml")])
    best = {name: float(value) for name, value in re.findall(r"^ {9}(\w+) +([\d.]+)(?: mm)?$", shown, re.M)}
    assert best["R"] - best["r"] >= best["l"] / 4
    assert float(re.search(r"best +n \* l / 1 mm ([\d.]+)", shown)[1]) == pytest.approx(
        best["n"] * best["l"], rel=1e-3
    )
    assert float(re.search(r"tip_x ([\d.]+) mm", shown)[1]) >= 60


def test_every_file_of_the_page_is_written(reached, place):
    named = re.findall(r"^\| `([\w.]+)` \| (?:the study|every|all of it|the page)", PAGE, re.M)
    assert len(named) == 4
    for name in named:
        assert (place / "runs/reach" / name).is_file(), name


def test_the_best_is_a_study_without_its_search(reached, place):
    best = load_study(place / "runs/reach/best.yaml", discover())
    assert best.search is None
    assert best.chain.modules == reached[1]["best"]["values"]["n"]


def test_lines_about_the_fem_have_the_form_of_the_page(reached, place):
    result = api.optimize(api.open_study("reach.yaml", overrides=SMALL, store="store"), workers=1)
    shown = outputs()[command("reach.yaml")]
    name = re.search(r"^law +(.*): misses", "\n".join(shown), re.M)[1]
    (note,) = [line.removeprefix("note: ") for line in shown if line.startswith("note: ")]
    law = {"name": name, "rmse_of_range": 1e-3, "worst_of_range": 2e-3, "n_states": 25}
    check = Verification({}, {"quasistatic": dict(result.best[0].metrics)}, {}, (law,), 1.0, 1.0, (note,))
    same_lines(shown, lines(replace(result, verification=check), "quasistatic"), ("law",))


def test_robust_lines_have_the_form_of_the_page(run):
    printed, told = run("sure.yaml")
    shown = outputs()[command("sure.yaml")]
    assert heads(shown) == heads(printed)
    same_lines(shown, printed, ("best", "search", "robust"))
    assert told["robustness"]["samples"] == 2
    # what the page says of the price
    measured, of_nominal, undisturbed, nominal = (
        float(number)
        for number in re.search(
            r"scenarios ([\d.]+) .* ([\d.]+)\); .* ([\d.]+) .* ([\d.]+)\)", shown[-4]
        ).groups()
    )
    assert measured < of_nominal
    assert undisturbed > nominal
    assert all(
        f"{number:g}" in PAGE.split("*robust* is the price")[1]
        for number in (measured, of_nominal, undisturbed)
    )


def test_the_front_is_printed_as_on_the_page(run):
    printed, told = run("front")
    shown = outputs()[command("front")]
    same_lines(shown, printed, ("search", "study", "report"))
    assert {form(line) for line in shown if line.startswith("best")} >= {form(printed[0])}
    assert list(told["objectives"]) == ["n * l / 1 mm", "task.pressure / 1 kPa"]
    scores = [tuple(design["objectives"].values()) for design in told["designs"]]
    assert sorted(scores) == scores
    assert sorted((b for _, b in scores), reverse=True) == [b for _, b in scores]


def test_the_python_of_the_page_reads_what_is_there(reached, place, capsys):
    text = next(text for text in blocks("python") if "api.optimize" in text)
    opened = f'open_study("reach.yaml", overrides={list(SMALL)}, store="store")'
    text = text.replace('open_study("reach.yaml")', opened).replace(".verified[", ".predicted[")
    exec(text.replace(")\nbest", ", workers=1)\nbest", 1), {})
    assert "task.pressure" in capsys.readouterr().out


@pytest.mark.parametrize("text", [text for text in blocks("yaml") if text.startswith("search:\n  variables")])
def test_the_variables_of_the_page_are_read(text):
    from ruamel.yaml import YAML

    block = YAML(typ="safe", pure=True).load(text)["search"]
    config = SearchConfig.model_validate({**block, "objective": "rmse"})
    assert [one.each for one in config.variables.values()].count(True) == 1


def test_messages_of_the_page_are_those_of_the_code():
    core = ROOT / "core/pliant"
    files = [*(core / "search").rglob("*.py"), *(core / "config").glob("*.py")]
    files.append(ROOT / "plugins/pliant_plugins/tasks/follow_shape.py")
    code = re.sub(r'"\s*\n\s*f?"', "", "".join(file.read_text(encoding="utf-8") for file in files))
    (table,) = re.findall(r"\| message \| do \|\n\|---\|---\|\n(.*?)\n\n", PAGE, re.DOTALL)
    rows = [row.split(" | ")[0].removeprefix("| ") for row in table.splitlines()]
    assert len(rows) > 8
    for row in rows:
        for part in (part.strip() for part in row.split("…")):
            assert part.removesuffix(",") in code, part
