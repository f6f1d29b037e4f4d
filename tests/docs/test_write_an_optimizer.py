"""The plugin and the study of write_an_optimizer.md, typed in as they stand."""

import json
import math
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from pliant.interfaces.optimizer import Space, Variable
from pliant.registry.discovery import discover
from pliant.registry.files import with_files
from pliant.testing import run_checks

PAGE = Path(__file__).parents[2] / "docs" / "write_an_optimizer.md"
TEXT = PAGE.read_text(encoding="utf-8")
PLANE = (
    Variable("a", "real", -1.0, 2.0),
    Variable("n", "integer", 0, 40),
    Variable("c", "categorical", 0, 1, ("x", "y")),
)


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", TEXT, re.DOTALL)


@pytest.fixture(scope="module")
def component(tmp_path_factory):
    file = tmp_path_factory.mktemp("typed") / "evolution.py"
    file.write_text(blocks("python")[0], encoding="utf-8")
    (found,) = [c for c in with_files(discover(), [file]).components if c.kind == "evolution"]
    return found


def built(component, **keys):
    return component.build(component.config_model().model_validate({"kind": "evolution", **keys}))


def searched(optimizer, score, batches, space=Space(PLANE), violation=lambda v: 0.0):
    """The best allowed score of a search, and all values asked."""
    optimizer.start(space, 0)
    best, asked = math.inf, []
    for _ in range(batches):
        outcomes = []
        for candidate in optimizer.ask(optimizer.batch):
            broken = violation(candidate.values)
            told = math.nan if broken > 0 else score(candidate.values)
            asked.append(candidate.values)
            best = min(best, told) if told == told else best
            outcomes.append(candidate.scored(told, violation=broken))
        optimizer.tell(outcomes)
    return best, asked


def hill(values):
    return (values["a"] - 0.7) ** 2 + 0.01 * (values["n"] - 13) ** 2 + (values["c"] == "x")


def test_it_passes_the_conformance_suite(component):
    outcomes = run_checks(component)
    assert [o.message for o in outcomes if o.status == "failed"] == []
    assert len([o for o in outcomes if o.status == "passed"]) >= 10


def test_it_is_short():
    code = [line for line in blocks("python")[0].splitlines() if line.strip()]
    assert len(code) <= 75


def test_it_finds_the_lowest_place_of_a_mixed_space(component):
    best, _ = searched(built(component), hill, 40)
    assert best < 1e-3


def test_it_begins_where_the_study_stands(component):
    start = {"a": 1.9, "n": 39, "c": "x"}
    _, asked = searched(built(component, step=0.01), hill, 1, Space(PLANE, start=start))
    assert max(abs(values["a"] - 1.9) for values in asked) < 0.2


def test_it_finds_its_way_out_of_what_is_forbidden(component):
    best, asked = searched(built(component), hill, 40, violation=lambda v: max(0.0, 0.9 - v["a"]))
    assert min(values["a"] for values in asked) < 0.9
    assert best == pytest.approx(0.2**2, abs=5e-3)


def test_the_commands_of_the_page(tmp_path, monkeypatch):
    from typer.testing import CliRunner

    from pliant.cli.verbs import app

    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PLIANT_STORE", raising=False)
    (tmp_path / "evolution.py").write_text(blocks("python")[0], encoding="utf-8")
    (tmp_path / "reach.yaml").write_text(blocks("yaml")[0], encoding="utf-8")
    said = {}
    for command in re.findall(r"^\$ pliant ([^#\n]*)", "\n".join(blocks("console")), re.M):
        done = CliRunner().invoke(app, [*shlex.split(command), "--json", "-"])
        assert done.exit_code == 0, done.output
        said[command.split()[0]] = done.output
    assert list(said) == ["check", "optimize"]
    told = json.loads(said["optimize"][said["optimize"].index("{") :])
    best = told["best"]["values"]
    assert f"tip_x {1e3 * told['objective']:.2f} mm" in TEXT
    assert f"{1e-3 * best['task.pressure']:.4g} kPa" in TEXT
    assert told["limits"][0] in TEXT
    # tip_x of n equal joints is l Σ sin(k u), largest where the pressure's u makes it so
    u = np.linspace(0.01, 0.36, 3501)
    reach = 11e-3 * sum(np.sin(np.outer(u, np.arange(1, 10))).T) + 5.5e-3 * np.sin(10 * u)
    assert told["objective"] == pytest.approx(reach.max(), rel=1e-5)
