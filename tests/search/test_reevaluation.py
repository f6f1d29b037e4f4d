"""Re-evaluation of the best candidates: new trials decide, near twins count once, conditions and refused changes."""

import time

import numpy as np
import pytest
from tests.search.toy_search import Watched

from pliant import api
from pliant.errors import UserError
from pliant_search import workers
from pliant_search.evaluate.evaluator import Evaluator, build_search_problem, evaluated
from pliant_search.optimizer import Trial, Variable
from pliant_search.problem.search_problem import reevaluation_problem
from pliant_search.report.document import lines
from pliant_search.report.folder import search_json
from pliant_search.run.reevaluation import best_apart

NAME = "abs(tip_x - 10 mm)"
BEST = 5
NOISY = ("chain.gravity=[0, 0, -9.81]", "search.verify=null")
HEAVIER = f"search.confirm={{best: {BEST}, change: {{chain.payload: 2 g}}}}"
LOADED = "search.conditions={light: {chain.payload: 0 g}, heavy: {chain.payload: 5 g}}"


def test_the_few_best_are_tried_again_and_the_other_trials_decide(opened):
    study = opened(*NOISY, HEAVIER)
    result = api.optimize(study, workers=1)
    (best,) = result.best
    history = result.history
    order = apart(history)[:BEST]
    heavier = opened(*NOISY, "chain.payload=2 g")
    evaluator = Evaluator(heavier.context, build_search_problem(heavier.context, heavier.study))
    again = [
        evaluator.evaluate({name: float(column[k]) for name, column in history.values.items()}).objectives[0]
        for k in order
    ]
    assert best.objectives[NAME] == pytest.approx(min(again), rel=1e-9)
    chosen = int(order[int(np.argmin(again))])
    assert best.first[NAME] == history.objectives[chosen, 0]
    assert best.values["task.pressure"] == history.values["task.pressure"][chosen]
    assert result.evaluations == len(history) + BEST
    told = "\n".join(lines(result, "quasistatic"))
    assert "in the search, before it was tried again" in told
    assert search_json(result, "quasistatic")["best"]["objectives_before"] == best.first


def apart(history):
    """Return candidates by objective; those left out that are within 5 % of both ranges of a better one."""
    shares = np.column_stack([
        (history.values["task.pressure"] - 2e3) / 12e3,
        (history.values["chain.module_length"] - 8e-3) / 4e-3,
    ])  # fmt: skip
    found = []
    for k in np.argsort(history.objectives[:, 0], kind="stable"):
        if all(np.abs(shares[k] - shares[j]).max() > 0.05 for j in found):
            found.append(int(k))
    return found


def test_near_twins_to_a_better_candidate_are_left_out(optimized):
    history = optimized(*NOISY).history
    assert len(apart(history)) < len(history)
    assert apart(history)[:BEST] != list(np.argsort(history.objectives[:, 0], kind="stable")[:BEST])


def test_choices_and_integers_make_candidates_differ():
    axes = (
        Variable("x", "real", 0.0, 1.0),
        Variable("n", "integer", 1, 4),
        Variable("kind", "categorical", choices=("a", "b")),
    )
    best, twin, far, more, other = (
        {"x": 0.5, "n": 2, "kind": "a"},
        {"x": 0.54, "n": 2, "kind": "a"},
        {"x": 0.56, "n": 2, "kind": "a"},
        {"x": 0.5, "n": 3, "kind": "a"},
        {"x": 0.5, "n": 2, "kind": "b"},
    )
    rows = [(0, told(k, values)) for k, values in enumerate((best, twin, far, more, other))]
    assert [row.number for _, row in best_apart(axes, rows, -1, 5)] == [0, 2, 3, 4]
    assert [row.number for _, row in best_apart(axes, rows[::-1], -1, 2)] == [0, 2]
    assert best_apart(axes, rows, 1, 5) == []


def test_candidates_are_compared_by_the_variables_that_both_have():
    axes = tuple(Variable(name, "real", 0.0, 1.0) for name in ("x", "y"))
    rows = [
        (0, told(k, values))
        for k, values in enumerate(({"x": 0.5}, {"x": 0.5, "y": 0.9}, {"x": 0.9, "y": 0.9}))
    ]
    assert [row.number for _, row in best_apart(axes, rows, -1, 5)] == [0, 2]
    assert [row.number for _, row in best_apart(axes, rows[1:], -1, 5)] == [1, 2]


def told(number, values):
    return Trial(number, values, -1, "ok", (float(number),))


def test_each_condition_chooses_among_its_own(optimized):
    result = optimized(*NOISY, "optimizer=contextual", LOADED, HEAVIER)
    assert [design.context for design in result.best] == [0, 1]
    for design in result.best:
        assert list(design.conditions) == [result.conditions[design.context]]
        assert design.first


def test_conditions_give_way_to_what_is_tried_again(opened):
    study = opened(*NOISY, LOADED, "search.confirm={change: {chain.payload_kg: 0.002, task.steps: 3}}")
    problem = reevaluation_problem(build_search_problem(study.context, study.study))
    values = {v.name: v.variable.low for v in problem.variables}
    for condition in (0, 1):
        tried = problem.apply(values, condition)
        assert (tried.chain.payload_kg, tried.task.steps) == (0.002, 3)


def test_a_journal_serves_with_and_without(optimized):
    optimized(*NOISY)
    watched = Watched()
    optimized(*NOISY, HEAVIER, progress=watched)
    assert any("going on from the journal" in note for note in watched.notes)


def test_its_time_equals_the_search(optimized, monkeypatch):
    before = optimized(*NOISY)

    def slow(*given):
        time.sleep(0.05)
        return evaluated(*given)

    monkeypatch.setattr(workers, "evaluated", slow)
    assert optimized(*NOISY, HEAVIER).wall_s >= before.wall_s + 0.05 * BEST


def test_interrupted_there_it_goes_on_with_those_that_are_left(optimized):
    whole = optimized(*NOISY, HEAVIER, store="whole")
    with pytest.raises(KeyboardInterrupt):
        optimized(*NOISY, HEAVIER, progress=Watched(2, KeyboardInterrupt, "the best once more"))
    result = optimized(*NOISY, HEAVIER)
    assert [vars(design) for design in result.best] == [vars(design) for design in whole.best]
    assert (result.evaluations, result.simulations) == (whole.evaluations, whole.simulations)


def test_more_from_the_best_continue_and_another_change_begins_again(optimized, monkeypatch):
    optimized(*NOISY, HEAVIER)
    tried = []
    monkeypatch.setattr(workers, "evaluated", lambda *given: tried.append(1) or evaluated(*given))
    optimized(*NOISY, HEAVIER.replace(f"best: {BEST}", f"best: {BEST + 2}"), "search.sensitivity=false")
    assert len(tried) == 2
    optimized(*NOISY, HEAVIER.replace("2 g", "3 g"), "search.sensitivity=false")
    assert len(tried) == 2 + BEST


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        (("search.confirm={change: {task.trails: 3}}",), "search.confirm.change"),
        (("search.confirm={change: {task.pressure: 3 kPa}}",), "which the search varies"),
        (("search.objective=[abs(tip_x - 10 mm), tip_z]", "optimizer=front", HEAVIER), "lists several"),
    ],
)
def test_wrong_changes_are_refused_before_the_search(optimized, overrides, said):
    with pytest.raises(UserError, match=said):
        optimized(*NOISY, *overrides)
