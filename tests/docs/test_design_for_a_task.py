"""docs/design_for_a_task.md: its studies, copied unchanged, and its commands at a small budget."""

import json
import re

import pytest
from ruamel.yaml import YAML
from tests.docs.pages import blocks, commands, page_text, run

from pliant.config.loading import load_study
from pliant.registry.discovery import discover
from pliant_search.config import SearchConfig

PAGE = page_text("design_for_a_task")
# Fewer candidates, scenarios, and folds of the meta-model's scores; nothing is solved by FEM.
SMALL = ("meta_model.folds=2", "search.verify.fem=false", "search.budget=8")
FEWER = {
    "reach": SMALL,
    "sure": ("meta_model.folds=2", "search.budget=4", "search.robust.samples=2"),
    "polished": ("meta_model.folds=2", "search.budget=12", "search.polish.steps=3"),
    "front": ("meta_model.folds=2", "search.budget=8", "optimizer.population=8"),
}


@pytest.fixture(scope="module")
def searched(workplace):
    """Return a function that gives the output and the files of a search of the page."""
    for text in blocks(PAGE, "yaml"):
        if re.search(r"^pliant: 1$", text, re.M):
            (workplace / f"{re.search(r'^name: (.*)$', text, re.M)[1]}.yaml").write_text(
                text, encoding="utf-8"
            )

    def inner(name):
        ends = (f"{name}.yaml", f"--out {name}")
        command = next(one for one in commands(PAGE) if one.endswith(ends[0]) or ends[1] in one)
        printed = run(command, *FEWER[name], "--workers", "1")
        out = name if ends[1] in command else f"runs/{name}"
        return printed, json.loads((workplace / out / "optimize.json").read_text())

    return inner


@pytest.fixture(scope="module")
def reached(searched):
    return searched("reach")


@pytest.mark.slow
def test_the_example_searches_what_the_page_says_and_writes_its_files(reached, workplace):
    told = reached[1]
    assert list(told["best"]["values"]) == ["n", "r", "R", "l", "task.pressure"]
    assert told["evaluations"] == 8
    named = re.findall(r"^\| `([\w.]+)` \| (?:the study|every|all results|the page)", PAGE, re.M)
    assert len(named) == 4 and all((workplace / "runs/reach" / name).is_file() for name in named)
    best = load_study(workplace / "runs/reach/best.yaml", discover())
    assert best.search is None
    assert best.chain.modules == told["best"]["values"]["n"]


def test_the_best_on_the_page_keeps_its_constraints():
    """The values of the best design satisfy the published formulas."""
    shown = next(text for text in PAGE.split("```\n") if text.startswith("best"))
    best = {name: float(value) for name, value in re.findall(r"^ {9}(\w+) +([\d.]+)(?: mm)?$", shown, re.M)}
    assert best["R"] - best["r"] >= best["l"] / 4
    length = float(re.search(r"best +n \* l / 1 mm ([\d.]+)", shown)[1])
    assert length == pytest.approx(best["n"] * best["l"], rel=1e-3)
    assert float(re.search(r"tip_x ([\d.]+) mm", shown)[1]) >= 60


@pytest.mark.slow
def test_a_robust_search_has_the_command_scenarios(searched):
    assert searched("sure")[1]["robustness"]["samples"] == 2


@pytest.mark.slow
def test_the_polished_search_is_never_worse_than_its_candidates(searched):
    printed, told = searched("polished")
    assert "polish   " in printed
    assert 1 <= len(told["polished"]) <= 3
    assert all(one["after"] <= one["before"] for one in told["polished"])
    assert told["objective"] <= min(one["before"] for one in told["polished"])
    assert told["best"]["metrics"]["tip_x_m"] >= 60e-3


@pytest.mark.slow
def test_the_front_is_sorted(searched):
    told = searched("front")[1]
    assert list(told["objectives"]) == ["n * l / 1 mm", "task.pressure / 1 kPa"]
    scores = [tuple(design["objectives"].values()) for design in told["designs"]]
    assert sorted(scores) == scores
    assert sorted((b for _, b in scores), reverse=True) == [b for _, b in scores]


@pytest.mark.slow
def test_the_python_on_the_page_reads_what_is_there(reached, workplace, capsys):
    text = next(text for text in blocks(PAGE, "python") if "api.optimize" in text)
    opened = f'open_study("reach.yaml", overrides={list(SMALL)}, store="store")'
    text = text.replace('open_study("reach.yaml")', opened).replace(".verified[", ".predicted[")
    exec(text.replace(")\nbest", ", workers=1)\nbest", 1), {})
    assert "task.pressure" in capsys.readouterr().out


@pytest.mark.parametrize(
    "text", [text for text in blocks(PAGE, "yaml") if text.startswith("search:\n  variables")]
)
def test_the_variables_on_the_page_are_read(text):
    block = YAML(typ="safe", pure=True).load(text)["search"]
    config = SearchConfig.model_validate({**block, "objective": "rmse"})
    assert [one.each for one in config.variables.values()].count(True) == 1
