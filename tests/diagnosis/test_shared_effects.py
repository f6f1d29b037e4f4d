"""What credible explanations have in common, on probabilities made by hand."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from pliant.diagnosis.verdict import NOTHING, THRESHOLDS, UNKNOWN, Kinds, shared_effects

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
    return shared_effects(ordered, alike, at_bound or {}, THRESHOLDS)


def test_look_alikes_that_hold_nearly_all_probability_have_a_stand_in():
    found = core(OPEN)
    assert found is not None
    assert found.chosen == "damping"
    assert found.stands_for == ("damping", "lag", "slow_camera")
    assert found.probability == pytest.approx(0.98)


def test_an_effect_that_all_share_is_its_own_group():
    found = core({("a",): 0.6, ("a", "b"): 0.3, ("a", "c"): 0.08, NOTHING: 0.02})
    assert found is not None
    assert (found.chosen, found.stands_for) == ("a", ("a",))


@pytest.mark.parametrize("rival", [NOTHING, UNKNOWN, ("friction",)])
def test_a_tenth_on_anything_else_is_too_much(rival):
    rest = 0.89 / 0.98
    assert core({**{kinds: rest * p for kinds, p in OPEN.items() if kinds}, rival: 0.11}) is None


def test_effects_that_the_runs_tell_apart_are_not_exchanged():
    assert core(OPEN, alike=frozenset()) is None


def test_look_alikes_are_exchanged_only_where_all_else_is_equal():
    """Two look-alikes that never stand in the same place say different things."""
    assert core({("damping",): 0.5, ("bias", "lag"): 0.5}) is None


def test_one_credible_hypothesis_is_a_verdict_and_no_group():
    assert core({("damping",): 0.95, ("lag",): 0.05}) is None


def test_a_shape_on_its_bound_is_no_stand_in_while_another_is_free():
    bound = {("damping",): frozenset({"damping"})}
    assert core(OPEN, bound).chosen == "lag"  # type: ignore[union-attr]
    every = {kinds: frozenset(kinds) for kinds in OPEN}
    assert core(OPEN, every).chosen == "damping"  # type: ignore[union-attr]


def test_the_bound_counts_where_the_effect_is_most_probable():
    assert core(OPEN, {("bias", "damping"): frozenset({"damping"})}).chosen == "damping"  # type: ignore[union-attr]


def test_of_two_groups_the_more_probable_one_comes_first():
    sure = {("bias", "damping"): 0.55, ("bias", "lag"): 0.4, ("damping",): 0.03, NOTHING: 0.02}
    found = core(sure)
    assert found is not None
    assert found.stands_for == ("damping", "lag")


def test_look_alikes_are_joined_over_others():
    """No pair of lag and slow_camera is known; damping joins them."""
    assert frozenset(("lag", "slow_camera")) not in LAGS
    assert len(core(OPEN).stands_for) == 3  # type: ignore[union-attr]
