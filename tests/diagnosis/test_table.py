"""Evidence and probabilities: sums, orders, allowances, thresholds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.diagnosis.tables import table

from pliant.diagnosis.verdict import (
    THRESHOLDS,
    UNKNOWN,
    EvidenceTable,
    credible_set,
    log_evidence,
    probabilities,
    room_above_floor,
    sorted_kinds,
)

SQUARES = st.floats(0.5, 50.0)


@given(nothing=st.floats(1.0, 50.0), a=SQUARES, b=SQUARES, n=st.floats(2.0, 1e4), judged=st.booleans())
def test_probabilities_sum_to_one_whatever_the_order(
    nothing: float, a: float, b: float, n: float, judged: bool
) -> None:
    squares = {(): nothing, ("a",): min(a, nothing), ("b",): min(b, nothing), ("a", "b"): min(a, b, nothing)}
    found = probabilities(
        log_evidence(table(squares, n=n, judged=judged), THRESHOLDS), THRESHOLDS.temperature
    )
    assert sum(found.values()) == pytest.approx(1.0)
    assert list(found.values()) == sorted(found.values(), reverse=True)
    assert (UNKNOWN in found) is judged
    turned = dict(reversed(list(squares.items())))
    again = probabilities(log_evidence(table(turned, n=n, judged=judged), THRESHOLDS), THRESHOLDS.temperature)
    assert list(again) == list(found)
    assert again == pytest.approx(found)
    chosen = credible_set(found)
    assert sum(found[k] for k in chosen) >= 0.9 - 1e-12
    assert sum(found[k] for k in chosen[:-1]) < 0.9


def test_data_without_noise_and_fits_without_equilibrium_have_probabilities() -> None:
    squares = {(): 4.0, ("a",): 0.0, ("b",): np.inf}
    with np.errstate(all="raise"):
        evidence = log_evidence(table(squares, floor=0.0), THRESHOLDS)
        found = probabilities(evidence, THRESHOLDS.temperature)
    assert sum(found.values()) == pytest.approx(1.0)
    assert next(iter(found)) == ("a",)
    assert found[("b",)] == 0.0
    none = probabilities(
        log_evidence(table({(): 0.0, ("a",): 0.0}, floor=0.0), THRESHOLDS), THRESHOLDS.temperature
    )
    assert next(iter(none)) == ()


def odds(t: EvidenceTable, one: tuple[str, ...], other: tuple[str, ...]) -> float:
    evidence = log_evidence(t, THRESHOLDS)
    return evidence[one] - evidence[other]


def test_what_a_slightly_wrong_law_explains_is_no_merit() -> None:
    """An effect that explains less than `excited`² of the noise's square is not paid, however many readings."""
    for n in (1e2, 1e4, 1e6):
        t = table({(): 1.0 + 0.9 * THRESHOLDS.excited**2, ("a",): 1.0}, n=n)
        assert odds(t, ("a",), ()) < 0
    assert odds(table({(): 3.0, ("a",): 1.0}), ("a",), ()) > 20


def test_a_further_effect_must_explain_more_than_an_equation_may_leave() -> None:
    alone = {(): 101.0, ("a",): 1.0 + 0.5 * THRESHOLDS.model_form_tolerance * 100, ("b",): 90.0}
    left = table({**alone, ("a", "b"): 1.0}, n=1e4)
    assert odds(left, ("a", "b"), ("a",)) < 0
    much = table({**alone, ("a",): 30.0, ("a", "b"): 1.0}, n=1e4)
    assert odds(much, ("a", "b"), ("a",)) > 0


def test_unknown_is_for_errors_that_nothing_explains() -> None:
    poor = table({(): 50.0, ("a",): 45.0}, n=300)
    assert max(log_evidence(poor, THRESHOLDS), key=log_evidence(poor, THRESHOLDS).__getitem__) == UNKNOWN
    good = table({(): 50.0, ("a",): 1.0}, n=300)
    assert odds(good, ("a",), UNKNOWN) > 20


def test_each_parameter_costs_half_the_logarithm_of_n() -> None:
    t = table({(): 3.0, ("a",): 1.0, ("b",): 1.0}, n=100.0)
    t.rows[("b",)].__dict__["n_parameters"] = 2
    assert odds(t, ("a",), ("b",)) == pytest.approx(0.5 * np.log(100.0))


def test_room_above_the_floor() -> None:
    assert room_above_floor(table({(): 10.0}), (), THRESHOLDS)
    assert not room_above_floor(table({(): 1.05}), (), THRESHOLDS)
    several = {(): 10.0, **{(kind,): 9.9 for kind in "abc"}}
    assert room_above_floor(table(several, n=30.0), (), THRESHOLDS)
    assert not room_above_floor(table(several, n=3.0), (), THRESHOLDS)
    assert room_above_floor(table({(): 10.0}, floor=np.nan), (), THRESHOLDS)


def test_errors_over_the_floor() -> None:
    assert table({(): 4.0}).over_floor(4.0) == pytest.approx(2.0)
    assert np.isnan(table({(): 4.0}, floor=0.0).over_floor(4.0))
    assert np.isnan(table({(): 4.0}, floor=np.nan).over_floor(4.0))


def test_pairs_have_one_name() -> None:
    assert sorted_kinds(["b", "a"]) == sorted_kinds(["a", "b"]) == ("a", "b")


def test_sets_of_one_size_are_weighed_alike_whatever_their_parts_explain_alone() -> None:
    squares = {(): 8.0, ("a",): 3.0, ("b",): 7.0, ("c",): 7.5, ("d",): 7.6, ("a", "b"): 1.0, ("c", "d"): 1.0}
    assert odds(table(squares), ("a", "b"), ("c", "d")) == pytest.approx(0.0)


def test_what_right_equations_leave_over_is_no_proof_of_the_unknown() -> None:
    explained, n = 10.0, 400.0
    for left, believed in ((0.05, True), (0.3, False)):  # shares of what is explained
        single = 1.0 + left * explained
        t = table({(): single + explained, ("a",): single}, n=n)
        assert bool(odds(t, ("a",), UNKNOWN) > 0) is believed


def test_an_effect_of_a_longer_list_costs_more() -> None:
    few = {(): 1.2, ("a",): 1.0}
    many = few | {(kind,): 1.2 for kind in "bcdefghijk"}
    assert odds(table(few), ("a",), ()) - odds(table(many), ("a",), ()) == pytest.approx(
        THRESHOLDS.effect * np.log(12 / 2)
    )
