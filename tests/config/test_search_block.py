"""Mistakes of a `search` block, each with its file and line."""

import pytest
from tests.search.search_studies import BASE, REGISTRY, search_study

from pliant.config.loading import load_study
from pliant.errors import UserError


def refused(path, search):
    with pytest.raises(UserError) as error:
        search_study(path, search)
    return str(error.value)


def one(variable, more=""):
    return f"objective: rmse\nvariables:\n  {variable}\n{more}"


@pytest.mark.parametrize(
    ("variable", "message"),
    [
        ("family.wall: {low: 3 mm, high: 1 mm}", "has low 3 mm above high 1 mm"),
        ("family.wall: {low: 1 mm, high: 1 mm}", "leaves nothing to search"),
        ("family.wall: {low: .nan, high: 1 mm}", "needs a finite number"),
        ("family.wall: {low: 1 mm, high: .inf}", "needs a finite number"),
        ("family.wall: {low: 1 kPa, high: 2 mm}", "needs a length"),
        ("family.wall: {low: 1 mm}", "give either 'low' and 'high', or 'choices'"),
        ("family.wall: {low: 1 mm, high: 2 mm, choices: [1 mm, 2 mm]}", "give either"),
        ("family.wall: {low: 1 mm, high: 2 mm, each: true}", "'each' is for whole numbers"),
        ("family.waal: {low: 1 mm, high: 2 mm}", "did you mean 'wall'"),
        ("meta_model.share: {low: 1, high: 2}", "the study has no 'meta_model' block"),
        ("n: {key: chain.segments.0.modules, low: 3.5, high: 8}", "whole number"),
        ("n: {key: chain.segments.0.modules, low: 0, high: 8}", "greater than or equal to 1"),
        ("n: {key: chain.segments.4.modules, low: 1, high: 8}", "'chain.segments' has items 0 to 3"),
        ("n: {key: [], low: 1, high: 8}", "'search.variables.n.key' is an empty list"),
        ("n: {key: [task.friction, family.wall], low: 1, high: 8}", "which hold different things"),
        ("n: {key: task.object, low: 1, high: 8}", "is no number, so 'search.variables.n' has no range"),
        ("task.object: {choices: [egg]}", "has one value"),
        ("task.object: {choices: [egg, egg]}", "has egg twice"),
        ("task.object: {choices: [egg, eg]}", "did you mean 'egg'"),
        ("family.wall: {low: 1 mm, high: 2 mm, only: a}", "the search states no conditions"),
        ("name: {choices: [a, b]}", "it names the output folder"),
        ("n-1: {low: 1, high: 2}", "cannot stand in a formula"),
    ],
)
def test_mistakes_in_variables_have_their_line(tmp_path, variable, message):
    text = refused(tmp_path, one(variable))
    assert message in text
    line = BASE.count("\n") + 4
    if "formula" not in message:
        assert f"searched.yaml, line {line}: " in text


@pytest.mark.parametrize(
    ("conditions", "message"),
    [
        ("{a: {}}", "'search.conditions.a' sets nothing"),
        ("{a: {task.frcition: 1}}", "did you mean 'friction'"),
        ("{a: {task.friction: much}}", "is not a quantity"),
        ("{a: {task.friction: 0.5}, b: {task.friction: 0.5}}", "conditions 'a' and 'b' set the same"),
        ("{a: {search.seed: 1}}", "it is the search itself"),
        ("{a: {family.wall: 1 mm}}", "is set by variable 'family.wall' and by condition 'a' itself"),
    ],
)
def test_mistakes_in_conditions_have_their_line(tmp_path, conditions, message):
    text = refused(tmp_path, one("family.wall: {low: 1 mm, high: 2 mm}", f"conditions: {conditions}"))
    assert message in text and "searched.yaml, line " in text


CONDITIONS = "conditions: {egg: {task.extra_weights: 1}, rod: {task.extra_weights: 2}}"


@pytest.mark.parametrize(
    "block", ["robust: {vary: {task.frction: 5 %}}", "verify: {change: {task.frction: 1}}"]
)
def test_keys_in_scenarios_and_in_the_check_are_looked_up(tmp_path, block):
    text = refused(tmp_path, one("family.wall: {low: 1 mm, high: 2 mm}", block))
    assert "did you mean 'friction'?" in text and f"line {BASE.count(chr(10)) + 5}: " in text


def test_overrides_reach_into_the_block(tmp_path):
    search_study(tmp_path, one("family.wall: {low: 1 mm, high: 2 mm}", CONDITIONS))
    file = tmp_path / "searched.yaml"
    study = load_study(
        file,
        REGISTRY,
        [
            "search.variables.family.wall.high=1.8 mm",
            "search.conditions.rod.task.extra_weights=4",
            "search.budget=7",
            "search.verify.change.task.trials=9",
            "search.robust.vary.chain.base.roll={sd: 1 deg}",
            "search.robust.vary.task.friction=5 %",
        ],
    )
    assert study.search.robust.vary == {"chain.base.roll": {"sd": "1 deg"}, "task.friction": "5 %"}
    assert study.search.variables["family.wall"].high == "1.8 mm"
    assert study.search.variables["family.wall"].low == "1 mm"
    assert study.search.conditions["rod"] == {"task.extra_weights": 4}
    assert study.search.budget == 7
    assert study.search.verify.change == {"task.trials": 9}
    with pytest.raises(UserError, match="has low 1 mm above high 0.1 mm"):
        load_study(file, REGISTRY, ["search.variables.family.wall.high=0.1 mm"])


def test_paths_are_beside_the_file(tmp_path):
    base = BASE.replace(
        "{kind: grasp, object: egg, extra_weights: 5, pressure: 15 kPa}",
        "{kind: follow_shape, pressure: 15 kPa, target: {points: a.csv}}",
    )
    search = one(
        "task.target.points: {choices: [a.csv, b.csv]}",
        "verify: {change: {task.target.points: d.csv}}",
    )
    study = search_study(tmp_path, search, base)
    assert study.search.variables["task.target.points"].choices == (
        str(tmp_path / "a.csv"),
        str(tmp_path / "b.csv"),
    )
    assert study.search.verify.change == {"task.target.points": str(tmp_path / "d.csv")}
    assert str(study.task.target.points) == str(tmp_path / "a.csv")
    grasp = search_study(
        tmp_path,
        one(
            "family.wall: {low: 1 mm, high: 2 mm}", "conditions: {a: {task.object: {mesh: p.stl, mass: 3 g}}}"
        ),
    )
    assert grasp.search.conditions["a"]["task.object"]["mesh"] == str(tmp_path / "p.stl")


@pytest.mark.parametrize(
    ("first", "second", "message"),
    [
        ("task.friction, low: 0, high: 1, only: egs", "", "no condition is called; did you mean 'egg'?"),
        (
            "task.friction, low: 0, high: 1",
            "rod",
            "'task.friction' is set by variable 'a' and 'b' in condition 'rod'",
        ),
        (
            "[task.friction, task.friction], low: 0, high: 1",
            "",
            "'task.friction' is set by variable 'a' twice",
        ),
        ("task.friction, low: 0, high: 1, only: egg", "rod", ""),
    ],
)
def test_no_key_is_set_twice_in_a_condition_and_those_in_different_conditions_may_share_it(
    tmp_path, first, second, message
):
    other = f"\n  b: {{key: task.friction, low: 0, high: 2, only: {second}}}" if second else ""
    search = one(f"a: {{key: {first}}}{other}", CONDITIONS)
    if message:
        assert message in refused(tmp_path, search)
    else:
        assert len(search_study(tmp_path, search).search.variables) == 2
