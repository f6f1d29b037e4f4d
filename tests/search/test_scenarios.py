"""Scenarios of robust designs: closed forms, equality for all candidates, CVaR by its definition, refusals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.law_errors import require_errors_as_the_bar
from tests.search import evaluation_bench as bench

from pliant.errors import UserError
from pliant.pipeline.study import build_study_laws
from pliant_search.config import RobustConfig
from pliant_search.evaluate.evaluator import Evaluator
from pliant_search.evaluate.fast_path import LawDraw
from pliant_search.evaluate.scenarios import draw_scenarios, measure

SLOPE = bench.GAIN / bench.STIFFNESS  # rad of the hinge per Pa
SEARCH = """\
variables:
  pressure: {key: task.pressure, low: 1 kPa, high: 20 kPa}
objective: bend_angle
"""


def robust(**changes):
    return RobustConfig.model_validate({"laws": False, "samples": 16, **changes})


def searched(folder, study=None, **changes):
    """Return the hinge, its problem and an evaluator with scenarios."""
    said = {"laws": False, "samples": 16, **changes}
    one, problem = bench.opened(folder, study or bench.HINGE, f"{SEARCH}robust: {said}\n")
    scenarios = draw_scenarios(problem, one.context.registry, problem.config.robust)
    return problem, scenarios, Evaluator(one.context, problem, scenarios)


def amounts(scenarios, place=0):
    return np.array([one.deviations[place][1] for one in scenarios])


def test_the_hinge_turns_by_every_scenarios_pressure(tmp_path):
    _, scenarios, evaluator = searched(tmp_path, vary={"task.pressure": "0.5 kPa"})
    found = evaluator.evaluate({"pressure": 10e3})
    assert found.scenarios == pytest.approx(SLOPE * (10e3 + amounts(scenarios)), rel=1e-9)
    assert found.objectives == (pytest.approx(np.mean(found.scenarios), rel=1e-12),)
    # One sample in each sixteenth of the range: the mean is nearly that of the range, and both ends are reached.
    assert found.objectives[0] == pytest.approx(SLOPE * 10e3, rel=0.05 / 16)
    assert np.max(found.scenarios) > SLOPE * (10e3 + 500 * 14 / 16)
    assert np.min(found.scenarios) < SLOPE * (10e3 - 500 * 14 / 16)
    assert found.simulations == 17
    assert found.metrics["bend_angle_rad"] == pytest.approx(SLOPE * 10e3, rel=1e-9)  # without scenarios


def test_a_share_refers_to_the_candidates_own_value(tmp_path):
    _, scenarios, evaluator = searched(tmp_path, vary={"task.pressure": "5 %"})
    assert np.abs(amounts(scenarios)).max() <= 0.05
    for pressure in (5e3, 15e3):
        found = evaluator.evaluate({"pressure": pressure}).scenarios
        assert found == pytest.approx(SLOPE * pressure * (1 + amounts(scenarios)), rel=1e-9)


def test_all_candidates_meet_the_same_scenarios(tmp_path):
    _, _, evaluator = searched(tmp_path, vary={"surrogate.coefficients.b_e": "10 %"})
    one, other = (np.array(evaluator.evaluate({"pressure": p}).scenarios) for p in (6e3, 12e3))
    assert other / one == pytest.approx(2.0, rel=1e-9)


def test_seeds_and_keys_have_separate_streams(tmp_path):
    one, problem = bench.hinge(tmp_path, SEARCH)
    keys = {"task.pressure": "1 kPa", "surrogate.coefficients.b_e": "10 %"}

    def drawn(vary, seed=3):
        return draw_scenarios(problem, one.context.registry, robust(vary=vary, samples=200, seed=seed))

    alone, both = drawn({"task.pressure": "1 kPa"}), drawn(keys)
    assert np.array_equal(amounts(alone), amounts(both))
    assert abs(np.corrcoef(amounts(both), amounts(both, 1))[0, 1]) < 0.2
    assert not np.any(amounts(alone) == amounts(drawn({"task.pressure": "1 kPa"}, seed=4)))


def test_a_normal_deviation_is_cut_at_three(tmp_path):
    one, problem = bench.hinge(tmp_path, SEARCH)
    config = robust(vary={"task.pressure": {"sd": "200 Pa"}}, samples=1000)
    found = amounts(draw_scenarios(problem, one.context.registry, config))
    assert np.abs(found).max() <= 600
    assert np.mean(found) == pytest.approx(0, abs=1)
    assert np.std(found) == pytest.approx(200 * 0.9866, rel=0.01)  # of a normal one cut at ±3
    assert np.mean(np.abs(found) < 200) == pytest.approx(0.6827 / 0.9973, abs=0.01)


def test_an_effects_parameter_is_off_as_the_evidence_loop_says(tmp_path):
    effects = "effects:\n  - {kind: stiffness, factor: 0.9}\n"
    vary = {"effects.0.factor": {"sd": 0.03}}
    _, scenarios, evaluator = searched(tmp_path, bench.HINGE + effects, vary=vary)
    found = evaluator.evaluate({"pressure": 10e3})
    assert found.state == "ok", found.cause
    assert found.scenarios == pytest.approx(SLOPE * 10e3 / (0.9 + amounts(scenarios)), rel=1e-6)


def test_a_family_key_is_off_in_segments_with_their_own_value_too(tmp_path):
    text = bench.BENDING.replace(
        "chain: {modules: 2,", "chain: {segments: [{modules: 1}, {modules: 1, family: {radius: 5 mm}}],"
    )
    bench.meta_bench.table(tmp_path)
    text = text.replace("TABLE", str(tmp_path / "fem.csv"))
    text = text.replace("TASK", "task: {kind: free_bending, pressure: 10 kPa, steps: 1}")
    _, scenarios, evaluator = searched(tmp_path, text, vary={"family.radius": "0.2 mm"})
    found = evaluator.evaluate({"pressure": 10e3})
    assert found.state == "ok", found.cause
    expected = [
        sum(bench.meta_bench.free_angle(r + off, 8.6e-3, 10e3) for r in (4.7e-3, 5e-3))
        for off in amounts(scenarios)
    ]
    assert found.scenarios == pytest.approx(expected, rel=0.01)
    assert np.ptp(found.scenarios) == pytest.approx(np.ptp(expected), rel=0.1)  # half where one segment stays


@pytest.mark.slow
def test_drawn_laws_spread_by_their_error_bar_and_share_numbers_between_candidates(tmp_path):
    search = "variables:\n  family.radius: {low: 4.2 mm, high: 5.4 mm}\nobjective: bend_angle\nrobust: {samples: 12}\n"
    one, problem = bench.springs(tmp_path, search)
    scenarios = draw_scenarios(problem, one.context.registry, problem.config.robust)
    evaluator = Evaluator(one.context, problem, scenarios)
    near = [evaluator.evaluate({"family.radius": radius}) for radius in (4.7e-3, 4.7e-3 + 1e-8)]
    assert [found.state for found in near] == ["ok", "ok"], near
    off = [np.array(found.scenarios) - found.metrics["bend_angle_rad"] for found in near]
    assert np.ptp(off[0]) > 0
    assert off[1] == pytest.approx(off[0], abs=0.01 * np.ptp(off[0]))
    study = problem.apply({"family.radius": 4.7e-3}, 0)
    law = build_study_laws(one.context, study)[0].law.law
    draws = (LawDraw(k, 800, problem.config.robust.seed) for k in range(800))
    require_errors_as_the_bar(law, [evaluator.path.laws.stages(study, one)[0].law.law for one in draws])


def test_laws_without_an_error_bar_have_nothing_to_draw(tmp_path):
    _, _, evaluator = searched(tmp_path, laws=True)
    with pytest.raises(UserError, match="no law of this chain states an error"):
        evaluator.evaluate({"pressure": 10e3})


def test_a_scenario_that_fails_makes_the_candidate_fail_by_name(tmp_path):
    _, scenarios, evaluator = searched(tmp_path, vary={"task.pressure": "2 kPa"})
    # The hinge folds beyond half a turn: 62.8 kPa. Only some scenarios go there.
    found = evaluator.evaluate({"pressure": 62e3})
    first = next(
        one for one, off in zip(scenarios, amounts(scenarios), strict=True) if SLOPE * (62e3 + off) > np.pi
    )
    assert found.state == "failed"
    assert found.cause.startswith(f"{first.name}: ")
    assert (found.objectives, found.scenarios) == ((), ())


VALUES = st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=30)


@given(VALUES, st.floats(0.0, 0.99))
def test_cvar_is_the_mean_over_the_worst(values, level):
    """CVaR is the minimum over c of c + mean(max(v − c, 0)) / (1 − level), attained at one of the values."""
    config = robust(vary={"a.b": 1}, measure="cvar", level=level)
    over = np.array(values)
    least = min(c + np.mean(np.maximum(over - c, 0)) / (1 - level) for c in values)
    assert measure(values, config) == pytest.approx(least, rel=1e-9, abs=1e-9)


def test_cvar_at_a_fifth_is_the_mean_over_the_worst_two_in_ten():
    values = [3.0, 9, 1, 4, 1, 5, 9, 2, 6, 5]
    config = robust(vary={"a.b": 1}, measure="cvar", level=0.8)
    assert measure(values, config) == pytest.approx(np.mean(np.sort(values)[-2:]))
    assert measure(values, robust(vary={"a.b": 1}, measure="worst")) == 9
    assert measure(values, robust(vary={"a.b": 1})) == pytest.approx(4.5)
    assert np.isnan(measure([*values, np.nan], config))


@pytest.mark.parametrize(
    ("vary", "sentence"),
    [
        ({"task.presure": "5 %"}, "presure"),
        ({"task.pressure": "5 mm"}, "a pressure"),
        ({"task.pressure": "-5 %"}, "above 0"),
        ({"task.pressure": {"mean": 3}}, "{sd: 0.03}"),
        ({"task.pressure": [1, 2]}, "no width"),
        ({"task.steps": 1}, "numbers with decimals"),
        ({"pressure": "5 %"}, "by dots"),
    ],
)
def test_widths_that_mean_nothing(tmp_path, vary, sentence):
    one, problem = bench.hinge(tmp_path, SEARCH)
    with pytest.raises(UserError) as error:
        draw_scenarios(problem, one.context.registry, robust(vary=vary))
    assert sentence in str(error.value)


def test_nothing_to_vary_is_an_error(tmp_path):
    one, problem = bench.hinge(tmp_path, SEARCH)
    with pytest.raises(UserError, match="varies nothing"):
        draw_scenarios(problem, one.context.registry, robust())


def test_what_the_meta_model_cannot_follow_is_said_at_the_start(tmp_path):
    search = "variables:\n  family.radius: {low: 4.2 mm, high: 5.4 mm}\nobjective: bend_angle\n"
    one, problem = bench.springs(tmp_path, f"{search}robust: {{vary: {{material.shear_modulus: 5 %}}}}\n")
    scenarios = draw_scenarios(problem, one.context.registry, problem.config.robust)
    with pytest.raises(UserError, match=r"material\.shear_modulus.*sweep.*effects"):
        Evaluator(one.context, problem, scenarios)
