"""Evidence, probabilities and verdicts on tables set by hand; common parts of credible explanations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.diagnosis.tables import row, table

from pliant.diagnosis.evidence_table import (
    COINCIDENCE,
    NOTHING,
    THRESHOLDS,
    UNKNOWN,
    EvidenceTable,
    Kinds,
    credible_set,
    log_evidence,
    predicts_unseen,
    probabilities,
    room_above_floor,
)
from pliant.diagnosis.steps import shared_effects
from pliant.diagnosis.verdict import judge
from pliant.evidence.excess import CLEARLY_ABOVE, Excess

SQUARES = st.floats(0.5, 50.0)


def weighed(found: EvidenceTable) -> dict[Kinds, float]:
    return probabilities(log_evidence(found, THRESHOLDS), THRESHOLDS.temperature)


def odds(t: EvidenceTable, one: tuple[str, ...], other: tuple[str, ...]) -> float:
    evidence = log_evidence(t, THRESHOLDS)
    return evidence[one] - evidence[other]


@given(nothing=st.floats(1.0, 50.0), a=SQUARES, b=SQUARES, n=st.floats(2.0, 1e4), judged=st.booleans())
def test_probabilities_sum_to_one_whatever_the_order(nothing, a, b, n, judged) -> None:
    squares = {(): nothing, ("a",): min(a, nothing), ("b",): min(b, nothing), ("a", "b"): min(a, b, nothing)}
    found = weighed(table(squares, n=n, judged=judged))
    assert sum(found.values()) == pytest.approx(1.0)
    assert list(found.values()) == sorted(found.values(), reverse=True)
    assert (UNKNOWN in found) is judged
    again = weighed(table(dict(reversed(list(squares.items()))), n=n, judged=judged))
    assert list(again) == list(found) and again == pytest.approx(found)
    chosen = credible_set(found)
    assert sum(found[k] for k in chosen) >= 0.9 - 1e-12
    assert sum(found[k] for k in chosen[:-1]) < 0.9


def test_data_without_noise_and_fits_without_equilibrium_have_probabilities() -> None:
    with np.errstate(all="raise"):
        found = weighed(table({(): 4.0, ("a",): 0.0, ("b",): np.inf}, floor=0.0))
    assert sum(found.values()) == pytest.approx(1.0)
    assert next(iter(found)) == ("a",) and found[("b",)] == 0.0
    assert next(iter(weighed(table({(): 0.0, ("a",): 0.0}, floor=0.0)))) == ()


def test_what_a_slightly_wrong_law_explains_is_no_merit() -> None:
    """An effect that explains less than `excited`² of the noise's square gains nothing, for any number of readings."""
    for n in (1e2, 1e4, 1e6):
        assert odds(table({(): 1.0 + 0.9 * THRESHOLDS.excited**2, ("a",): 1.0}, n=n), ("a",), ()) < 0
    assert odds(table({(): 3.0, ("a",): 1.0}), ("a",), ()) > 20


def test_a_further_effect_must_explain_more_than_an_equation_may_leave() -> None:
    alone = {(): 101.0, ("a",): 1.0 + 0.5 * THRESHOLDS.model_form_tolerance * 100, ("b",): 90.0}
    assert odds(table({**alone, ("a", "b"): 1.0}, n=1e4), ("a", "b"), ("a",)) < 0
    assert odds(table({**alone, ("a",): 30.0, ("a", "b"): 1.0}, n=1e4), ("a", "b"), ("a",)) > 0


def test_unknown_is_for_errors_that_nothing_explains() -> None:
    assert next(iter(weighed(table({(): 50.0, ("a",): 45.0}, n=300)))) == UNKNOWN
    assert odds(table({(): 50.0, ("a",): 1.0}, n=300), ("a",), UNKNOWN) > 20
    explained = 10.0  # its remainder under exact equations is no proof
    for left, accepted in ((0.05, True), (0.3, False)):
        single = 1.0 + left * explained
        t = table({(): single + explained, ("a",): single}, n=400.0)
        assert bool(odds(t, ("a",), UNKNOWN) > 0) is accepted


@pytest.mark.parametrize(("left", "first"), [(2.5, ("a",)), (4.0, UNKNOWN)])
def test_an_effect_outside_the_list_has_its_price(left: float, first: tuple[str, ...]) -> None:
    """An effect that brings the error near the floor is preferred to an unknown one, which could have any form."""
    assert next(iter(weighed(table({(): left + 10.0, ("a",): left}, n=100.0)))) == first


def test_an_error_within_the_uncertainty_of_the_floor_is_no_unknown_effect() -> None:
    """Few repeats give a floor that is uncertain by several per cent; more readings do not make it more certain."""

    def with_se(se: float, left: float) -> EvidenceTable:
        t = table({(): left + 1.0, ("a",): left}, n=800.0)
        return replace(t, noise=replace(t.noise, floor_square_se=se))

    assert next(iter(weighed(with_se(0.0, 1.2)))) == UNKNOWN
    assert next(iter(weighed(with_se(0.14, 1.2)))) == ("a",)
    assert weighed(with_se(0.0, 1.2)) == weighed(table({(): 2.2, ("a",): 1.2}, n=800.0))
    unsure, sure = (odds(with_se(se, 2.0), UNKNOWN, ("a",)) for se in (0.14, 0.0))
    # an excess of six standard errors is no error of the floor
    assert unsure == pytest.approx(sure, rel=1e-3)


def test_each_parameter_costs_half_log_n_and_each_effect_by_the_list_length() -> None:
    t = table({(): 3.0, ("a",): 1.0, ("b",): 1.0}, n=100.0)
    t.rows[("b",)].__dict__["n_parameters"] = 2
    assert odds(t, ("a",), ("b",)) == pytest.approx(0.5 * np.log(100.0))
    few = {(): 1.2, ("a",): 1.0}
    many = few | {(kind,): 1.2 for kind in "bcdefghijk"}
    dearer = odds(table(few), ("a",), ()) - odds(table(many), ("a",), ())
    assert dearer == pytest.approx(THRESHOLDS.effect * np.log(12 / 2))


def test_sets_with_one_size_are_weighed_alike_whatever_their_parts_explain_alone() -> None:
    squares = {(): 8.0, ("a",): 3.0, ("b",): 7.0, ("c",): 7.5, ("d",): 7.6, ("a", "b"): 1.0, ("c", "d"): 1.0}
    assert odds(table(squares), ("a", "b"), ("c", "d")) == pytest.approx(0.0)


@pytest.mark.parametrize("n", [1e3, 1e4, 1e6])
def test_a_rival_that_leaves_little_is_not_excluded_by_more_readings(n: float) -> None:
    """An inexact functional form may leave a share of the error, whichever effect it is."""
    little = table({(): 9.0, ("a",): 1.0, ("b",): 1.0 + 0.005 * 8.0}, n=n)
    precise = table({(): 9e4, ("a",): 1.0, ("b",): 1.0 + 0.005 * 9e4}, n=n)
    much = table({(): 9.0, ("a",): 1.0, ("b",): 1.0 + 0.1 * 8.0}, n=n)
    due = THRESHOLDS.rival_form * 0.005 + COINCIDENCE * np.log(1.0 + 0.04 / THRESHOLDS.excited**2)
    assert 0.0 < odds(little, ("a",), ("b",)) <= due
    assert judge(precise, THRESHOLDS, 2).selected == (
        "a",
    )  # it would have to match the other one's form by chance
    assert judge(little, THRESHOLDS, 2).verdict == "ambiguous"
    assert judge(much, THRESHOLDS, 2).selected == ("a",)


@pytest.mark.parametrize("told", [0.3, 0.1, 0.03])
def test_runs_in_which_two_rivals_do_the_same_do_not_lessen_what_another_run_tells(told: float) -> None:
    """One condition shows a change that the rival alone makes; the parameter is its share of all readings."""
    of_condition = {(): (1.0, 9.0), ("a",): (1.0, 1.0), ("b",): (2.2, 1.0)}
    shares = np.array([told, 1.0 - told])
    rows = {
        kinds: replace(row(kinds, float(shares @ square)), squares=tuple((shares * square).tolist()))
        for kinds, square in of_condition.items()
    }
    pooled = replace(table({}, n=30.0 / told), rows=rows)  # 30 independent readings distinguish them
    by_itself = 0.5 * 30.0 * np.log(1.0 + 1.2 / (1.0 + THRESHOLDS.excited**2))
    kept = odds(replace(pooled, shares=tuple(shares.tolist())), ("a",), ("b",))
    assert kept >= by_itself > 10.0
    assert told > 0.1 or odds(pooled, ("a",), ("b",)) < by_itself


def test_with_few_readings_a_rival_keeps_what_they_tell() -> None:
    t = table({(): 9.0, ("a",): 1.0, ("b",): 1.8}, n=20.0)
    assert odds(t, ("a",), ("b",)) < THRESHOLDS.rival_form * 0.1


def test_what_differs_in_one_effect_is_a_class_and_says_what_stands_beside_it() -> None:
    alone = judge(table({(): 9.0, ("a",): 1.0, ("b",): 1.01, ("c",): 5.0}), THRESHOLDS, 3)
    assert (alone.verdict, alone.selected_class, alone.beside) == ("ambiguous", ("a", "b"), ())
    assert alone.sentence.startswith("Missing: a or b; these data do not determine which")
    singles = {(): 40.0, ("a",): 20.0, ("b",): 25.0, ("c",): 25.0}
    pairs = judge(table({**singles, ("a", "b"): 1.0, ("a", "c"): 1.02}), THRESHOLDS, 3)
    assert (set(pairs.selected_class), pairs.beside) == ({"b", "c"}, ("a",))
    apart = judge(table({(): 9.0, ("a",): 1.3, ("a", "b"): 1.0}, n=60.0), THRESHOLDS, 2)
    assert apart.verdict != "ambiguous" or apart.selected_class == ()


def test_a_form_that_is_not_quite_ours_is_said() -> None:
    found = judge(table({(): 60.0, ("a",): 1.8}, n=400.0), THRESHOLDS, 1)
    assert found.selected == ("a",) and "form differs from the catalogue's" in found.reasons[0]
    assert judge(table({(): 60.0, ("a",): 1.0}, n=400.0), THRESHOLDS, 1).reasons == ()


def test_room_above_the_floor_and_errors_over_it() -> None:
    several = {(): 10.0, **{(kind,): 9.9 for kind in "abc"}}
    for found, room in (
        (table({(): 10.0}), True),
        (table({(): 1.05}), False),
        (table(several, n=30.0), True),
        (table(several, n=3.0), False),
        (table({(): 10.0}, floor=np.nan), True),
    ):
        assert room_above_floor(found, (), THRESHOLDS) is room
    found = replace(table({(): 1.0}), rows={(): replace(row((), 1.0), law_price=25.0)})
    for largest, room in ((2.0, True), (24.0, False)):
        assert room_above_floor(replace(found, largest_law_price=largest), (), THRESHOLDS) is room
    assert table({(): 4.0}).over_floor(4.0) == pytest.approx(2.0)
    assert np.isnan([table({(): 4.0}, floor=floor).over_floor(4.0) for floor in (0.0, np.nan)]).all()


CLEAN = {(): 1.02, ("a",): 1.0, ("b",): 1.01}
MISSING = {(): 9.0, ("a",): 1.0, ("b",): 5.0}
TWINS = {(): 9.0, ("a",): 1.0, ("b",): 1.0}
STRANGE = {(): 90.0, ("a",): 80.0, ("b",): 85.0}


@pytest.mark.parametrize(
    ("verdict", "squares", "noise", "excited"),
    [
        ("nothing_missing", CLEAN, {}, 2),
        ("missing_effect", MISSING, {}, 2),
        ("missing_effect", MISSING, {"judged": False}, 2),
        ("ambiguous", TWINS, {}, 2),
        ("unknown_effect", STRANGE, {}, 2),
        ("not_repeatable", MISSING, {"slip": 3.0}, 2),
        ("insufficient_data", MISSING, {"n": 5.0}, 2),
        ("insufficient_data", MISSING, {"readings": 10}, 2),
        ("insufficient_data", MISSING, {"readings": 10, "slip": 3.0}, 2),
        ("insufficient_data", CLEAN, {}, 1),
        ("insufficient_data", CLEAN, {"judged": False}, 2),
        ("missing_effect", {(): 9.0, ("a",): 1.0}, {}, 1),
    ],
)
def test_verdicts(verdict, squares, noise, excited) -> None:
    found = judge(table(squares, **noise), THRESHOLDS, excited)
    assert found.verdict == verdict
    assert found.selected == (("a",) if verdict == "missing_effect" else ())
    assert sum(found.probability.values()) == pytest.approx(1.0)
    assert bool(found.reasons) is (verdict not in ("missing_effect", "ambiguous"))  # their headline states it
    if squares is TWINS:
        assert set(found.credible) == {("a",), ("b",)}
    if squares is STRANGE:
        assert found.credible == (UNKNOWN,)


UNKNOWN_LEFT = {(): 1.12, ("a",): 1.11}


@pytest.mark.parametrize(
    ("squares", "n", "verdict", "sentence"),
    [
        # an error that only thousands of readings distinguish from the noise: there is little to gain
        (
            UNKNOWN_LEFT,
            8000.0,
            "unknown_effect",
            "What is left is small: 1.06 ± 0.01 times the noise (at most 6 % of the error to gain); no listed effect "
            "explains it.",
        ),
        (STRANGE, 200.0, "unknown_effect", "Something is missing, and it is not in the list."),
        (MISSING, 200.0, "missing_effect", "Missing: a."),
        (
            {(): 1.25, ("a",): 1.0},
            500.0,
            "missing_effect",
            "Missing: a. The error without it is small: 1.12 ± 0.04 times the noise (at most 11 % of the error to "
            "gain).",
        ),
        (TWINS, 200.0, "ambiguous", "Missing: a or b; these data do not determine which."),
        (
            {(): 400.0, ("a",): 9.0, ("b",): 9.1},
            200.0,
            "ambiguous",
            "3.01 ± 0.15 times the noise is left: none of these explains all of the error. These data do not decide: "
            "an effect outside the list or a or b.",
        ),
        (CLEAN, 200.0, "nothing_missing", "These data show no missing effect."),
        # 1.21 times the noise, but from few readings: not distinguished from it
        ({(): 1.45, ("a",): 1.45}, 60.0, "nothing_missing", "These data show no missing effect."),
        (
            {(): 2.0, ("a",): 2.0},
            60.0,
            "nothing_missing",
            "No listed effect helps, and the error is 1.42 ± 0.13 times the noise: these data are too few to say more.",
        ),
    ],
)
def test_the_sentence_on_a_verdict_is_about_the_error_size(squares, n, verdict, sentence) -> None:
    """The golden sentences depend on the verdict and on the possible gain; the verdict does not depend on the size."""
    found = judge(table(squares, n=n), THRESHOLDS, 2)
    assert (found.verdict, found.sentence) == (verdict, sentence)
    if verdict == "unknown_effect":
        assert found.as_it_is.ratio == pytest.approx(np.sqrt(1.01 * squares[()]))
        assert found.best.ratio == pytest.approx(np.sqrt(1.01 * squares[("a",)]))
        assert (
            any("well above" in reason or "times the noise" in reason for reason in found.reasons)
            is not found.small
        )


@pytest.mark.parametrize(
    ("ratio", "se", "small", "words"),
    [
        (1.04, 0.06, True, "small: 1.04 ± 0.06 times the noise (at most 4 % of the error to gain)"),
        (1.149, 0.0, True, "small: 1.15 ± 0.00 times the noise (at most 13 % of the error to gain)"),
        (CLEARLY_ABOVE, 0.0, False, ""),
        (1.3, 0.16, True, "not distinguishable from the noise: 1.30 ± 0.16 times it"),
        (1.3, 0.14, False, ""),
        (0.97, 0.05, True, "small: 0.97 ± 0.05 times the noise (nothing to gain)"),
        (2.4, np.nan, False, ""),
        (np.nan, np.nan, False, ""),
    ],
)
def test_an_error_is_small_below_the_border_or_within_two_standard_errors(ratio, se, small, words) -> None:
    assert Excess(ratio, se).small is small
    assert not small or Excess(ratio, se).words == words


@pytest.mark.parametrize(("rise", "predicts"), [(1.02, True), (1.1, False)])
def test_conditions_left_out_may_rise_by_little(rise: float, predicts: bool) -> None:
    plain, better = replace(row((), 2.0), unseen=(1.0, 1.0)), replace(row(("a",), 1.0), unseen=(rise, rise))
    made = replace(table({(): 2.0, ("a",): 1.0}), rows={(): plain, ("a",): better})
    assert predicts_unseen(made, ("a",)) is predicts


# -- effects that represent one another ----------------------------------------------------------------

LAGS = frozenset(map(frozenset, [("damping", "lag"), ("slow_camera", "damping")]))
OPEN: dict[Kinds, float] = {
    ("damping",): 0.24,
    ("lag",): 0.21,
    ("bias", "damping"): 0.18,
    ("slow_camera",): 0.15,
    ("bias", "lag"): 0.12,
    ("bias", "slow_camera"): 0.08,
    NOTHING: 0.02,
}


def core(probability: Mapping[Kinds, float], at_bound=None, alike=LAGS):
    ordered = dict(sorted(probability.items(), key=lambda item: -item[1]))
    found = shared_effects(ordered, alike, at_bound or {}, THRESHOLDS)
    return found and (found.chosen, found.stands_for)


def without(rival: Kinds) -> dict[Kinds, float]:
    return {**{kinds: p * 0.89 / 0.98 for kinds, p in OPEN.items() if kinds}, rival: 0.11}


@pytest.mark.parametrize(
    ("probability", "found"),
    [
        (OPEN, ("damping", ("damping", "lag", "slow_camera"))),  # connected through damping
        ({("a",): 0.6, ("a", "b"): 0.3, ("a", "c"): 0.08, NOTHING: 0.02}, ("a", ("a",))),
        *((without(rival), None) for rival in (NOTHING, UNKNOWN, ("friction",))),
        ({("damping",): 0.5, ("bias", "lag"): 0.5}, None),  # exchanged only where all else is equal
        ({("damping",): 0.95, ("lag",): 0.05}, None),  # one credible hypothesis is a verdict
        (
            {("bias", "damping"): 0.55, ("bias", "lag"): 0.4, ("damping",): 0.03, NOTHING: 0.02},
            ("damping", ("damping", "lag")),
        ),
    ],
)
def test_look_alikes_that_hold_nearly_all_probability_have_a_stand_in(probability, found) -> None:
    assert core(probability) == found
    assert core(OPEN, alike=frozenset()) is None  # effects that the runs distinguish are not exchanged


def test_a_shape_on_its_bound_is_no_stand_in_while_another_is_free() -> None:
    assert core(OPEN, {("damping",): frozenset({"damping"})})[0] == "lag"
    assert core(OPEN, {kinds: frozenset(kinds) for kinds in OPEN})[0] == "damping"
    # it counts for the most probable effect
    assert core(OPEN, {("bias", "damping"): frozenset({"damping"})})[0] == "damping"


def test_an_unexplained_error_says_how_far_it_is_lowered() -> None:
    """A row that halves the error stands beside the sentence: it names that row."""
    lowered = judge(
        table({(): 100.0, ("stiffness",): 36.0, ("mullins",): 90.0, ("leak",): 99.0}, n=400.0), THRESHOLDS, 3
    )
    assert lowered.verdict == "unknown_effect"
    (said,) = lowered.reasons
    assert "stiffness lowers it most, to 6.0" in said and "none explains all of it" in said
    (said,) = judge(table({(): 100.0, ("stiffness",): 96.0, ("leak",): 99.0}, n=400.0), THRESHOLDS, 3).reasons
    assert said.endswith("nor a few of them together, brings it down.")
