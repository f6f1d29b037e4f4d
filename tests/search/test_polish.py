"""Polish: slopes against differences, descents to a known optimum, bounds and constraints, interruption, refusals."""

from dataclasses import replace

import numpy as np
import pytest
from tests.search import evaluation_bench as bench
from tests.search.toy_search import StopError, Watched

from pliant import api
from pliant.config.chain import BaseConfig
from pliant.errors import UserError
from pliant.pipeline.chain import base_rotation
from pliant.pipeline.study import simulate_study
from pliant_search.optimizer import POLISHED
from pliant_search.polish.descent import Descent
from pliant_search.polish.slopes import SlopeEvaluator
from pliant_search.report.document import lines
from pliant_search.report.folder import search_json
from pliant_search.run import polishing

ANGLE = """\
variables:
  pressure: {key: task.pressure, low: 1 kPa, high: 20 kPa}
objective: {maximize: bend_angle}
"""
SHAPE = """\
variables:
  turn: {key: chain.segments.1.rotation, low: 0, high: 3}
  length: {key: chain.segments.1.module_length, low: 4 mm, high: 6 mm}
  roll: {key: chain.base.roll, low: -20 deg, high: 60 deg}
  pressure: {key: task.pressure, low: 5 kPa, high: 15 kPa}
objective: rmse
"""
SPRINGS = """\
variables:
  family.radius: {low: 4 mm, high: 5.5 mm}
  family.length: {low: 8 mm, high: 10 mm}
  task.pressure: {low: 5 kPa, high: 12 kPa}
objective: {maximize: bend_angle}
"""
TRUE = {"turn": 1.2, "length": 5.1e-3, "roll": 0.35, "pressure": 11e3}
TRAVEL = """\
pliant: 1
name: travel
surrogate:
  {kind: polynomial, form: study, joint: prismatic, coefficients: {k_n: 4e-4, m_a: 0.2, b_a: 0, m_e: 9e3, b_e: 900}}
chain: {modules: 3, module_length: 10 mm, module_mass: 4 g, gravity: [-9.81, 0, 0]}
physics: quasistatic
task: {kind: free_bending, pressure: 10 kPa, steps: 2}
"""
LOADED = """\
variables:
  pressure: {key: task.pressure, low: 1 kPa, high: 20 kPa}
  length: {key: chain.module_length, low: 8 mm, high: 12 mm}
  payload: {key: chain.payload, low: 1 g, high: 20 g}
objective: tip_z
"""


def differences(evaluator, values, step=2e-4):
    """Return central differences of whole simulations, (k,)."""
    x, found = evaluator.shares(values), []
    for k in range(len(x)):
        sides = []
        for way in (step, -step):
            moved = x.copy()
            moved[k] += way
            sides.append(evaluator.evaluate(evaluator.with_shares(values, moved)).outcome.objective)
        found.append((sides[0] - sides[1]) / (2 * step))
    return np.array(found)


def agree(one, problem, seeds=(0, 1)):
    """Compare the slopes of drawn candidates with differences of whole simulations."""
    evaluator = SlopeEvaluator(one.context, problem)
    for seed in seeds:
        values = bench.drawn(problem, seed)
        at = evaluator.evaluate(values)
        assert at.trial.state == "ok", at.trial.cause
        slopes = evaluator.slopes(at).objective
        expected = differences(evaluator, values)
        assert np.abs(expected).max() > 0
        assert slopes == pytest.approx(expected, rel=1e-4, abs=1e-5 * np.abs(expected).max())


@pytest.mark.slow
def test_slopes_of_a_shape_of_a_spatial_chain_are_those_of_whole_simulations(tmp_path):
    agree(*bench.opened(tmp_path, bench.SPATIAL, SHAPE))


def test_slopes_through_a_meta_model_are_those_of_whole_simulations(tmp_path):
    agree(*bench.springs(tmp_path, SPRINGS))


def test_slopes_of_a_prismatic_chain_by_input_length_and_payload(tmp_path):
    agree(*bench.opened(tmp_path, TRAVEL, LOADED))


@pytest.mark.slow
def test_slopes_at_several_levels_with_effects_and_in_conditions(tmp_path):
    effects = "effects:\n  - {kind: stiffness, factor: 1.2}\n  - {kind: actuation_gain, gain: 0.9}\n"
    conditions = (
        "over_conditions: worst\nconditions: {free: {chain.payload: 0 g}, held: {chain.payload: 2 g}}\n"
    )
    agree(*bench.opened(tmp_path, bench.SPATIAL + effects, SHAPE + conditions))


def test_the_slope_of_a_hinge_is_its_closed_form(tmp_path):
    one, problem = bench.hinge(tmp_path, ANGLE)
    evaluator = SlopeEvaluator(one.context, problem)
    slopes = evaluator.slopes(evaluator.evaluate({"pressure": 8e3}))
    assert slopes.objective == pytest.approx([-bench.GAIN * 19e3 / bench.STIFFNESS], rel=1e-6)


def own_target(tmp_path):
    """Return the spatial study whose target is its own shape at `TRUE`, and its problem."""
    one, problem = bench.opened(tmp_path, bench.SPATIAL, SHAPE)
    shape = simulate_study(one.context, problem.apply(TRUE, 0)).engines[0].result.metrics["backbone_points_m"]
    points = tmp_path / "points.csv"
    np.savetxt(
        points, _in_base(problem.apply(TRUE, 0), shape), delimiter=",", header="x_m,y_m,z_m", comments=""
    )
    study = bench.SPATIAL.replace("{radius: 18 mm, height: 60 mm}", f"{{points: {points}}}")
    return study.replace("alignment: roll", "alignment: direction")


def _in_base(study, points):
    """Return points of the world in the frame of the base without its roll."""
    return np.asarray(points) @ base_rotation(BaseConfig(direction=study.chain.base.direction))


@pytest.mark.slow
def test_a_perturbed_optimum_is_found_again(tmp_path):
    one, problem = bench.opened(tmp_path, own_target(tmp_path), SHAPE)
    evaluator = SlopeEvaluator(one.context, problem)
    there = evaluator.evaluate(TRUE).trial.objective
    away = evaluator.with_shares(TRUE, evaluator.shares(TRUE) + [0.03, -0.05, 0.04, 0.06])
    start = evaluator.evaluate(away).trial
    path = Descent(evaluator, start, 40).path()
    assert start.objective > 20 * max(there, 1e-5)
    assert path.best.objective <= max(1.05 * there, 2e-6)
    assert evaluator.shares(path.best.values) == pytest.approx(evaluator.shares(TRUE), abs=5e-3)
    assert path.converged
    assert {trial.number for trial in path.trials} == {POLISHED}


def test_a_descent_stops_at_a_bound_and_is_never_worse_than_its_start(tmp_path):
    one, problem = bench.hinge(tmp_path, ANGLE)
    evaluator = SlopeEvaluator(one.context, problem)
    path = Descent(evaluator, evaluator.evaluate({"pressure": 8e3}).trial, 30).path()
    assert path.best.values["pressure"] == 20e3
    again = Descent(evaluator, path.best, 30).path()
    assert again.best.objective == path.best.objective


@pytest.mark.parametrize("constraint", ["bend_angle <= 0.5", "pressure <= 10 kPa"])
def test_a_constraint_on_a_metric_and_on_a_variable_is_respected(tmp_path, constraint):
    one, problem = bench.hinge(tmp_path, f"{ANGLE}constraints: ['{constraint}']\n")
    evaluator = SlopeEvaluator(one.context, problem)
    path = Descent(evaluator, evaluator.evaluate({"pressure": 4e3}).trial, 30).path()
    assert path.best.feasible
    # 0.05 rad per kPa: both hold at 10 kPa
    assert path.best.values["pressure"] == pytest.approx(10e3, rel=1e-4)
    assert path.best.values["pressure"] <= 10e3


@pytest.mark.slow
def test_squares_go_on_along_a_constraint_that_holds_them_up(tmp_path):
    study = own_target(tmp_path)
    one, problem = bench.opened(tmp_path, study, SHAPE + "constraints: ['pressure <= 10 kPa']\n")
    evaluator = SlopeEvaluator(one.context, problem)
    start = evaluator.evaluate({**TRUE, "pressure": 9e3, "turn": 1.0}).trial
    path = Descent(evaluator, start, 40).path()
    assert path.best.feasible
    assert path.best.values["pressure"] == pytest.approx(10e3, rel=1e-3)
    # no other candidate on the constraint is better
    free = [k for k, v in enumerate(evaluator.free) if v.name != "pressure"]
    slopes = evaluator.slopes(evaluator.evaluate(path.best.values)).objective
    steepest = np.abs(evaluator.slopes(evaluator.evaluate(start.values)).objective[free]).max()
    assert np.abs(slopes[free]).max() < 0.05 * steepest


def of_shape(tmp_path, *overrides, progress=None, store="store"):
    """Return the study of its own shape, opened for a short search that is polished."""
    path = tmp_path / "study.yaml"
    if not path.exists():
        body = "".join(
            f"  {line}\n" for line in f"{SHAPE}budget: 24\nverify: null\nsensitivity: false".splitlines()
        )
        path.write_text(f"{own_target(tmp_path)}search:\n{body}optimizer: {{kind: cmaes}}\n")
    one = api.open_study(path, ["search.polish={best: 3}", *overrides], store=tmp_path / store)
    return one if progress is None else replace(one, context=replace(one.context, progress=progress))


@pytest.mark.slow
def test_a_search_polishes_its_best_candidates_counts_and_shows_them(tmp_path):
    plain = api.optimize(of_shape(tmp_path, "search.polish=null"), workers=1)
    result = api.optimize(of_shape(tmp_path), workers=1)
    assert result.best[0].objectives["rmse"] < 0.1 * plain.best[0].objectives["rmse"]
    assert result.best[0].number == POLISHED
    descents = result.polished
    assert 1 <= len(descents) <= 3
    assert descents[0].before == plain.best[0].objectives["rmse"]
    assert min(one.after for one in descents) == result.best[0].objectives["rmse"]
    simulated = sum(one.evaluations for one in descents)
    assert result.evaluations == plain.evaluations + simulated
    assert np.nanmin(result.history.objectives) == result.best[0].objectives["rmse"]
    told = "\n".join(lines(result, "quasistatic"))
    assert "polish   " in told
    assert ", polished" in told
    assert search_json(result, "quasistatic")["polished"][0]["steps"] == descents[0].steps
    side_by_side = api.optimize(of_shape(tmp_path, store="other"), workers=2)
    assert dict(side_by_side.best[0].values) == dict(result.best[0].values)


TOGETHER = (
    "search.conditions={free: {chain.payload: 0 g}, held: {chain.payload: 2 g}}",
    "optimizer={kind: optuna}",
    "search.variables.n={key: chain.segments.0.modules, low: 3, high: 4, each: true}",
    "search.confirm={best: 2, change: {task.steps: 4}}",
    "search.constraints=['tip_x >= 20 mm', 'outside_domain <= 0']",
)


@pytest.mark.slow
@pytest.mark.parametrize("override", TOGETHER)
def test_a_search_is_polished_with_whatever_else_it_has(tmp_path, override):
    result = api.optimize(of_shape(tmp_path, override, "search.polish={best: 2, steps: 12}"), workers=1)
    assert result.best[0].number == POLISHED
    assert all(one.after < one.before and not one.obstacle for one in result.polished)


@pytest.mark.slow
def test_an_interrupted_polish_goes_on_and_ends_as_an_uninterrupted_one(tmp_path, monkeypatch):
    whole = api.optimize(of_shape(tmp_path, store="whole"), workers=1)
    assert len(whole.polished) >= 2
    with pytest.raises(StopError):
        api.optimize(of_shape(tmp_path, progress=Watched(1, title="polishing")), workers=1)
    begun = []
    descended = polishing.descended
    monkeypatch.setattr(polishing, "descended", lambda *how: (begun.append(how[-1]), descended(*how))[1])
    again = api.optimize(of_shape(tmp_path), workers=1)
    assert len(begun) < len(whole.polished)
    assert again.polished == whole.polished
    assert dict(again.best[0].values) == dict(whole.best[0].values)


def test_a_search_without_polish_has_the_keys_of_earlier_results(tmp_path):
    assert "polish" not in of_shape(tmp_path, "search.polish=null").study.canonical()["search"]
    assert of_shape(tmp_path).study.canonical()["search"]["polish"] == {"best": 3, "steps": 40}


REFUSED = (
    ("search.objective=[rmse, task.pressure]", "several"),
    ("search.robust={samples: 2, vary: {task.pressure: 1 kPa}, laws: false}", "search.robust"),
    ("physics=mujoco", "gradients"),
)


@pytest.mark.parametrize(("override", "said"), REFUSED)
def test_what_cannot_be_polished_is_refused_before_the_search(tmp_path, override, said):
    more = ["optimizer={kind: optuna, sampler: nsga2}"] if said == "several" else []
    with pytest.raises(UserError, match=said):
        api.optimize(of_shape(tmp_path, override, *more), workers=1)


def test_a_chain_that_remembers_is_left_as_it_is_with_a_note(tmp_path):
    progress = Watched()
    creep = "effects=[{kind: viscous_damping}]"
    result = api.optimize(of_shape(tmp_path, creep, progress=progress), workers=1)
    assert result.best
    assert any("search.polish left candidates" in note for note in progress.notes), progress.notes
