"""Evaluation of a candidate: the results of `pliant simulate`, every failure, conditions, reproducibility."""

import numpy as np
import pytest
from tests.search import evaluation_bench as bench
from tests.search.toy_search import Watched

from pliant.errors import UserError
from pliant.pipeline.study import simulate_study
from pliant_search.evaluate.evaluator import Evaluator

ANGLE = """\
variables:
  pressure: {key: task.pressure, low: 1 kPa, high: 20 kPa}
objective: {maximize: bend_angle}
"""
SPATIAL = """\
variables:
  n: {key: chain.segments.0.modules, low: 1, high: 5}
  turn: {key: chain.segments.1.rotation, low: 0, high: 3}
  length: {key: chain.segments.1.module_length, low: 4 mm, high: 6 mm}
  pressure: {key: task.pressure, low: 5 kPa, high: 15 kPa}
  steps: {key: task.steps, choices: [1, 4]}
objective: rmse
"""
SPRINGS = """\
variables:
  family.radius: {low: 4 mm, high: 5.5 mm}
  family.length: {low: 8 mm, high: 10 mm}
  chain.modules: {low: 1, high: 5}
objective: {maximize: bend_angle}
"""


def same_as_simulated(one, problem, seeds):
    """Compare evaluations of random candidates with the stages of `pliant simulate`."""
    evaluator = Evaluator(one.context, problem)
    for seed in seeds:
        values = bench.drawn(problem, seed)
        found = evaluator.evaluate(values)
        stages = simulate_study(one.context, problem.apply(values, 0)).engines[0].result
        assert found.state == "ok", found.cause
        assert found.simulations == 1
        told = {n: v for n, v in stages.metrics.items() if isinstance(v, int | float)}
        assert set(told) <= set(found.metrics)
        for name, value in told.items():
            assert found.metrics[name] == pytest.approx(value, rel=1e-12, abs=1e-14), name
        assert found.metrics["outside_domain"] == len(stages.final.outside_domain)
    assert evaluator.evaluate(values).metrics == found.metrics  # cached values change nothing


SEGMENTS = ("chain: {modules: 2,", "chain: {segments: [{modules: 1}, {modules: 1, family: {radius: 5 mm}}],")
OF_SEGMENTS = """\
variables:
  R2: {key: chain.segments.1.family.radius, low: 4 mm, high: 5.5 mm}
  family.length: {low: 8 mm, high: 10 mm}
objective: {maximize: bend_angle}
"""


@pytest.mark.slow
def test_stated_laws_and_a_meta_models_give_what_the_stages_give(tmp_path):
    same_as_simulated(*bench.opened(tmp_path, bench.SPATIAL, SPATIAL), range(6))
    same_as_simulated(*bench.springs(tmp_path, SPRINGS), range(6))
    same_as_simulated(*bench.springs(tmp_path, OF_SEGMENTS, change=SEGMENTS), range(2))


def test_the_closed_form_for_a_hinge_and_the_sign_in_a_maximised_objective(tmp_path):
    one, problem = bench.hinge(tmp_path, ANGLE)
    found = Evaluator(one.context, problem).evaluate({"pressure": 8e3})
    assert found.objectives == (pytest.approx(-bench.GAIN * 8e3 / bench.STIFFNESS, rel=1e-9),)
    assert found.metrics["converged"] == 1.0
    assert found.wall_s > 0


def test_nothing_is_written_to_the_store_by_candidates(tmp_path):
    one, problem = bench.springs(tmp_path, SPRINGS)
    evaluator = Evaluator(one.context, problem)
    evaluator.evaluate(bench.drawn(problem, 0))
    before = sorted(one.context.store.root.rglob("*"))
    for seed in (1, 2, 3):
        evaluator.evaluate(bench.drawn(problem, seed))
    assert sorted(one.context.store.root.rglob("*")) == before


def test_two_evaluators_agree_to_the_bit(tmp_path):
    one, problem = bench.opened(tmp_path, bench.SPATIAL, SPATIAL)
    first, second = Evaluator(one.context, problem), Evaluator(one.context, problem)
    candidates = [bench.drawn(problem, seed) for seed in range(4)]
    there = [first.evaluate(values).metrics for values in candidates]
    back = [second.evaluate(values).metrics for values in reversed(candidates)]
    assert there == back[::-1]


def test_a_broken_constraint_is_refused_without_simulation(tmp_path):
    one, problem = bench.hinge(tmp_path, f"{ANGLE}constraints: [pressure <= 12 kPa]\n")
    evaluator = Evaluator(one.context, problem)
    found = evaluator.evaluate({"pressure": 15e3})
    assert (found.state, found.simulations, found.objectives) == ("refused", 0, ())
    assert found.violation == pytest.approx(sum(problem.violated({"pressure": 15e3}).values()))
    assert "pressure <= 12 kPa" in found.cause
    assert evaluator.evaluate({"pressure": 11e3}).state == "ok"


SPRING = {"family.radius": 5e-3, "chain.modules": 2}


@pytest.mark.parametrize(
    ("bench_of", "search", "values", "state", "simulations", "cause"),
    [
        (
            bench.springs,
            SPRINGS.replace("low: 8 mm", "low: 3 mm"),
            {**SPRING, "family.length": 4e-3},
            *("refused", 0, "springs needs length ≥ radius"),
        ),
        (
            bench.springs,
            SPRINGS.replace("high: 10 mm", "high: 20 mm"),
            {**SPRING, "family.length": 15e-3},
            *("failed", 1, "outside the meta-model's range"),
        ),
        (bench.hinge, ANGLE.replace("20 kPa", "200 kPa"), {"pressure": 180e3}, "failed", 1, "folds"),
        (
            bench.hinge,
            ANGLE.replace("{maximize: bend_angle}", "log(tip_y - 1)"),
            {"pressure": 8e3},
            *("not_a_number", 1, "log(tip_y - 1)"),
        ),
    ],
)
def test_a_bad_candidate_says_why(tmp_path, bench_of, search, values, state, simulations, cause):
    one, problem = bench_of(tmp_path, search)
    found = Evaluator(one.context, problem).evaluate(values)
    assert (found.state, found.simulations, found.metrics) == (state, simulations, {})
    assert cause in found.cause


def test_an_engine_that_raises_is_survived_and_ctrl_c_inside_compiled_code_is_not(tmp_path, monkeypatch):
    one, problem = bench.hinge(tmp_path, ANGLE)
    evaluator = Evaluator(one.context, problem)

    def breaks(study, draw=None):
        raise error from cause

    monkeypatch.setattr(evaluator.path, "result", breaks)
    error, cause = FloatingPointError("overflow in a joint"), None
    found = evaluator.evaluate({"pressure": 8e3})
    assert (found.state, found.cause) == ("failed", "FloatingPointError: overflow in a joint")
    error, cause = SystemError("returned a result with an exception set"), KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        evaluator.evaluate({"pressure": 8e3})


@pytest.mark.parametrize(
    "search",
    [
        ANGLE.replace("{maximize: bend_angle}", "reward"),
        f"{ANGLE}constraints: [reward >= 1]\n",
        f"{ANGLE}until: reward >= 1\n",
    ],
)
def test_a_metric_that_the_task_lacks_is_a_study_error(tmp_path, search):
    one, problem = bench.hinge(tmp_path, search)
    with pytest.raises(UserError, match="'reward'"):
        Evaluator(one.context, problem).evaluate({"pressure": 8e3})


HANG = ("free_bending, pressure: 10 kPa", "helical_hang, loads: [60 g], pressure: 10 kPa")


def test_what_every_task_measures_is_a_number_whatever_its_own_lists_are_called(tmp_path):
    one, problem = bench.hinge(tmp_path, f"{ANGLE}constraints: [converged >= 1]\n", HANG)
    found = Evaluator(one.context, problem).evaluate({"pressure": 8e3})
    assert (found.state, found.metrics["converged"], found.violation) == ("ok", 1.0, 0.0)


CONDITIONS = """\
variables:
  pressure: {key: task.pressure, low: 1 kPa, high: 20 kPa}
objective: bend_angle
conditions:
  soft: {surrogate.coefficients.b_e: 0.02}
  stiff: {surrogate.coefficients.b_e: 0.04}
"""


@pytest.mark.parametrize(("over", "expected"), [("mean", 0.75), ("worst", 1.0)])
def test_conditions_are_measured_one_by_one_then_their_mean_or_worst_counts(tmp_path, over, expected):
    one, problem = bench.hinge(tmp_path, f"{CONDITIONS}over_conditions: {over}\n")
    found = Evaluator(one.context, problem).evaluate({"pressure": 10e3})
    assert found.conditions["soft"]["bend_angle_rad"] == pytest.approx(1.0, rel=1e-9)
    assert found.conditions["stiff"]["bend_angle_rad"] == pytest.approx(0.5, rel=1e-9)
    assert found.metrics["bend_angle_rad"] == pytest.approx(0.75, rel=1e-9)
    assert found.objectives == (pytest.approx(expected, rel=1e-9),)
    assert found.simulations == 2


def test_a_metric_constraint_counts_by_the_condition_that_breaks_it_most(tmp_path):
    one, problem = bench.hinge(tmp_path, f"{CONDITIONS}constraints: [bend_angle <= 0.4]\n")
    evaluator = Evaluator(one.context, problem)
    both = evaluator.evaluate({"pressure": 10e3})
    assert list(evaluator.evaluate({"pressure": 10e3}, 1).conditions) == ["stiff"]
    soft, stiff = (evaluator.evaluate({"pressure": 10e3}, context).violation for context in (0, 1))
    assert both.state == "ok"
    assert soft > stiff > 0
    assert both.violation == pytest.approx(soft)
    assert evaluator.evaluate({"pressure": 3e3}).violation == 0.0


def test_a_failing_condition_is_named(tmp_path):
    search = CONDITIONS.replace("20 kPa", "200 kPa").replace("0.02", "0.001")
    one, problem = bench.hinge(tmp_path, search)
    found = Evaluator(one.context, problem).evaluate({"pressure": 60e3})
    assert found.state == "failed"
    assert found.cause.startswith("soft: ")


def test_use_outside_the_data_is_a_metric(tmp_path):
    domain = ("b_e: 0.04}}", "b_e: 0.04}, domain: {actuation: [0, 15 kPa], deformation: [-0.5, 0.6]}}")
    one, problem = bench.hinge(tmp_path, f"{ANGLE}constraints: [outside_domain <= 0]\n", domain)
    evaluator = Evaluator(one.context, problem)
    assert evaluator.evaluate({"pressure": 11e3}).violation == 0.0
    beyond = evaluator.evaluate({"pressure": 14e3})
    assert (beyond.state, beyond.metrics["outside_domain"]) == ("ok", 1.0)
    assert beyond.violation > 0


def test_fem_for_each_candidate_is_said_once(tmp_path):
    watched = Watched()
    search = "variables:\n  family.radius: {low: 4 mm, high: 5 mm}\nobjective: {maximize: bend_angle}\n"
    text = bench.BENDING.replace(
        "meta_model: {kind: stand_in, data: TABLE}", "fem: {kind: springs_fem, pressure_max: 10 kPa}"
    )
    one, problem = bench.opened(
        tmp_path, text.replace("TASK", "task: {kind: free_bending, pressure: 10 kPa}"), search
    )
    object.__setattr__(one.context, "progress", watched)
    evaluator = Evaluator(one.context, problem)
    found = [evaluator.evaluate({"family.radius": radius}) for radius in (4.2e-3, 4.5e-3, 4.8e-3)]
    assert [one.state for one in found] == ["ok"] * 3, found
    assert np.all(np.diff([one.metrics["bend_angle_rad"] for one in found]) < 0)  # thicker is stiffer
    assert len([note for note in watched.notes if "FEM of its own" in note]) == 1
