"""The plugin and the study of write_an_optimizer.md, copied unchanged."""

import json
import math

import numpy as np
import pytest
from tests.docs.pages import blocks, commands, page_text, run

from pliant.registry.discovery import discover
from pliant.registry.files import with_files
from pliant_search.optimizer import Space, Variable

PAGE = page_text("write_an_optimizer")
PLANE = (
    Variable("a", "real", -1.0, 2.0),
    Variable("n", "integer", 0, 40),
    Variable("c", "categorical", 0, 1, ("x", "y")),
)


@pytest.fixture(scope="module")
def component(workplace):
    file = workplace / "evolution.py"
    file.write_text(blocks(PAGE, "python")[0], encoding="utf-8")
    (found,) = [c for c in with_files(discover(), [file]).components if c.kind == "evolution"]
    return found


def searched(component, batches, start=None, violation=lambda v: 0.0, **keys):
    """Return the best allowed score of a search for the foot of a hill, and all values tried."""
    optimizer = component.build(component.config_model().model_validate({"kind": "evolution", **keys}))
    optimizer.start(Space(PLANE, start=start) if start else Space(PLANE), 0)
    best, asked = math.inf, []
    for _ in range(batches):
        outcomes = []
        for candidate in optimizer.ask(optimizer.batch):
            v = candidate.values
            broken = violation(v)
            score = (v["a"] - 0.7) ** 2 + 0.01 * (v["n"] - 13) ** 2 + (v["c"] == "x")
            asked.append(v)
            best = best if broken > 0 else min(best, score)
            outcomes.append(candidate.scored(math.nan if broken > 0 else score, violation=broken))
        optimizer.tell(outcomes)
    return best, asked


def test_it_is_short():
    assert len([line for line in blocks(PAGE, "python")[0].splitlines() if line.strip()]) <= 75


def test_it_searches_a_mixed_space_from_where_the_study_stands(component):
    assert searched(component, 40)[0] < 1e-3
    _, asked = searched(component, 1, start={"a": 1.9, "n": 39, "c": "x"}, step=0.01)
    assert max(abs(values["a"] - 1.9) for values in asked) < 0.2


def test_it_leaves_a_forbidden_region(component):
    best, asked = searched(component, 40, violation=lambda v: max(0.0, 0.9 - v["a"]))
    assert min(values["a"] for values in asked) < 0.9
    assert best == pytest.approx(0.2**2, abs=5e-3)


@pytest.mark.slow
def test_the_commands_on_the_page(component, workplace):
    (workplace / "reach.yaml").write_text(blocks(PAGE, "yaml")[0], encoding="utf-8")
    check, optimize = commands(PAGE)
    assert "0 failed" in run(check)
    said = run(optimize, "--json", "-")
    told = json.loads(said[said.index("{") :])
    assert f"tip_x {1e3 * told['objective']:.2f} mm" in PAGE
    assert f"{1e-3 * told['best']['values']['task.pressure']:.4g} kPa" in PAGE
    # tip_x of n equal joints is l Σ sin(k u), largest at the u of the optimal pressure
    u = np.linspace(0.01, 0.36, 3501)
    reach = 11e-3 * sum(np.sin(np.outer(u, np.arange(1, 10))).T) + 5.5e-3 * np.sin(10 * u)
    assert told["objective"] == pytest.approx(reach.max(), rel=1e-5)
