"""A study's search through the store: conditions, fronts, recommendations, robustness, exported files."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from tests.search.toy_search import Narrowing, Watched

from pliant.errors import UserError
from pliant_search.records import Verification
from pliant_search.report.document import lines
from pliant_search.stage import JOURNALS, files_folder, search_study
from pliant_search.stage_keys import search_components
from pliant_search.verify.check import converged, merged

LOADED = "search.conditions={light: {chain.payload: 0 g}, heavy: {chain.payload: 5 g}}"
UNCHECKED = "search.verify=null"


def best_in(result, context):
    history = result.history
    return np.nanmin(history.objectives[history.context == context, 0])


def test_each_condition_has_its_own_best_design(optimized):
    result = optimized("optimizer=contextual", "search.budget=24", LOADED, "chain.gravity=[0, 0, -9.81]")
    assert result.conditions == ("light", "heavy")
    assert [design.context for design in result.best] == [0, 1]
    assert [list(design.conditions) for design in result.best] == [["light"], ["heavy"]]
    assert result.evaluations == len(result.history) + 2  # its recommendations are evaluated too
    assert result.simulations == result.evaluations
    for context, design in enumerate(result.best):
        (objective,) = design.objectives.values()
        assert objective <= best_in(result, context)
        assert (design.number == -1) == (objective < best_in(result, context))
    assert set(result.verification.predicted) == {"quasistatic"}


def test_a_search_may_do_without_sensitivity_and_is_gone_on_from(optimized):
    plain, watched = optimized("search.sensitivity=false", UNCHECKED), Watched()
    assert plain.slopes == ()
    assert not [line for line in lines(plain, "quasistatic") if line.startswith("slope ")]
    result = optimized(UNCHECKED, progress=watched)
    assert result.slopes
    assert any("going on from the journal" in note for note in watched.notes)
    assert result.best[0].values == plain.best[0].values


OWN = """\
    task.pressure: {low: 2 kPa, high: 14 kPa}
    chain.module_length: {low: 8 mm, high: 12 mm}
"""
SHARED = """\
    light: {key: task.pressure, low: 2 kPa, high: 8 kPa, only: light}
    heavy: {key: task.pressure, low: 6 kPa, high: 14 kPa, only: heavy}
"""


def test_variables_that_are_one_are_reported_in_their_key_units(optimized):
    result = optimized("optimizer=contextual", "search.budget=12", UNCHECKED, LOADED, change=(OWN, SHARED))
    records = {record.name: record for record in result.variables}
    assert list(records) == ["light", "heavy", "task.pressure"]
    merged_one = records["task.pressure"]
    assert (merged_one.unit, merged_one.low, merged_one.high) == ("Pa", 2e3, 14e3)
    assert list(result.history.values) == ["task.pressure"]
    context, shown = result.history.context, result.history.values["task.pressure"]
    for k, (low, high) in enumerate(((2e3, 8e3), (6e3, 14e3))):
        own = shown[context == k]
        assert len(own) == 6
        assert np.all((low <= own) & (own <= high))
    for design, name in zip(result.best, ("light", "heavy"), strict=True):
        assert set(design.values) == {"light", "heavy"}
        assert design.settings == {"task.pressure_pa": design.values[name]}
        if design.number >= 0:
            rows = np.flatnonzero(context == design.context)
            assert design.values[name] in shown[rows]


def test_the_slopes_in_a_robust_search_are_undisturbed_on_workers_too(opened, optimized):
    robust = "search.robust={samples: 2, laws: false, compare: false, vary: {task.pressure: 20 %}}"
    changes = (robust, "search.budget=4", UNCHECKED)
    study = opened(*changes)
    with ThreadPoolExecutor(2) as pool:
        many = search_study(study.context, study.study, executor=pool).value
    alone = optimized(*changes, store="other")
    assert [slope.name for slope in many.slopes] == ["task.pressure", "chain.module_length"]
    for one, other in zip(many.slopes, alone.slopes, strict=True):
        np.testing.assert_array_equal(one.shares, other.shares)
        np.testing.assert_array_equal(one.objective, other.objective)
        assert one.change == other.change


def test_a_check_without_fem_counts_by_its_prediction(opened, optimized):
    check = Verification({"quasistatic": {"m": 1.0}}, {}, {}, (), 0.0, 0.0)
    study, made = opened("search.budget=4", UNCHECKED).study, optimized("search.budget=4", UNCHECKED)
    for verification, engine, well in (
        (None, "quasistatic", True),
        (check, "quasistatic", True),
        (check, "mujoco", False),
        (replace(check, predicted={"quasistatic": {"m": np.nan}}), "quasistatic", False),
        (replace(check, predicted={}), "quasistatic", False),
    ):
        assert converged(replace(made, verification=verification), study, engine) == well


def test_one_structure_may_be_fixed(optimized):
    one = "search.variables.n={key: chain.modules, low: 3, high: 3, each: true}"
    result = optimized(one, "search.constraints=[n == 3]", "search.budget=4", UNCHECKED)
    assert result.branches == ({"n": 3},)
    assert "n" not in {slope.name for slope in result.slopes}
    assert not any("n == 3" in sentence for sentence in result.limits)


def test_a_recommendation_that_is_better_than_all_that_was_tried_wins(optimized):
    result = optimized("optimizer=knowing", "search.budget=2")
    assert result.best[0].number == -1
    assert result.best[0].values["task.pressure"] == 6.16245e3
    assert result.evaluations == 3
    assert result.best[0].objectives["abs(tip_x - 10 mm)"] < best_in(result, -1)


def test_an_optimizer_with_nothing_left_is_not_taken_for_one_that_is_refused_all(optimized, monkeypatch):
    watched, ask = Watched(), Narrowing.ask
    monkeypatch.setattr(Narrowing, "ask", lambda self, count: ask(self, count) if self.asked < 12 else [])
    result = optimized("search.constraints=[task.pressure <= 8 kPa]", UNCHECKED, progress=watched)
    assert result.refused and result.stopped == "exhausted"
    assert watched.notes[-1] == "stopped early: the optimizer proposes nothing more."


def test_several_objectives_give_a_front(optimized):
    objective = "search.objective=[tip_x, {maximize: tip_z}]"
    result = optimized("optimizer=front", objective, "search.budget=30")
    assert result.maximised == (False, True)
    rows = np.array([list(design.objectives.values()) for design in result.best])
    assert len(rows) > 1
    assert np.all(np.diff(rows[:, 0]) > 0)
    assert np.all(np.diff(rows[:, 1]) > 0)  # tip_z is to be large: what reduces tip_x increases it
    for told in result.history.objectives:  # as minimised: nothing beats a member
        beaten = np.all(told <= rows * [1, -1], axis=1) & np.any(told < rows * [1, -1], axis=1)
        assert not beaten.any()


def test_several_objectives_name_the_optimizers_that_can(opened):
    study = opened("search.objective=[tip_x, tip_z]")
    registry = study.context.registry
    apart = ("optuna", "ppo", "pymoo")  # torch takes seconds to import
    light = tuple(c for c in registry.components if c.kind not in apart)
    context = replace(study.context, registry=replace(registry, components=light))
    with pytest.raises(UserError, match=r"'narrowing' minimises one objective .* use front( or .*)?, or"):
        search_study(context, study.study, workers=1)


@pytest.mark.parametrize(
    "change",
    ["search.objective=rmse", "search.until=tip_xx <= 1 mm", "search.constraints=[tip_xx <= 1 mm]"],
)
def test_a_metric_that_the_task_does_not_measure_is_named_before_anything_is_simulated(opened, change):
    study = opened(change)
    with pytest.raises(UserError, match="no metric of its task"):
        search_study(study.context, study.study, workers=1)
    assert not list(study.context.store.root.rglob("*.jsonl"))


def test_another_task_in_a_condition_may_measure_something_else(opened, optimized):
    hang = "search.conditions={hang: {task.kind: helical_hang, task.pressure: 5 kPa}}"
    changes = ("search.objective=held", "search.budget=1", UNCHECKED)
    assert optimized(hang, *changes, change=(OWN, OWN.partition("\n")[2])).evaluations == 1
    engine = "search.variables.engine={key: physics.kind, choices: [quasistatic, mujoco]}"
    study = opened(engine, hang, change=(OWN, OWN.partition("\n")[2]))
    kinds = {c.kind for c in search_components(study.context, study.study)}
    assert {"quasistatic", "mujoco", "free_bending", "helical_hang"} <= kinds


ROBUST = "search.robust={samples: 4, laws: false, measure: worst, vary: {task.pressure: 20 %}}"


def first_values(result):
    return {name: float(column[0]) for name, column in result.history.values.items()}


@pytest.mark.slow
def test_a_robust_search_says_what_it_costs(optimized):
    result = optimized(ROBUST, "search.budget=18")
    found = result.robustness
    assert found.sources == ("task.pressure ± 20 %",)
    assert {name: spread.shape for name, spread in found.spread.items()} == {"nominal": (4,), "robust": (4,)}
    assert found.robust_of_robust == pytest.approx(found.spread["robust"].max())
    assert found.robust_of_nominal == pytest.approx(found.spread["nominal"].max())
    assert found.robust_of_robust == pytest.approx(next(iter(result.best[0].objectives.values())))
    assert found.nominal_of_nominal < found.robust_of_nominal
    assert found.nominal.values == optimized("search.budget=18").best[0].values
    assert found.robust_of_robust <= found.robust_of_nominal
    assert result.simulations == 18 * 5
    alone = optimized(ROBUST.replace("{samples", "{compare: false, samples"), "search.budget=18")
    assert alone.robustness is None
    assert alone.simulations == 18 * 5


@pytest.mark.slow
def test_a_robust_search_begins_at_the_nominal_design(optimized):
    changes = (ROBUST, "search.budget=18", "optimizer=cmaes")
    nominal = optimized(*changes, "search.robust=null").best[0]
    result = optimized(*changes)
    assert first_values(result) == dict(nominal.values)
    near = np.abs(np.diff(np.sort(result.history.values["task.pressure"][:6]))).max()
    assert near < 0.5 * 12e3  # of the range: it searches near that design first
    assert result.simulations == 18 * 5  # it is one of the eighteen
    assert first_values(optimized(*changes, "search.start=anywhere")) != dict(nominal.values)


def test_the_nominal_design_takes_part_where_the_optimizer_begins_elsewhere(optimized):
    result = optimized(ROBUST, "search.budget=40")
    assert first_values(result) != dict(result.robustness.nominal.values)
    assert result.simulations == (40 + 1) * 5
    assert result.robustness.robust_of_robust <= result.robustness.robust_of_nominal


def test_where_the_nominal_design_is_the_most_robust_the_words_say_so(optimized):
    # It evaluates the nominal design and nothing else.
    result = optimized(ROBUST, "search.budget=1", "optimizer=cmaes")
    assert result.nominal_is_robust
    (said,) = [line for line in lines(result, "quasistatic") if line.startswith("robust ")]
    assert said.endswith("the best nominal design, nothing more robust was found")


def test_a_robust_search_goes_on_where_the_nominal_design_stays(opened, optimized):
    changes = (ROBUST, "search.until=abs(tip_x - 10 mm) < 0.5 mm", UNCHECKED)
    once = optimized(*changes, "search.budget=30")
    journals = opened(*changes).context.store.root / JOURNALS
    before = set(journals.iterdir())
    assert len(before) == 2  # of the nominal search and of the robust one
    again = optimized(*changes, "search.budget=40")
    assert set(journals.iterdir()) == before
    assert again.best[0].values == once.best[0].values


def test_the_optimizers_files_are_kept(opened):
    study = opened("search.budget=12")
    made = search_study(study.context, study.study, workers=1)
    assert made.value.files == ("best.txt",)
    assert "task.pressure" in (files_folder(study.context, made) / "best.txt").read_text()


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
        study = opened("search.budget=12", UNCHECKED, *changes)
        keys.append(search_study(study.context, study.study, workers=1).key)
    assert (keys[0] != keys[1]) == again


def test_checks_in_several_conditions_become_one():
    answers = {"a": {"m": 2.0}, "b": {"m": 9.0}}
    one = Verification({"a": {"m": 1.0}}, answers, {"a": {"x": {"m": 2.0}}}, (), 1.0, 2.0, ("all", "n"))
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
