"""The objective near a design: steps of the range, bounds, integers, choices, refusals."""

from types import SimpleNamespace

import numpy as np
import pytest
from tests.search.found_stand_ins import WIDTH, Evaluator, Problem, found, many

from pliant import api
from pliant.execution.progress import Silent
from pliant_search.analyse.limits import limits
from pliant_search.analyse.sensitivity import probe_values, sides, slopes
from pliant_search.evaluate.evaluator import Evaluator as RealEvaluator
from pliant_search.optimizer import Variable
from pliant_search.problem.search_problem import SearchProblem
from pliant_search.records import VariableRecord

REAL = Variable("width", "real", 2e-3, 4e-3)


def slopes_by_name(problem, formula, best):
    return {slope.name: slope for slope in slopes(problem, best, many(Evaluator(problem, formula)), Silent())}


def test_a_plane_has_its_own_slope_everywhere():
    best = found({"width": 3e-3, "count": 4, "side": "left"})
    slope = slopes_by_name(Problem(), lambda v: 5.0 * v["width"] + 0.1 * v["count"], best)
    assert slope["width"].change == pytest.approx(0.01 * 5.0 * 2e-3)
    assert slope["count"].change == pytest.approx(0.01 * 0.1 * 6)
    assert np.isnan(slope["side"].change)
    assert slope["side"].objective[0] == slope["side"].objective[1]
    np.testing.assert_allclose(slope["width"].objective, 5 * (2e-3 + slope["width"].shares * 2e-3) + 0.4)


def test_a_parabola_is_even_about_its_lowest_point():
    best = found({"width": 3e-3, "count": 4, "side": "left"})
    slope = slopes_by_name(Problem((WIDTH,)), lambda v: ((v["width"] - 3e-3) / 2e-3) ** 2, best)["width"]
    assert slope.change == pytest.approx(1e-4)
    assert slope.objective.min() == 0.0
    assert list(slope.shares) == sorted(slope.shares)
    for step in (0.01, 0.05, 0.5):
        pair = [slope.objective[np.isclose(slope.shares, 0.5 + side * step)] for side in (-1, 1)]
        np.testing.assert_allclose(pair[0], pair[1])
        assert len(pair[0]) == 1


@pytest.mark.parametrize(("width", "bound"), [(2e-3, "low"), (4e-3, "high"), (3e-3, ""), (3.99e-3, "high")])
def test_a_design_on_a_bound_has_one_side(width, bound):
    slope = slopes_by_name(Problem((WIDTH,)), lambda v: v["width"], found({"width": width}))["width"]
    assert slope.at_bound == bound
    assert slope.change == pytest.approx(0.01 * 2e-3)
    assert np.all((slope.shares >= 0) & (slope.shares <= 1))


def test_what_is_refused_or_no_number_is_no_number():
    problem = Problem((WIDTH,), rules={"width <= 3": lambda v: v["width"] - 3e-3})
    slope = slopes_by_name(
        problem, lambda v: np.nan if v["width"] < 2.6e-3 else v["width"], found({"width": 3e-3})
    )["width"]
    assert np.isnan(slope.objective[slope.shares > 0.5]).all()
    assert np.isnan(slope.objective[slope.shares < 0.3]).all()
    assert slope.change == pytest.approx(0.01 * 2e-3)
    below, above = sides(slope.shares, slope.objective, 0.5)
    assert below == pytest.approx(2e-3)
    assert np.isnan(above)


def test_probes_stay_within_their_bounds_and_integers_are_whole():
    assert [value for _, value in probe_values(Variable("count", "integer", 2, 8), 4)] == [2, 3, 5, 6, 7, 8]
    many_ = [value for _, value in probe_values(Variable("count", "integer", 0, 1000), 317)]
    assert {316, 318, 0, 1000} <= set(many_) and len(many_) <= 14
    assert all(isinstance(value, int) for value in many_)
    for at in np.random.default_rng(0).uniform(REAL.low, REAL.high, 50):
        for _, value in probe_values(REAL, float(at)):
            assert REAL.low <= value <= REAL.high
            assert abs(value - at) >= 0.0099 * 2e-3


def test_everything_else_is_held_and_the_context_kept():
    problem = Problem()
    best = found({"width": 3.1e-3, "count": 4, "side": "left"}, context=2)
    evaluator = Evaluator(problem, lambda v: 1.0)
    slopes(problem, best, many(evaluator), Silent())
    for values, context in evaluator.asked:
        assert context == 2
        assert sum(values[name] != best.values[name] for name in values) <= 1


def test_variables_in_other_conditions_are_not_tried():
    class Conditional(Problem):
        @property
        def variables(self):
            width, count, side = super().variables
            count.conditions, side.conditions = (0,), (1,)
            return width, count, side

    best = found({"width": 3e-3, "count": 4, "side": "left"}, context=1)
    problem = Conditional()
    tried = [slope.name for slope in slopes(problem, best, many(Evaluator(problem, lambda v: 1.0)), Silent())]
    assert tried == ["width", "side"]


def test_what_cannot_change_alone_has_no_slope():
    number = VariableRecord("n", ("chain.modules",), "integer", 2, 8, each=True)
    still = VariableRecord("still", ("family.still",), "real", 1.0, 1.0)
    best = found({"n": 4, "still": 1.0})
    assert list(slopes_by_name(Problem((number, still)), lambda v: 1e-3 * v["n"], best)) == ["n"]
    assert (
        slopes_by_name(
            Problem((number,), {"n == 4": lambda v: abs(v["n"] - 4)}), lambda v: 1e-3 * v["n"], best
        )
        == {}
    )


REACH = """\
pliant: 1
name: reach
surrogate:
  kind: polynomial
  form: study
  odd: true
  coefficients: {k_n: 1.637e-6, m_a: -1.704e-6, b_a: 0, m_e: 0.1012, b_e: 0.0245}
chain: {modules: 6, module_length: 11 mm, gravity: [0, 0, 0]}
task: {kind: free_bending, pressure: 5 kPa}
search:
  variables: {n: {key: chain.modules, low: 4, high: 8}, task.pressure: {low: 2 kPa, high: 6 kPa}}
  constraints: [n <= 7]
  objective: {maximize: tip_x}
"""


def test_the_real_evaluator_about_a_real_design(tmp_path):
    (tmp_path / "reach.yaml").write_text(REACH)
    opened = api.open_study(tmp_path / "reach.yaml", store=tmp_path / "store")
    problem = SearchProblem.from_study(opened.study, opened.context.registry)
    evaluator = RealEvaluator(opened.context, problem)
    values = {"n": 7, "task.pressure": 6e3}
    at_best = evaluator.evaluate(values)
    best = found(values, conditions=at_best.conditions)
    best = SimpleNamespace(**{**vars(best), "metrics": at_best.metrics})
    about = slopes(problem, best, many(evaluator), Silent())
    count, pressure = about
    reach = {}
    for n, p in ((6, 6e3), (7, 5.96e3)):
        changed = api.open_study(
            tmp_path / "reach.yaml", [f"chain.modules={n}", f"task.pressure={p}"], store=tmp_path / "store"
        )
        reach[n, p] = api.simulate(changed).engines[0].result.metrics["tip_x_m"]
    np.testing.assert_allclose(count.objective[count.shares == 0.5], -reach[6, 6e3], rtol=1e-9)
    assert np.isnan(count.objective[-1])
    assert pressure.at_bound == "high"
    assert pressure.change == pytest.approx(at_best.metrics["tip_x_m"] - reach[7, 5.96e3], rel=1e-6)
    said = limits(
        problem,
        best,
        about,
        SimpleNamespace(branch=np.zeros(0), context=np.zeros(0), status=[], objectives=np.zeros((0, 1))),
    )
    assert "task.pressure stands at its upper bound of 6 kPa" in said[0]
    assert "'n <= 7' limits it" in said[1]
    assert len(said) == 2
