"""A study's search through the store: conditions, fronts, recommendations, robustness, exported files."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.cli.search_study import STUDY

from pliant import api
from pliant.errors import UserError
from pliant.records.search import Verification
from pliant.search.checking import merged
from pliant.search.stage import files_folder, search_study

PLUGIN = Path(__file__).with_name("narrowing_plugin.py")
LOADED = "search.conditions={light: {chain.payload: 0 g}, heavy: {chain.payload: 5 g}}"


@pytest.fixture
def opened(tmp_path):
    """Open the study with another optimizer and other changes."""
    path = tmp_path / "study.yaml"
    path.write_text(STUDY.replace("{kind: cmaes}", "{kind: narrowing}") + f"plugins: [{PLUGIN}]\n")

    def call(*overrides, store="store"):
        return api.open_study(path, overrides, store=tmp_path / store)

    return call


def best_in(result, context):
    history = result.history
    return np.nanmin(history.objectives[history.context == context, 0])


def test_each_condition_has_its_own_best_design(opened):
    result = api.optimize(
        opened("optimizer=contextual", "search.budget=24", LOADED, "chain.gravity=[0, 0, -9.81]"), workers=1
    )
    assert result.conditions == ("light", "heavy")
    assert [design.context for design in result.best] == [0, 1]
    assert [list(design.conditions) for design in result.best] == [["light"], ["heavy"]]
    assert result.evaluations == len(result.history) + 2  # what it recommends is tried too
    assert result.simulations == result.evaluations
    for context, design in enumerate(result.best):
        (objective,) = design.objectives.values()
        assert objective <= best_in(result, context)
        assert (design.number == -1) == (objective < best_in(result, context))
    assert set(result.verification.predicted) == {"quasistatic"}


def test_a_recommendation_that_is_better_than_all_that_was_tried_wins(opened):
    result = api.optimize(opened("optimizer=knowing", "search.budget=2"), workers=1)
    assert result.best[0].number == -1
    assert result.best[0].values["task.pressure"] == 6.16245e3
    assert result.evaluations == 3
    assert result.best[0].objectives["abs(tip_x - 10 mm)"] < best_in(result, -1)


def test_several_objectives_give_a_front(opened):
    result = api.optimize(
        opened("optimizer=front", "search.objective=[tip_x, {maximize: tip_z}]", "search.budget=30"),
        workers=1,
    )
    assert result.maximised == (False, True)
    rows = np.array([list(design.objectives.values()) for design in result.best])
    assert len(rows) > 1
    assert np.all(np.diff(rows[:, 0]) > 0)
    assert np.all(np.diff(rows[:, 1]) > 0)  # tip_z is to be large: what costs tip_x gains it
    for told in result.history.objectives:  # as minimised: nothing beats a member
        beaten = np.all(told <= rows * [1, -1], axis=1) & np.any(told < rows * [1, -1], axis=1)
        assert not beaten.any()


def test_several_objectives_name_the_optimizers_that_can(opened):
    with pytest.raises(UserError, match=r"'narrowing' minimises one objective .* front"):
        api.optimize(opened("search.objective=[tip_x, tip_z]"), workers=1)


def test_a_robust_search_says_what_it_costs(opened):
    robust = "search.robust={samples: 4, laws: false, measure: worst, vary: {task.pressure: 20 %}}"
    result = api.optimize(opened(robust, "search.budget=18"), workers=1)
    found = result.robustness
    assert found.sources == ("task.pressure ± 20 %",)
    assert {name: spread.shape for name, spread in found.spread.items()} == {"nominal": (4,), "robust": (4,)}
    assert found.robust_of_robust == pytest.approx(found.spread["robust"].max())
    assert found.robust_of_nominal == pytest.approx(found.spread["nominal"].max())
    assert found.robust_of_robust == pytest.approx(next(iter(result.best[0].objectives.values())))
    assert found.nominal_of_nominal < found.robust_of_nominal
    nominal = api.optimize(opened("search.budget=18"), workers=1)
    assert found.nominal.values == nominal.best[0].values
    assert result.simulations == 18 * 5
    alone = api.optimize(
        opened(robust.replace("{samples", "{compare: false, samples"), "search.budget=18"), workers=1
    )
    assert alone.robustness is None
    assert alone.best[0].values == result.best[0].values


def test_the_optimizers_files_are_kept(opened):
    study = opened("search.budget=12")
    made = search_study(study.bench, study.study, workers=1)
    assert made.value.files == ("best.txt",)
    assert "task.pressure" in (files_folder(study.bench, made) / "best.txt").read_text()


@pytest.mark.parametrize(
    ("change", "again"),
    [
        ("name=other", False),
        ("cross_check=[mujoco]", False),
        ("search.verify=null", False),
        ("search.budget=13", True),
        ("search.seed=1", True),
        ("task.steps=2", True),
        ("optimizer=front", True),
    ],
)
def test_what_a_search_depends_on(opened, change, again):
    keys = []
    for changes in ((), (change,)):
        study = opened("search.budget=12", "search.verify=null", *changes)
        keys.append(search_study(study.bench, study.study, workers=1).key)
    assert (keys[0] != keys[1]) == again


def test_checks_of_several_conditions_become_one():
    one = Verification(
        {"a": {"m": 1.0}},
        {"a": {"m": 2.0}, "b": {"m": 9.0}},
        {"a": {"x": {"m": 2.0}}},
        (),
        1.0,
        2.0,
        ("all", "n"),
    )
    two = replace(
        one, verified={"a": {"m": 4.0}}, conditions={"a": {"y": {"m": 4.0}}}, notes=("all", "failed")
    )
    both = merged({"x": one, "y": two})
    assert both.verified == {"a": {"m": 3.0}}  # b did not answer for both
    assert both.conditions == {"a": {"x": {"m": 2.0}, "y": {"m": 4.0}}}
    assert (both.fem_wall_s, both.wall_s) == (2.0, 4.0)
    assert both.notes == (
        "all",
        "x: n",
        "y: failed",
        "b, with laws from direct FEM: no answer for y, so no mean.",
    )
    assert merged({"": one}) is one
    assert merged({}) is None
