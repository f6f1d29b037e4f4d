"""Each verdict by a table that calls for it, and which of them comes first."""

from __future__ import annotations

from dataclasses import replace

import pytest
from tests.diagnosis.tables import row, table

from pliant.diagnosis.verdict import THRESHOLDS, UNKNOWN, judge, log_evidence, predicts_unseen

CLEAN = {(): 1.02, ("a",): 1.0, ("b",): 1.01}
MISSING = {(): 9.0, ("a",): 1.0, ("b",): 5.0}
TWINS = {(): 9.0, ("a",): 1.0, ("b",): 1.0}
STRANGE = {(): 90.0, ("a",): 80.0, ("b",): 85.0}
CASES = [
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
]


@pytest.mark.parametrize(("verdict", "squares", "noise", "excited"), CASES)
def test_verdicts(verdict, squares, noise, excited) -> None:
    found = judge(table(squares, **noise), THRESHOLDS, excited)
    assert found.verdict == verdict
    assert found.selected == (("a",) if verdict == "missing_effect" else ())
    assert sum(found.probability.values()) == pytest.approx(1.0)
    assert bool(found.reasons) is (
        verdict not in ("missing_effect", "ambiguous")
    )  # these say it in their headline
    assert all(reason.endswith(".") for reason in found.reasons)


def test_ambiguous_names_both_and_selects_neither() -> None:
    found = judge(table(TWINS), THRESHOLDS, 2)
    assert set(found.credible) == {("a",), ("b",)}
    assert found.selected == ()


def test_unknown_is_credible() -> None:
    assert judge(table(STRANGE), THRESHOLDS, 2).credible == (UNKNOWN,)


@pytest.mark.parametrize(("left", "first"), [(2.5, ("a",)), (4.0, UNKNOWN)])
def test_an_effect_outside_the_list_has_its_price(left: float, first: tuple[str, ...]) -> None:
    """One that brings the error near the floor is believed before an unknown one, which could have any form."""
    evidence = log_evidence(table({(): left + 10.0, ("a",): left}, n=100.0), THRESHOLDS)
    assert max(evidence, key=lambda kinds: evidence[kinds]) == first


@pytest.mark.parametrize(("rise", "predicts"), [(1.02, True), (1.1, False)])
def test_conditions_left_out_may_rise_by_little(rise: float, predicts: bool) -> None:
    made = table({(): 2.0, ("a",): 1.0})
    rows = {
        (): replace(row((), 2.0), unseen=(1.0, 1.0)),
        ("a",): replace(row(("a",), 1.0), unseen=(rise, rise)),
    }
    assert predicts_unseen(replace(made, rows=rows), ("a",)) is predicts
