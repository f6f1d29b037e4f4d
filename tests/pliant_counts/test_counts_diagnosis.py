"""Which number explains counts: the evidence of levels, the verdict, and the candidates of a study."""

import numpy as np
import pytest
from tests.pliant_counts.counts_study import HEADER, STUDY

from pliant.config.loading import load_study
from pliant.config.measurements import PlausibleRange
from pliant.diagnosis.evidence_table import NOTHING, UNKNOWN
from pliant.errors import UserError
from pliant.registry.discovery import discover
from pliant_counts.counted_study import CountedStudy, counted_study
from pliant_counts.diagnosis_page import counts_diagnosis_json, counts_why
from pliant_counts.evidence import probabilities, weighed
from pliant_counts.parameters import (
    VariedParameter,
    effect_parameters,
    scan_levels,
    task_parameters,
)
from pliant_counts.records import CountCondition, Counts, CountSet
from pliant_counts.trials import Setting
from pliant_counts.verdict import judge_counts

REGISTRY = discover()
LOADS = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
FRICTION = VariedParameter("task.friction", "task.friction", "1", (0.6, 0.7, 0.9, 1.0), 0.8)
COLOUR = VariedParameter("task.colour", "task.colour", "1", (1.0, 2.0), 0.0)


def shares(friction, loads=LOADS):
    """Return the success shares of a gripper whose grasp fails softly beyond a load of 10 · friction − 5."""
    return 1.0 / (1.0 + np.exp(-3.0 * (10.0 * friction - 5.0 - loads)))


def counted(sets):
    conditions = tuple(
        CountCondition(
            {"task.extra_weights": k}, f"load {k}", tuple(CountSet(f"s{i}", s, 10) for i, s in enumerate(row))
        )
        for k, row in enumerate(sets)
    )
    return CountedStudy(None, None, Counts(conditions), 12)


def scan(sets, parameters=(FRICTION, COLOUR), present=0.8, m=12):
    """Return the scan with expected counts as simulations; a colour changes nothing."""

    def simulated(friction):
        return tuple((round(m * p), m) for p in shares(friction))

    points = [((), ())] + [((parameter,), (level,)) for parameter in parameters for level in parameter.levels]
    counts = [
        simulated(levels[0] if parameters and parameters[0] is FRICTION else present)
        for parameters, levels in points
    ]
    return weighed(counted(sets), points, counts)


def draw_sets(friction, rng, loads=LOADS):
    return [rng.binomial(10, p, 3).tolist() for p in shares(friction, loads)]


def test_the_right_number_is_named_at_the_right_level():
    right, levels = 0, []
    for seed in range(20):
        found = scan(draw_sets(1.0, np.random.default_rng(seed)))
        judged = judge_counts(found)
        right += judged.verdict == "missing_effect" and judged.selected == ("task.friction",)
        row = found.rows[("task.friction",)]
        levels.append(row.grid[row.best][0])
        assert judged.selected in (("task.friction",), NOTHING)
    assert right >= 15  # the others are ambiguous
    assert levels.count(1.0) >= 18


def test_a_right_model_lacks_nothing():
    verdicts = [judge_counts(scan(draw_sets(0.8, np.random.default_rng(seed)))).verdict for seed in range(20)]
    assert verdicts.count("missing_effect") == 0
    assert verdicts.count("nothing_missing") >= 10


def test_what_no_level_explains_is_outside_the_list():
    upside_down = [[round(10 * p)] * 3 for p in 1.0 - shares(0.8)]
    found = scan(upside_down)
    judged = judge_counts(found)
    assert judged.verdict == "unknown_effect"
    assert next(iter(found.probability)) == UNKNOWN


def test_contradictory_repeats_come_before_any_explanation():
    sets = draw_sets(0.9, np.random.default_rng(0))
    sets[2] = [10, 0, 10]
    judged = judge_counts(scan(sets))
    assert judged.verdict == "not_repeatable" and "load 2" in judged.reasons[0]


def test_two_conditions_are_too_few():
    found = scan(draw_sets(0.9, np.random.default_rng(0)))
    few = weighed(counted([[9], [0]]), [((), ())], [((12, 12), (0, 12))])
    assert judge_counts(few).verdict == "insufficient_data"
    assert judge_counts(found).verdict != "insufficient_data"


def test_what_changes_nothing_is_not_excited_and_found_from_is_a_level():
    judged = judge_counts(scan(draw_sets(0.8, np.random.default_rng(1))))
    assert judged.not_excited == (("task.colour",),)
    assert judged.smallest == {("task.friction",): pytest.approx(0.9, abs=0.21)}


def test_explanations_that_move_the_conditions_in_one_direction_are_alike():
    """`weight` changes every share as friction does, `luck` those of loads that friction does not affect."""
    weight, luck = (
        VariedParameter(f"task.{name}", f"task.{name}", "1", (1.0,), 0.0) for name in ("weight", "luck")
    )
    present, moved = (10, 10, 10, 10, 5, 5), (10, 10, 2, 2, 5, 5)
    other = (10, 10, 10, 10, 0, 0)
    points = [((), ())] + [((parameter,), (1.0,)) for parameter in (FRICTION, weight, luck)]
    simulated = [tuple((count, 12) for count in counts) for counts in (present, moved, moved, other)]
    found = weighed(counted([[8], [8], [5], [5], [2], [2]]), points, simulated)
    judged = judge_counts(found)
    assert {FRICTION.name, weight.name, luck.name} <= {name for kinds in judged.credible for name in kinds}
    ((a, b, share),) = judged.alike
    assert {a, b} == {(FRICTION.name,), (weight.name,)} and share == pytest.approx(0.0, abs=1e-12)


def test_probabilities_sum_to_one_and_pay_for_looking_at_many():
    few = probabilities({NOTHING: -10.0, UNKNOWN: -20.0, ("a",): -8.0})
    many = probabilities(
        {NOTHING: -10.0, UNKNOWN: -20.0, ("a",): -8.0, **{(f"x{k}",): -60.0 for k in range(9)}}
    )
    assert sum(few.values()) == pytest.approx(1.0) and sum(many.values()) == pytest.approx(1.0)
    assert many[("a",)] < few[("a",)]
    assert few[("a",)] / few[NOTHING] == pytest.approx(np.e)  # a difference of 2, divided by 2
    scattered = probabilities({NOTHING: -10.0, UNKNOWN: -20.0, ("a",): -8.0}, scatter=2.0)
    assert scattered[("a",)] / scattered[NOTHING] == pytest.approx(np.sqrt(np.e))


def test_the_contracts_keys():
    found = scan(draw_sets(1.0, np.random.default_rng(0)))
    judged = judge_counts(found)
    result = counts_diagnosis_json(found, judged, REGISTRY)
    contract = {"verdict", "hypotheses", "selected", "credible_set", "not_excited", "indistinguishable"}
    assert set(result) >= contract | {"covariates", "next_experiment", "smallest_detectable"}
    assert sum(h["probability"] for h in result["hypotheses"]) == pytest.approx(1.0)
    best = result["hypotheses"][0]
    assert best["parameters"]["task.friction"]["value"] == 1.0
    assert best["heldout"]["success"]["rmse"] < 0.15
    assert judged.sentence == "Missing: task.friction."
    assert "task.friction 1;" in " ".join(counts_why(found, judged))


def test_levels_lie_on_both_sides_around_the_present_value():
    assert scan_levels(0.6, 1.0, 0.8, 4) == pytest.approx((0.6, 0.7, 0.9, 1.0))
    assert scan_levels(0.0, 4.0, 0.0, 4) == pytest.approx((1.0, 2.0, 3.0, 4.0))
    assert scan_levels(1.0, 4.0, None, 4) == pytest.approx((1.0, 2.0, 3.0, 4.0))


@pytest.fixture
def read(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.yaml").write_text(STUDY)
    (tmp_path / "counts.csv").write_text(HEADER + "a,egg,13,6,6,10\na,cylinder,13,2,9,10\n")
    study = load_study(tmp_path / "study.yaml", REGISTRY)
    return counted_study(study)


def test_a_range_may_hold_for_some_conditions_only(read):
    ranges = [
        {"key": "task.object.radius", "low": "15 mm", "high": "17 mm", "where": {"task.object": "cylinder"}}
    ]
    (parameter,) = task_parameters(read, [PlausibleRange.model_validate(one) for one in ranges])
    egg, cylinder = read.counts.conditions
    settings = [parameter.moved(Setting(read.condition_task(c), ()), c, 0.017) for c in (egg, cylinder)]
    assert [s.task.object.radius_m for s in settings] == [None, 0.017]
    assert parameter.name == "task.object.radius_m where object is cylinder"


def test_effects_with_one_number_are_tried_by_default(read):
    parameters = {parameter.name: parameter for parameter in effect_parameters(REGISTRY, None)}
    assert {"stiffness.factor", "actuation_gain.gain", "pressure_offset.offset_pa"} <= set(parameters)
    assert not {"friction_hysteresis", "sensor_bias"} & {parameter.kind for parameter in parameters.values()}
    condition = read.counts.conditions[0]
    setting = parameters["stiffness.factor"].moved(
        Setting(read.condition_task(condition), ()), condition, 0.7
    )
    assert [(e.kind, e.factor) for e in setting.effects] == [("stiffness", 0.7)]


@pytest.mark.parametrize(
    ("one", "said"),
    [
        ({"key": "task.fricton", "low": 0.6, "high": 1.0}, "did you mean 'task.friction'"),
        ({"key": "task.grasp_height", "low": "6 kg", "high": "9 kg"}, "a length"),
        ({"key": "task.friction", "low": -1.0, "high": 1.0}, "friction"),
        ({"key": "task.friction", "low": 0.6, "high": 1.0, "where": {"object": "cube"}}, "no condition of"),
        ({"key": "task.seed", "low": 1, "high": 3}, "no key of the study's task"),
    ],
)
def test_ranges_that_cannot_be(read, one, said):
    with pytest.raises(UserError) as caught:
        task_parameters(read, [PlausibleRange.model_validate(one)])
    assert said in str(caught.value)


@pytest.mark.parametrize(
    "one", [{"key": "a", "low": 1.0, "high": 1.0}, {"key": "a", "low": "1 mm", "high": 2.0}]
)
def test_ranges_have_two_ends_with_one_kind(one):
    with pytest.raises(ValueError, match=r"low"):
        PlausibleRange.model_validate(one)
