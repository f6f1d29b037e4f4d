"""Notes on a best design: each rule where it applies, and no note where it does not."""

import numpy as np
import pytest
from tests.search.found_stand_ins import COUNT, WIDTH, Evaluator, Problem, found, history, many

from pliant.execution.progress import Silent
from pliant_search.analyse.limits import FREE, at_constraints, limits
from pliant_search.analyse.sensitivity import slopes

CONVERGED = 1e-3 + 1e-2 * np.exp(-np.arange(60))
FALLING = np.concatenate([[2e-3, 1e-3], np.full(48, 1.5e-3), np.full(10, np.nan)])


def sloped(problem, formula, best):
    return slopes(problem, best, many(Evaluator(problem, formula)), Silent())


def said(problem=None, best=None, formula=None, told=None, causes=None):
    """Return all notes on a design; none on its slopes without a formula."""
    problem, best = problem or Problem((WIDTH,)), best or found({"width": 3e-3})
    about = sloped(problem, formula, best) if formula else ()
    return limits(problem, best, about, history(CONVERGED) if told is None else told, causes)


WIDE, LOW = found({"width": 4e-3}), found({"count": 2})


@pytest.mark.parametrize(
    ("problem", "best", "formula", "parts"),
    [
        (
            Problem((WIDTH,)),
            WIDE,
            lambda v: 1e-2 - v["width"],
            ["width stands at its upper bound of 4 mm", "by 0.02 mm per 1 % of the range"],
        ),
        (Problem((WIDTH,)), WIDE, lambda v: v["width"], [FREE]),  # on a bound alone
        (Problem((WIDTH,)), WIDE, lambda v: 1e-3, [FREE]),
        (
            Problem((WIDTH,), objective_names=("width",)),
            WIDE,
            lambda v: 1e-2 - v["width"],
            ["by 0.02 mm per"],
        ),
        (
            Problem((WIDTH,), objective_names=("family.width",)),
            WIDE,
            lambda v: 1e-2 - v["width"],
            ["by 0.02 mm per"],
        ),
        (
            Problem((COUNT,)),
            LOW,
            lambda v: 1e-3 * v["count"],
            ["count stands at its lower bound of 2", "1 mm for one more step"],
        ),
        (Problem((WIDTH,)), found({"width": 3e-3}), lambda v: 1e-3 + (v["width"] - 3e-3) ** 2, [FREE]),
    ],
)
def test_a_bound_beyond_which_it_gets_better_is_named(problem, best, formula, parts):
    (sentence,) = said(problem, best, formula)
    assert all(part in sentence for part in parts)
    assert said(problem, best) == ()


def test_a_constraint_that_limits_it_is_reported_with_its_price():
    problem = Problem((WIDTH,), {"width <= 3 mm": lambda v: v["width"] - 3e-3})
    (sentence,) = said(problem, formula=lambda v: 1e-2 - v["width"])
    assert "'width <= 3 mm' limits it" in sentence
    assert "improve by 0.02 mm per 1 % of the range of width" in sentence
    assert "does not improve beyond it" in said(problem, formula=lambda v: v["width"])[0]


def test_an_integer_constraint_is_active_where_the_next_value_breaks_it():
    problem = Problem((COUNT,), {"count <= 5": lambda v: v["count"] - 5, "count == 6": lambda v: 0.0})
    for count, active in ((5, 1), (4, 0)):
        best = found({"count": count})
        about = sloped(problem, lambda v: -v["count"], best)
        assert len(at_constraints(problem, best, about)) == active
        problem.structural = frozenset({"count <= 5"})  # it only chooses the structures: it restricts nothing
        assert at_constraints(problem, best, about) == []
        problem.structural = frozenset()


def test_a_constraint_on_a_metric_is_active_in_the_condition_that_it_holds():
    problem = Problem((WIDTH,), metric_rules={"rmse <= 1 mm": lambda m: m["rmse_m"] - 1e-3})
    for rmse, part in ((0.995e-3, "'rmse <= 1 mm' is active"), (2e-3, "is broken")):
        assert part in said(problem, found({"width": 3e-3}, rmse))[0]
    assert said(problem, found({"width": 3e-3}, 0.5e-3)) == ()
    each = {"egg": {"rmse_m": 0.2e-3}, "tube": {"rmse_m": 0.995e-3}}  # their mean is far from it
    assert "1 % of 0.995 mm in tube more or less" in said(problem, found({"width": 3e-3}, 0.6e-3, each))[0]


@pytest.mark.parametrize(
    ("objective", "goal", "parts"),
    [
        (np.linspace(5e-3, 1e-3, 60), -np.inf, ["candidate 60 of 60", "more of them would help"]),
        ([*[np.nan] * 39, 1e-3], -np.inf, ["first found in the last fifth"]),
        (np.linspace(5e-3, 1e-3, 60), 2e-3, ["ended at its goal"]),
        (CONVERGED, -np.inf, None),
        (1e-3 - 1e-9 * np.arange(60), -np.inf, None),  # a late best that gains nothing
        (FALLING, -np.inf, None),  # candidates that break a constraint have no objective
    ],
)
def test_a_search_that_still_falls_wants_more(objective, goal, parts):
    sentences = said(Problem((WIDTH,), goal=goal), told=history(objective))
    assert len(sentences) == (parts is not None)
    assert all(part in sentences[0] for part in parts or ())


def test_the_lead_by_the_best_structure_counts_recommendations_and_its_own_condition():
    problem = Problem((WIDTH,), structures=({"n1": 4}, {"n1": 5}, {"n1": 6}))
    told = history([3e-3, 2e-3, 2.5e-3, 1e-3, np.nan, np.nan], branch=[0, 0, 1, 1, 2, 2])
    sentence = said(problem, found({"width": 3e-3, "n1": 5}, branch=1), told=told)[0]
    assert "(n1 5) leads the next one (n1 4) by 1 mm" in sentence
    assert "1 of 3 structures gave no design" in sentence
    problem = Problem((WIDTH,), structures=({"n1": 4}, {"n1": 5}))
    told = history([3e-3, 2e-3, 0.1e-3], branch=[0, 1, 1], context=np.array([0, 0, 1]))
    sentence = said(problem, found({"width": 3e-3}, branch=0, context=0), told=told)[0]
    assert "(n1 4) leads the next one (n1 5) by 1 mm" in sentence


def test_the_hardest_condition_is_the_lowest_where_it_is_maximised():
    best = found({"width": 3e-3}, conditions={"egg": {"rmse_m": 3e-3}, "tube": {"rmse_m": 1e-3}})
    assert "hardest condition is egg (rmse 3 mm), the easiest tube" in said(best=best)[0]
    upward = Problem((WIDTH,), maximised=(True,))
    assert "hardest condition is tube (rmse 1 mm), the easiest egg" in said(upward, best)[0]


def test_laws_outside_their_data():
    outside = {"egg": {"outside_domain": 2.0, "rmse_m": 1.0}, "tube": {"outside_domain": 0.0, "rmse_m": 1.0}}
    assert "In egg joints leave" in said(best=found({"width": 3e-3}, conditions=outside))[0]


@pytest.mark.parametrize(("refused", "parts"), [(20, None), (40, ["67 % of the candidates", "4 (30 times)"])])
def test_candidates_that_came_to_nothing(refused, parts):
    status = np.concatenate([np.ones(refused), np.zeros(60 - refused)])
    told = history(CONVERGED, status=status)
    sentences = said(told=told, causes={"R - r >= l / 4": 30, "other": 10})
    assert len(sentences) == (parts is not None)
    assert all(part in sentences[0] for part in parts or ())
