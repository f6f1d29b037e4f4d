"""The page of a diagnosis: one for each verdict, self-contained, reproducible, consistent with the numbers."""

import re
from dataclasses import replace
from functools import cache
from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.diagnosis.quick import (
    REGISTRY,
    effect,
    joint,
    make_measurement,
    make_predictor,
    measured,
    poor,
    ramp,
    rich,
)
from tests.report.pages import check_sound
from tests.slow import slow_among

from pliant.diagnosis.classes import EffectClass
from pliant.diagnosis.diagnosis import class_words, diagnose, explanation
from pliant.diagnosis.evidence_table import NOTHING, UNKNOWN
from pliant.diagnosis.verdict import Verdict
from pliant.evidence.excess import Excess
from pliant.records.term import LawTerm
from pliant.report.chart import ChartBars
from pliant.report.diagnosis import diagnosis_document, implausible, numbers_text
from pliant.report.diagnosis_page import (
    detectable_table,
    explained_chart,
    hypotheses_chart,
    hypotheses_table,
    look_alikes_table,
    not_excited_table,
    parameter_texts,
)
from pliant.report.evidence_view import Diagnosed
from pliant.report.fitted import most_probable, parameter_word, value_text
from pliant.report.render import page as rendered

FEW = ("stiffness", "actuation_gain", "viscoelastic", "thermal_softening")


def ridge(angle, rate, dt, p, t, old, new, c):
    """Return an error of the law across actuation and angle, N·m."""
    return c[0] / (1.0 + ((p / 15e3 - 0.45 + 0.4 * angle) / 0.25) ** 2)


@cache
def made(verdict):
    """Return a measurement whose diagnosis has this verdict, and the diagnosis."""
    chain, kinds, law_error = joint(), FEW, 1e-5
    if verdict == "missing_effect":
        measurement = measured(chain, rich(), effect("viscoelastic"))
    elif verdict == "nothing_missing":
        measurement = measured(chain, rich())
    elif verdict == "unknown_effect":
        measurement, kinds = (
            measured(chain, rich(), effect("viscoelastic", share=0.8, time_s=10.0)),
            ("stiffness", "actuation_gain"),
        )
    elif verdict == "ambiguous":
        chain = joint(gravity=(0, 0, 0))
        measurement = measured(chain, poor(3), effect("stiffness", factor=1.15))
    elif verdict == "law_off":
        law_error = None
        truth = chain.with_(terms=(LawTerm("moment", ridge, (5e-4,)),))
        measurement = measured(truth, rich())
    elif verdict == "not_repeatable":
        measurement = measured(chain, rich(), offset=0.02)
    else:
        measurement = measured(chain, [ramp("only", 500.0, 10.0)])
    predictor = make_predictor(chain, measurement)
    predictor.law_error = law_error
    found = diagnose(predictor, kinds=kinds)
    assert found.verdict == verdict
    return measurement, found


@pytest.fixture(
    scope="module",
    params=slow_among(get_args(Verdict), "ambiguous", "nothing_missing", "unknown_effect", "not_repeatable"),
)
def case(request):
    measurement, found = made(request.param)
    return measurement, found, rendered(diagnosis_document("<b>finger</b>", measurement, found, REGISTRY))


@pytest.fixture(scope="module")
def missing():
    return Diagnosed(*made("missing_effect"))


@pytest.fixture(scope="module")
def ambiguous():
    return Diagnosed(*made("ambiguous"))


HEADLINES = {
    "missing_effect": "Missing: viscoelastic.",
    "ambiguous": "These data do not decide",
    "nothing_missing": "no missing effect",
    "law_off": "No effect is missing; the joint law is off by",
    "unknown_effect": "it is not in the list",
    "not_repeatable": "does not repeat",
    "insufficient_data": "not sufficient for a verdict",
}


def test_every_verdict_has_a_whole_page(case):
    _, found, page = case
    (headline,) = re.findall(r"<h1>(.*?)</h1>", page.html)
    assert (
        "do not determine which" if found.judgement.selected_class else HEADLINES[found.verdict]
    ) in headline
    (sentence,) = re.findall(r'<p class="result">(.*?)</p>', page.html, re.DOTALL)
    assert sentence.strip().endswith(".")
    assert {"hypotheses", "changes_1"} <= set(page.pictures)
    check_sound(page)
    assert not re.search(r"<tbody>\s*</tbody>|<ul[^>]*>\s*</ul>|<p>\s*</p>", page.html)
    sections = re.findall(r"<section.*?</section>", page.html, re.DOTALL)
    assert len(sections) >= 4
    assert all(re.search(r"<img|<td|<p|<li", section) for section in sections)
    assert all(re.search(r"<details( open)?><summary><h2>", section) for section in sections)
    answered = re.findall(r"<dt>(.*?)</dt><dd>.+?</dd>", page.html.split("<img")[0])
    assert answered == ["How good", "What is missing", "How sure", "What next"]
    titles = re.findall(r"<h2>(.*?)</h2>", page.html.split("</aside>")[-1])
    first = next(title for title in titles if title != "In more words")
    assert (first == "Noise") is (found.verdict == "not_repeatable")  # the repeats are the finding
    assert ("repeats" in page.pictures) is (found.verdict != "insufficient_data")  # of a run alone
    assert ("the repeatability of the bench is unknown" in page.html) is (
        found.verdict == "insufficient_data"
    )


def test_the_page_is_escaped_and_the_same_each_time(case):
    measurement, found, page = case
    assert "&lt;b&gt;finger" in page.html and "<b>finger" not in page.html
    if found.verdict == "insufficient_data":  # the smallest
        again = rendered(diagnosis_document("<b>finger</b>", measurement, found, REGISTRY))
        assert again.html == page.html


def test_the_model_as_it_is_and_an_unknown_effect_are_always_among_the_bars(missing, ambiguous):
    for diagnosed in (missing, ambiguous):
        shown = diagnosed.hypotheses()
        assert NOTHING in shown and UNKNOWN in shown
        probability = diagnosed.found.judgement.probability
        assert [probability[k] for k in shown] == sorted((probability[k] for k in shown), reverse=True)


def test_moving_bars_end_at_probabilities_and_loops_stand_over_the_input(ambiguous):
    shown, probability = ambiguous.hypotheses(), ambiguous.found.judgement.probability
    bars = hypotheses_chart(ambiguous).panels[0]
    drawn = bars.select(ChartBars)
    assert [100 * probability.get(kinds, 0.0) for kinds in shown] == [bar.high[0] for bar in drawn]
    assert [bar.at[0] for bar in drawn] == list(range(len(bars.y.names))) and len(drawn) == len(shown)
    chart = explained_chart(ambiguous, "angle_rad")
    assert chart.column == 3
    top, loop = chart.panels[0], chart.panels[2]
    for line, over in zip(top.lines, loop.lines, strict=True):
        np.testing.assert_array_equal(line.y, over.y)
    run = next(one for one in ambiguous.measurement.runs if one.name == top.linked)
    assert loop.lines[0].x.max() == pytest.approx(1e-3 * run.input("pressure_pa").max())


def test_predictions_and_residuals_on_the_page_add_up_to_the_readings(missing):
    for kinds in (NOTHING, ("viscoelastic",)):
        residual = missing.found.readings.unpack(missing.found.fits[kinds].residual)
        for run, model, left in zip(
            missing.measurement.runs, missing.predicted(kinds), residual, strict=True
        ):
            np.testing.assert_allclose(
                model["angle_rad"] + left["angle_rad"], run.outputs["angle_rad"], atol=1e-9
            )


def test_runs_are_chosen_where_the_explanation_takes_most_error(missing):
    fits, readings = missing.found.fits, missing.found.readings
    fall = fits[NOTHING].residual ** 2 - fits[("viscoelastic",)].residual ** 2
    mean = {run.name: fall[readings.run == k].mean() for k, run in enumerate(missing.measurement.runs)}
    chosen = missing.telling_runs(3)
    conditions = missing.before.comparison.conditions
    of = {name: np.mean([mean[n] for n in c.runs]) for c in conditions for name in c.runs}
    assert len({frozenset(next(c.runs for c in conditions if n in c.runs)) for n in chosen}) == 3
    assert min(of[name] for name in chosen) >= sorted({*of.values()})[-3] - 1e-12


def test_two_explanations_are_drawn_where_the_data_do_not_decide(missing, ambiguous):
    assert missing.explanations == (("viscoelastic",),)
    assert {kinds[0] for kinds in ambiguous.explanations} == {"stiffness", "actuation_gain"}


def test_look_alikes_are_named_with_what_tells_them_apart(missing, ambiguous):
    notes = {k: REGISTRY.get("effect", k).implementation_class().notes for k in FEW}
    table = look_alikes_table(ambiguous.found, notes)
    row = next(row for row in table.rows if row[0] == "stiffness")
    assert "actuation_gain" in row[1] and "load without pressure" in row[2]
    pairs = {(pair.a, pair.b) for pair in missing.found.indistinguishable}
    assert ("stiffness", "actuation_gain") not in pairs


def test_effects_that_are_not_excited_have_their_run_and_no_smallest_strength(ambiguous):
    rows = dict(not_excited_table(ambiguous.found).rows)
    assert "temperature" in rows["thermal_softening"]
    assert "thermal_softening" not in [row[0] for row in detectable_table(ambiguous.found).rows]


def test_the_sentence_states_the_left_out_error_reduction(missing):
    table = missing.found.table
    before, after = (table.over_floor(table.rows[k].heldout_square) for k in (NOTHING, ("viscoelastic",)))
    assert f"from {before:.2f} to {after:.2f} × the noise floor" in numbers_text(missing.found)
    assert after < 1.15 < before


def test_parameters_hold_the_truth_within_what_is_printed(missing):
    (share, time) = parameter_texts(missing.found, ("viscoelastic",))
    value, sd = map(float, re.fullmatch(r"share ([\d.]+) ± ([\d.]+)", share).groups())
    assert abs(value - 0.3) < 4 * sd < 0.2
    assert time.startswith("time ") and time.endswith(" s")
    assert hypotheses_table(missing.found, missing.hypotheses()).rows[0][1] == f"{share}; {time}"


@pytest.mark.slow
def test_values_outside_the_plausible_range_are_said():
    chain = joint()
    measurement = measured(chain, rich(), effect("stiffness", factor=2.0))
    found = diagnose(make_predictor(chain, measurement), kinds=("stiffness", "sensor_bias"))
    (text,) = implausible(found)
    assert "stiffness.factor" in text and "0.7 to 1.4" in text
    assert "(implausible" in parameter_texts(found, ("stiffness",))[0]
    assert "plausible range" in rendered(diagnosis_document("f", measurement, found, REGISTRY)).html


@pytest.mark.parametrize(
    ("entry", "text"),
    [
        ({"value": 612.34, "sd": 12.0, "si": "Pa"}, "0.612 ± 0.012 kPa"),
        ({"value": np.radians(-2.5), "sd": np.radians(0.03), "si": "rad"}, "−2.500 ± 0.030°"),
        ({"value": 0.0061, "sd": 0.0004, "si": "K^-1"}, "0.610 ± 0.040 % per K"),
        ({"value": 6.084, "sd": 0.61, "si": "s"}, "6.08 ± 0.61 s"),
        ({"value": 1.2, "sd": np.inf, "si": "1"}, "1.2"),
        ({"value": 0.0, "sd": 0.0, "si": "m"}, "0 mm"),
        ({"value": 1.2, "sd": np.nan, "si": "N"}, "1.2 N"),
    ],
)
def test_values_have_units_for_people_and_the_digits_that_are_known(entry, text):
    assert value_text(**entry) == text


@given(st.floats(1e-3, 1e3), st.floats(1e-4, 1.0))
def test_a_printed_value_is_within_a_twentieth_deviation(value, share):
    """Two digits of the deviation are printed: rounding is at most a twentieth of it, a hundredth of large numbers."""
    sd = share * value
    printed = float(value_text(value, sd, "1").split()[0])
    assert abs(printed - value) <= max(0.051 * sd, 0.006 * value if sd >= 10 else 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("clock", [True, False])
def test_readings_without_noise_or_time_and_missing_ones_have_a_page(clock):
    chain = joint()
    histories = poor(2) if clock else [replace(h, time_s=None) for h in poor(2)]
    measurement = measured(chain, histories, effect("stiffness"), sigma=0.0 if clock else 2e-3)
    holes = [
        {"angle_rad": np.where(np.arange(len(run)) % 7 == 3, np.nan, run.outputs["angle_rad"])}
        for run in measurement.runs
    ]
    punched = make_measurement(histories, holes) if clock else measurement
    found = diagnose(make_predictor(chain, punched), kinds=("stiffness", "actuation_gain"))
    page = rendered(diagnosis_document("f", punched, found, REGISTRY))
    assert "changes_1" in page.pictures and "nan" not in re.sub(r'"data:[^"]*"', "", page.html)


# The last advice of a diagnosis, by the ratio of the remaining error to the floor.
LEFT = [
    ("unknown_effect", 1.06, "Leave the model as it is unless"),
    ("unknown_effect", 2.4, "Do not extend the study"),
    ("nothing_missing", 1.0, "Leave the model as it is for"),
    ("nothing_missing", 1.6, "Record other rates"),
]


@pytest.mark.parametrize("told", slow_among(LEFT, *LEFT[:2]))
def test_what_to_do_is_about_what_is_left_to_gain(told):
    verdict, ratio, says = told
    measurement, found = made(verdict)
    left = replace(found, judgement=replace(found.judgement, as_it_is=Excess(ratio, 0.02)))
    assert diagnosis_document("f", measurement, left, REGISTRY).points[-1].startswith(says)


def test_the_terminal_says_which_explanations_its_table_has_and_orders_them():
    probability = {(f"effect_{k}",): 0.1 - 0.01 * k for k in range(9)} | {NOTHING: 0.001, UNKNOWN: 0.0}
    shuffled = dict(sorted(probability.items(), key=lambda item: str(item[0])[::-1]))
    rows, words = most_probable(shuffled, 6)
    assert rows == [*((f"effect_{k}",) for k in range(6)), NOTHING]
    assert words.startswith("The 6 most probable of 11 explanations") and "the model as it is" in words
    assert most_probable({NOTHING: 0.2, UNKNOWN: 0.8}, 6)[0] == [UNKNOWN, NOTHING]


def test_one_next_run_is_named(case):
    """The page names no other run for a class of look-alikes than the proposed one; the report lists those."""
    _, found, _ = case
    text = " ".join(explanation(found, REGISTRY))
    runs = re.findall(r"run '(\w+)'", text)
    if found.next_run is not None and "Next: " in text:
        assert set(runs) <= {found.next_run.name}


def test_a_class_names_its_run_where_no_other_is_proposed():
    one = EffectClass(
        ("backlash", "stiffness"), "blocked", "the load brings it back", 6.0, (("backlash",), ("stiffness",))
    )
    assert "the run 'blocked' would" in class_words(one)
    assert "the run 'blocked' would" in class_words(one, (), "blocked")
    assert class_words(one, (), "load_steps").endswith("do not distinguish backlash and stiffness.")


@pytest.mark.parametrize(
    ("name", "unit", "word"),
    [
        ("moment_n_m", "N*m", "moment"),
        ("stiffness_n_m_per_rad", "N*m/rad", "stiffness"),
        ("speed_rad_s", "rad/s", "speed"),
        ("rate_per_s", "1/s", "rate"),
        ("coefficient_per_k", "K^-1", "coefficient"),
        ("break_away_rad", "rad", "break away"),
        ("sliding_ratio", "", "sliding ratio"),
    ],
)
def test_names_of_parameters_do_not_repeat_the_unit(name, unit, word):
    assert parameter_word(name, unit) == word
