"""The problem of a study's search: its variables, conditions, branches, and the study of a candidate."""

import itertools

import numpy as np
import pytest
from tests.search.search_studies import BASE, REGISTRY, search_problem

from pliant.config.loading import load_study
from pliant.errors import InvalidDesignError, UserError
from pliant_search.optimizer import Trial
from pliant_search.problem.search_problem import SearchProblem

SEARCH = """
variables:
  family.average_radius: {low: 6 mm, high: 8 mm}
  n1: {key: chain.segments.0.modules, low: 3, high: 10, each: true}
  n2: {key: chain.segments.1.modules, low: 3, high: 10, each: true}
  n3: {key: chain.segments.2.modules, low: 3, high: 10, each: true}
  n4: {key: chain.segments.3.modules, low: 3, high: 10, each: true}
  egg_inset: {key: task.base_inset, low: 0 mm, high: 16 mm, only: egg-*}
  cylinder_inset: {key: task.base_inset, low: -4 mm, high: 4 mm, only: cylinder}
  side: {key: chain.base.roll, choices: [0 deg, 90 deg]}
constraints:
  - 25 <= n1 + n2 + n3 + n4 <= 29
  - max(n1, n2, n3, n4) - min(n1, n2, n3, n4) <= 2
  - family.average_radius - family.inner_radius >= family.module_length / 2
  - slip <= 2 mm
objective: [{maximize: z_max - 0.01 * task.pressure / 15 kPa}, rmse]
until: rmse <= 5 mm and e_max <= 5 mm
conditions:
  egg-5: {task.object: egg, task.extra_weights: 5}
  egg-7: {task.object: egg, task.extra_weights: 7}
  cylinder: {task.object: cylinder, task.extra_weights: 4}
"""
VALUES = {
    **{"family.average_radius": 0.008, "egg_inset": 0.01, "cylinder_inset": -0.001, "side": np.pi / 2},
    **{"n1": 6, "n2": 7, "n3": 7, "n4": 7},
}


@pytest.fixture(scope="module")
def problem(tmp_path_factory):
    return search_problem(tmp_path_factory.mktemp("a"), SEARCH)


def test_variables_have_types_units_and_conditions(problem):
    by_name = {variable.name: variable for variable in problem.variables}
    radius, count, inset = by_name["family.average_radius"], by_name["n1"], by_name["egg_inset"]
    assert (radius.variable.type, radius.unit, radius.variable.low) == ("real", "m", 0.006)
    assert (count.variable.type, count.variable.low, count.variable.high) == ("integer", 3, 10)
    assert type(count.variable.low) is int
    assert inset.conditions == (0, 1) and by_name["cylinder_inset"].conditions == (2,)
    assert by_name["side"].variable.choices == (0.0, pytest.approx(np.pi / 2))
    assert [record.keys for record in problem.records()][:2] == [
        ("family.average_radius",),
        ("chain.segments.0.modules",),
    ]


def test_the_studys_81_structures(problem):
    """The splits into four with largest − smallest ≤ 2, of five totals about an odd centre, are 81."""
    found = problem.branches()
    by_hand = [
        counts
        for counts in itertools.product(range(3, 11), repeat=4)
        if 25 <= sum(counts) <= 29 and max(counts) - min(counts) <= 2
    ]
    assert [tuple(branch.values()) for branch in found] == by_hand
    assert len(found) == 81
    assert all(type(value) is int for value in found[0].values())


def test_the_space_leaves_out_what_has_a_separate_search(problem):
    space = problem.space()
    assert [axis.name for axis in space.variables] == [
        "family.average_radius",
        "egg_inset",
        "cylinder_inset",
        "side",
    ]
    assert space.objectives == 2 and space.contexts == ()
    assert space.start["family.average_radius"] == 0.006
    assert space.start["egg_inset"] == 0.008  # the study has none: the middle


def test_contexts_merge_what_shares_a_key(problem):
    space = problem.space(contextual=True)
    assert [axis.name for axis in space.variables] == ["family.average_radius", "side", "task.base_inset"]
    assert space.variables[-1].low == 0.0 and space.variables[-1].high == 1.0
    # object: egg or cylinder, one number each; then the weights 5, 7, 4 scaled.
    assert [context.features for context in space.contexts] == [
        (1.0, 0.0, pytest.approx(1 / 3)),
        (1.0, 0.0, 1.0),
        (0.0, 1.0, 0.0),
    ]
    shared = {name: value for name, value in VALUES.items() if "inset" not in name} | {
        "task.base_inset": 0.25
    }
    assert problem.changes(shared, 1)["task", "base_inset_m"] == pytest.approx(0.004)
    assert problem.changes(shared, 2)["task", "base_inset_m"] == pytest.approx(-0.002)
    assert problem.violated(shared) == {}
    assert set(space.start) == {axis.name for axis in space.variables}


def test_a_candidate_becomes_a_study(problem):
    egg, cylinder = problem.apply(VALUES, 1), problem.apply(VALUES, 2)
    assert (egg.task.object.shape, egg.task.extra_weights) == ("egg", 7)
    assert (cylinder.task.object.shape, cylinder.task.base_inset_m) == ("cylinder", -0.001)
    assert egg.task.base_inset_m == 0.01 and egg.family.average_radius_m == 0.008
    assert [segment.modules for segment in egg.chain.segments] == [6, 7, 7, 7]
    assert egg.chain.base.roll_rad == pytest.approx(np.pi / 2)
    assert egg.chain.segments[1].rotation_rad == 0.85
    assert problem.study.task.extra_weights == 5


def test_a_design_that_cannot_be_is_refused(problem):
    with pytest.raises(InvalidDesignError):
        problem.apply({**VALUES, "family.average_radius": 0.002}, 0)


def test_constraints_on_many_trials_equal_those_on_each(problem):
    rng = np.random.default_rng(3)
    trials = [
        Trial(
            k, {**VALUES, "n1": int(rng.integers(1, 9)), "family.average_radius": rng.uniform(4e-3, 9e-3)}, c
        )
        for k, c in enumerate(rng.integers(-1, 3, 40).tolist())
    ]
    alone = [problem.violated(trial.values, trial.context) for trial in trials]
    assert problem.violated_each(trials) == alone
    assert any(alone) and not all(alone)
    assert problem.violated_each([]) == []


def test_constraints_on_variables_and_on_metrics_are_apart(problem):
    assert problem.violated(VALUES) == {}
    broken = problem.violated({**VALUES, "n1": 3, "family.average_radius": 0.006})
    assert set(broken) == {problem.constraints[n].text for n in (0, 1, 2)}
    # R − r ≥ l/2 with 6, 2 and 11 mm: 1.5 mm over the sum of all terms.
    assert broken[problem.constraints[2].text] == pytest.approx(1.5 / 13.5)
    assert problem.metric_violations(VALUES, {"slip_m": 0.003}) == {"slip <= 2 mm": pytest.approx(1 / 5)}
    assert problem.metric_violations(VALUES, {"slip_m": 0.001}) == {}
    for unknown in (None, float("nan")):
        assert problem.metric_violations(VALUES, {"slip_m": unknown}) == {"slip <= 2 mm": 1.0}


def test_objectives_are_minimised_and_named_with_or_without_their_unit(problem):
    assert problem.objective_names == ("z_max - 0.01 * task.pressure / 15 kPa", "rmse")
    assert problem.maximised == (True, False)
    found = problem.objective_values(VALUES, {"z_max_m": 0.05, "rmse": 0.003})
    assert found == (pytest.approx(-0.04), 0.003)
    assert np.isnan(problem.objective_values(VALUES, {"z_max_m": float("nan"), "rmse": 0.003})[0])
    assert np.isnan(problem.objective_values(VALUES, {"z_max_m": 0.05, "rmse_m": None})[1])


def test_metric_names_are_looked_up_in_all_formulas(problem):
    given = {"z_max_m": 0.05, "rmse_m": 1.0, "e_max_m": None, "slip_m": 0.0, "mode": "slip"}
    problem.require_metrics(given)
    for wrong, message in (
        (
            {"rmse_m": ..., "rmsee_m": 1.0},
            r"did you mean 'rmsee'\? Numbers that the task gives: z_max, slip, rmsee",
        ),
        ({"rmse_m": "small"}, "'rmse', which the task gives, but not as a number"),
        (
            {"slip_m": ...},
            "'slip <= 2 mm' names 'slip', which is no variable, no key of the study and no metric",
        ),
        ({"e_max_m": ...}, "'rmse <= 5 mm and e_max <= 5 mm' names 'e_max'"),
    ):
        changed = {name: value for name, value in {**given, **wrong}.items() if value is not ...}
        with pytest.raises(UserError, match=message):
            problem.require_metrics(changed)


def test_until(problem):
    assert problem.reached(VALUES, {"rmse_m": 0.004, "e_max_m": 0.005})
    assert not problem.reached(VALUES, {"rmse_m": 0.004, "e_max_m": 0.0051})
    assert not problem.reached(VALUES, {"rmse_m": float("nan"), "e_max_m": 0.001})
    assert not problem.reached(VALUES, {"rmse_m": 0.001})  # e_max was not measured in this run


def test_a_start_outside_the_range_is_ignored_and_said(tmp_path):
    problem = search_problem(
        tmp_path, "variables: {family.average_radius: {low: 7 mm, high: 9 mm}}\nobjective: a"
    )
    assert problem.space().start == {"family.average_radius": pytest.approx(0.008)}
    assert "the study's 6 mm lies outside 7 mm to 9 mm" in problem.start_notes()[0]
    anywhere = search_problem(
        tmp_path, "variables: {family.average_radius: {low: 7 mm, high: 9 mm}}\nobjective: a\nstart: anywhere"
    )
    assert anywhere.space().start == {} and anywhere.start_notes() == ()


def formula(
    constraint="rmse <= 1",
    objective="rmse",
    variables="x: {key: task.friction, low: 0.5, high: 0.9}",
    more="",
):
    return f"variables:\n  {variables}\nconstraints: [{constraint}]\nobjective: {objective}\n{more}"


@pytest.mark.parametrize(
    ("search", "message"),
    [
        (formula(constraint="x + family.waal <= 1"), r"search.constraints.0 .*did you mean 'wall'"),
        (formula(constraint="x + 1"), "needs a comparison"),
        (formula(objective="famly.wall"), "'famly.wall' is no key of this study: .*did you mean 'family'"),
        (formula(objective="x <= 1"), "needs a number"),
        (formula(objective="sqr(x)"), "no function 'sqr'; did you mean 'sqrt'"),
        (formula(objective="[]"), "'search.objective' is an empty list"),
        (formula(objective="[rmse, rmse]"), "'search.objective' has 'rmse' twice"),
        (formula(constraint="rmse <= 1, rmse <= 1"), "'search.constraints' has 'rmse <= 1' twice"),
        (formula(constraint="x == 0.7"), "hardly equals another"),
        (formula(constraint="task.object <= 1"), "neither a number nor a text"),
        (formula(constraint="task.tendon_force <= 1"), "not given in the study"),
        (formula(variables="min: {key: task.friction, low: 0, high: 1}"), "name of a function"),
        (
            formula(constraint="task.extra_weights <= 3", more="conditions: {a: {task.extra_weights: 1}}"),
            "differs from condition to condition",
        ),
        (formula(more="until: rmse"), "search.until 'rmse' needs a comparison"),
    ],
)
def test_mistakes_in_formulas(tmp_path, search, message):
    with pytest.raises(UserError, match=message):
        search_problem(tmp_path, search)


def test_a_study_without_a_search_says_so(tmp_path):
    (tmp_path / "a.yaml").write_text(BASE)
    with pytest.raises(UserError, match="has no 'search' block"):
        SearchProblem.from_study(load_study(tmp_path / "a.yaml", REGISTRY), REGISTRY)


def test_too_many_and_no_branches(tmp_path):
    names = "\n".join(
        f"  n{i}: {{key: chain.segments.{i}.modules, low: 1, high: 40, each: true}}" for i in range(4)
    )
    many = search_problem(tmp_path, f"variables:\n{names}\nobjective: rmse")
    with pytest.raises(UserError, match="2560000 combinations"):
        many.branches()
    none = search_problem(tmp_path, f"variables:\n{names}\nobjective: rmse\nconstraints: [n0 + n1 > 80]")
    with pytest.raises(UserError, match=r"no combination .* 'n0 \+ n1 > 80'"):
        none.branches()
