"""What is said of a best design: each rule where it applies, and silence where it does not."""

import numpy as np
import pytest
from tests.search.found_stand_ins import COUNT, WIDTH, Evaluator, Problem, found, history, many

from pliant.execution.progress import Silent
from pliant.search.analyse.limits import (
    FREE,
    at_bounds,
    at_constraints,
    at_metrics,
    hardest_condition,
    lead_of_structure,
    limits,
    outside_data,
    turned_away,
    unfinished,
)
from pliant.search.analyse.sensitivity import slopes

CONVERGED = 1e-3 + 1e-2 * np.exp(-np.arange(60))


def sloped(problem, formula, best):
    return slopes(problem, best, many(Evaluator(problem, formula)), Silent())


def test_a_bound_beyond_which_it_gets_better_is_named():
    problem, best = Problem((WIDTH,)), found({"width": 4e-3})
    (sentence,) = at_bounds(problem, best, sloped(problem, lambda v: 1e-2 - v["width"], best))
    assert "width stands at its upper bound of 4 mm" in sentence
    assert "by 0.02 mm per 1 % of the range" in sentence


def test_a_bound_on_which_the_best_lies_by_itself_is_not():
    problem, best = Problem((WIDTH,)), found({"width": 4e-3})
    assert at_bounds(problem, best, sloped(problem, lambda v: v["width"], best)) == []
    assert at_bounds(problem, best, sloped(problem, lambda v: 1e-3, best)) == []


def test_an_objective_that_is_a_variable_has_its_unit():
    """By its name or by its key."""
    for name in ("width", "family.width"):
        problem, best = Problem((WIDTH,), objective_names=(name,)), found({"width": 4e-3})
        (sentence,) = at_bounds(problem, best, sloped(problem, lambda v: 1e-2 - v["width"], best))
        assert "by 0.02 mm per 1 % of the range" in sentence


def test_an_integer_on_its_bound():
    problem, best = Problem((COUNT,)), found({"count": 2})
    (sentence,) = at_bounds(problem, best, sloped(problem, lambda v: 1e-3 * v["count"], best))
    assert "count stands at its lower bound of 2" in sentence
    assert "1 mm for one more step" in sentence


def test_a_constraint_that_holds_it_is_told_with_its_price():
    rules = {"width <= 3 mm": lambda v: v["width"] - 3e-3}
    problem, best = Problem((WIDTH,), rules), found({"width": 3e-3})
    (sentence,) = at_constraints(problem, best, sloped(problem, lambda v: 1e-2 - v["width"], best))
    assert "'width <= 3 mm' holds it" in sentence
    assert "improve by 0.02 mm per 1 % of the range of width" in sentence
    (touched,) = at_constraints(problem, best, sloped(problem, lambda v: v["width"], best))
    assert "is touched" in touched


def test_a_constraint_of_integers_is_active_where_the_next_value_breaks_it():
    rules = {"count <= 5": lambda v: v["count"] - 5}
    problem = Problem((COUNT,), rules)
    for count, said in ((5, 1), (4, 0)):
        best = found({"count": count})
        assert len(at_constraints(problem, best, sloped(problem, lambda v: -v["count"], best))) == said


def test_a_constraint_on_a_metric():
    problem = Problem((WIDTH,), metric_rules={"rmse <= 1 mm": lambda m: m["rmse_m"] - 1e-3})
    assert "'rmse <= 1 mm' is active" in at_metrics(problem, found({"width": 3e-3}, 0.995e-3))[0]
    assert at_metrics(problem, found({"width": 3e-3}, 0.5e-3)) == []
    assert "is broken" in at_metrics(problem, found({"width": 3e-3}, 2e-3))[0]


def test_a_constraint_on_a_metric_is_active_in_the_condition_that_it_holds():
    problem = Problem((WIDTH,), metric_rules={"rmse <= 1 mm": lambda m: m["rmse_m"] - 1e-3})
    each = {"egg": {"rmse_m": 0.2e-3}, "tube": {"rmse_m": 0.995e-3}}  # their mean is far from it
    (sentence,) = at_metrics(problem, found({"width": 3e-3}, 0.6e-3, each))
    assert (
        sentence
        == "The constraint 'rmse <= 1 mm' is active: 1 % of 0.995 mm in tube more or less would break it."
    )


def test_inside_everything_nothing_holds_it():
    problem, best = Problem((WIDTH,)), found({"width": 3e-3})
    about = sloped(problem, lambda v: 1e-3 + (v["width"] - 3e-3) ** 2, best)
    assert limits(problem, best, about, history(CONVERGED)) == (FREE,)
    assert limits(problem, best, (), history(CONVERGED)) == ()


def test_a_search_that_still_falls_wants_more():
    problem, best = Problem((WIDTH,)), found({"width": 3e-3})
    (sentence,) = unfinished(problem, best, history(np.linspace(5e-3, 1e-3, 60)))
    assert "candidate 60 of 60" in sentence
    assert "more of them would help" in sentence
    assert unfinished(problem, best, history(CONVERGED)) == []


def test_a_late_best_that_gains_nothing_wants_no_more():
    problem, best = Problem((WIDTH,)), found({"width": 3e-3})
    assert unfinished(problem, best, history(1e-3 - 1e-9 * np.arange(60))) == []


def test_a_first_design_found_at_the_end():
    objective = np.full(40, np.nan)
    objective[-1] = 1e-3
    (sentence,) = unfinished(Problem((WIDTH,)), found({"width": 3e-3}), history(objective))
    assert "first found in the last fifth" in sentence


def test_a_search_that_reached_its_goal_says_so():
    problem, best = Problem((WIDTH,), goal=2e-3), found({"width": 3e-3})
    assert "ended at its goal" in unfinished(problem, best, history(np.linspace(5e-3, 1e-3, 60)))[0]


def test_candidates_that_break_a_constraint_have_no_objective_and_do_not_count():
    falling = np.concatenate([[2e-3, 1e-3], np.full(58, 1.5e-3)])
    falling[50:] = np.nan
    assert unfinished(Problem((WIDTH,)), found({"width": 3e-3}), history(falling)) == []


def test_the_lead_of_the_best_structure():
    structures = ({"n1": 4}, {"n1": 5}, {"n1": 6})
    problem = Problem((WIDTH,), structures=structures)
    told = history([3e-3, 2e-3, 2.5e-3, 1e-3, np.nan, np.nan], branch=[0, 0, 1, 1, 2, 2])
    (sentence,) = lead_of_structure(problem, found({"width": 3e-3, "n1": 5}, branch=1), told)
    assert "(n1 5) leads the next one (n1 4) by 1 mm" in sentence
    assert "1 of 3 structures gave no design" in sentence
    assert lead_of_structure(Problem((WIDTH,)), found({"width": 3e-3}), told) == []


def test_the_lead_counts_recommendations_and_the_designs_own_condition():
    problem = Problem((WIDTH,), structures=({"n1": 4}, {"n1": 5}))
    told = history([3e-3, 2e-3, 0.1e-3], branch=[0, 1, 1], context=np.array([0, 0, 1]))
    (sentence,) = lead_of_structure(problem, found({"width": 3e-3}, branch=0, context=0), told)
    assert "(n1 4) leads the next one (n1 5) by 1 mm" in sentence


def test_the_hardest_condition_is_the_lowest_of_what_is_maximised():
    each = {"egg": {"rmse_m": 3e-3}, "tube": {"rmse_m": 1e-3}}
    best = found({"width": 3e-3}, conditions=each)
    assert "hardest condition is egg (rmse 3 mm), the easiest tube" in hardest_condition(Problem(), best)[0]
    upward = hardest_condition(Problem(maximised=(True,)), best)[0]
    assert "hardest condition is tube (rmse 1 mm), the easiest egg" in upward


def test_laws_outside_their_data():
    each = {"egg": {"outside_domain": 2.0}, "tube": {"outside_domain": 0.0}}
    assert "In egg joints leave" in outside_data(found({}, conditions=each))[0]
    assert outside_data(found({})) == []


@pytest.mark.parametrize(("refused", "said"), [(20, 0), (40, 1)])
def test_candidates_that_came_to_nothing(refused, said):
    status = np.concatenate([np.ones(refused), np.zeros(60 - refused)])
    sentences = turned_away(history(CONVERGED, status=status), {"R - r >= l / 4": 30, "other": 10})
    assert len(sentences) == said
    if said:
        assert "67 % of the candidates" in sentences[0]
        assert "R - r >= l / 4 (30 times)" in sentences[0]


def test_a_constraint_that_only_chooses_the_structures_holds_nothing_back():
    problem = Problem((COUNT,), {"count == 5": lambda v: abs(v["count"] - 5)})
    best = found({"count": 5})
    assert at_constraints(problem, best, sloped(problem, lambda v: -v["count"], best)) != []
    problem.structural = frozenset({"count == 5"})
    assert at_constraints(problem, best, sloped(problem, lambda v: -v["count"], best)) == []
